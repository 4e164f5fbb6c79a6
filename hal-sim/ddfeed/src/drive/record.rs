//! `drive record`: the drive's telemetry into a recording.

use super::connect::Drive;
use super::motion::{BEAT, Stopped, caught, ready, rest, run_at, tell_on};
use super::options::RecordOptions;
use super::status::look;
use crate::output::Folder;
use crate::record::{EncoderFrame, Recorder, Summary, save};
use crate::ripple::short_text;
use crate::session::divider;
use crate::trigger::{Gate, Trigger};
use anyhow::{Context, Result, anyhow, bail, ensure};
use indicatif::{ProgressBar, ProgressStyle};
use link::codes::State;
use link::host::Count;
use link::host::status::StatusReport;
use link::message::Command;
use link::telemetry::{FRAME_MAX, Request};
use plant::recording::Recording;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

/// How often the drive's state is looked at.
const LOOK: Duration = Duration::from_millis(250);
/// How long a sample may be away.
const SILENT: Duration = Duration::from_secs(2);

/// Records.
pub fn record(drive: &mut Drive, options: &RecordOptions) -> Result<()> {
    let trigger = trigger(options)?;
    let write_mcap = options.mcap_writer()?;
    for ending in [Some("csv.gz"), write_mcap.map(|_| "mcap")]
        .into_iter()
        .flatten()
    {
        let file = options.dir.join(format!("{}.{ending}", options.name));
        ensure!(
            options.replace || !file.exists(),
            "{} is there already: give another --name, or --replace",
            file.display()
        );
    }
    let folder = Folder::open(&options.dir)?;
    let request = Request {
        divider: divider(options.rate)?,
        stream: 1,
    };
    let stop = caught()?;
    if options.arm && !options.hold.is_empty() {
        ready(drive, &stop)?;
    }
    let status = drive.status()?;
    let aligned = status.motors.map(|motor| motor.alignment);
    let encoders = EncoderFrame::both(aligned, &drive.settings()?);
    let (summary, outcome) = save(
        &folder,
        &options.name,
        f64::from(options.rate),
        |recorder| {
            recorder.start(request);
            recorder.align(encoders);
            recorder.supplied(StatusReport::of(status).bus_v());
            if let Some(trigger) = trigger {
                recorder.wait_for(Gate::new(trigger, past_rows(options)));
            }
            let streamed = stream(drive, request, options, trigger, recorder, &stop);
            let rested = if options.hold.is_empty() {
                Ok(())
            } else {
                rest(drive)
            };
            let quiet = drive.tell(Command::Record(
                Request {
                    divider: 0,
                    ..request
                }
                .word(),
            ));
            // The first that failed is the cause.
            streamed.and(rested).and(quiet)
        },
    )?;
    let path = folder.path(&format!("{}.csv.gz", options.name));
    println!("{}: {summary}", path.display());
    if let Some(write) = write_mcap {
        let name = format!("{}.mcap", options.name);
        let about = about(&summary, &folder.path("model.toml"))?;
        folder
            .put(&name, |file| write(&path, file, about))
            .with_context(|| format!("--mcap failed, and {} is kept", path.display()))?;
        println!(
            "{}: the same for PlotJuggler and Foxglove",
            folder.path(&name).display()
        );
    }
    outcome.context("the recording ended early, and what came before is kept")?;
    if !options.hold.is_empty() {
        let feed = drive.settings()?.feed;
        let [lead_m, count_m] = [feed.lead_mm * 1e-3, feed.scale_count_nm * 1e-9];
        let recording = Recording::load(&path)?;
        print!("{}", short_text(&recording, lead_m / TAU, count_m));
    }
    Ok(())
}

/// What an MCAP file says about its recording.
fn about(summary: &Summary, model: &Path) -> Result<BTreeMap<String, String>> {
    let Count {
        rows,
        lost,
        gaps,
        damaged,
    } = summary.count;
    let model = std::fs::read_to_string(model)
        .with_context(|| format!("{} cannot be read", model.display()))?;
    let rate_hz = format!("{:.1}", 1.0 / summary.interval_s);
    let program = concat!("ddfeed ", env!("CARGO_PKG_VERSION")).to_owned();
    let facts = [
        ("program", program),
        ("rate_hz", rate_hz),
        ("rows", rows.to_string()),
        ("rows_lost", lost.to_string()),
        ("gaps", gaps.to_string()),
        ("frames_damaged", damaged.to_string()),
        ("model.toml", model),
    ];
    Ok(facts.map(|(name, fact)| (name.to_owned(), fact)).into())
}

/// What the recording waits for.
fn trigger(options: &RecordOptions) -> Result<Option<Trigger>> {
    let parsed = options.trigger.as_deref().map(str::parse).transpose();
    parsed.map_err(|error: String| anyhow!("--trigger: {error}"))
}

/// Rows that are kept from before a trigger.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn past_rows(options: &RecordOptions) -> usize {
    (options.past * f64::from(options.rate)) as usize
}

/// Moves the drive through its holds, by the recording's own time, and takes what comes.
fn stream(
    drive: &mut Drive,
    request: Request,
    options: &RecordOptions,
    trigger: Option<Trigger>,
    recorder: &mut Recorder,
    stop: &AtomicBool,
) -> Result<()> {
    let seconds = options.seconds();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let bar = ProgressBar::new((seconds * 1e3) as u64)
        .with_style(ProgressStyle::with_template("{bar:40} {msg}")?);
    drive.tell(Command::Record(request.word()))?;
    let (mut holds, mut hold_until) = (options.hold.iter(), 0.0);
    let (mut beaten, mut looked) = (drive.now(), drive.now());
    let (mut last, mut silent) = (0, drive.now());
    while !stop.load(Relaxed) {
        let now = recorder.streamed_s();
        let waits = recorder.gate().is_some();
        let taken = match waits {
            true => 0.0,
            false => recorder.since_trigger_s().unwrap_or(now),
        };
        if taken >= seconds {
            break;
        }
        if waits && !options.hold.is_empty() && now >= options.holds_s() {
            bail!("the trigger did not fire in {now:.1} s of holds");
        }
        if now >= hold_until
            && let Some(hold) = holds.next()
        {
            tell_on(drive, run_at(hold.velocity, Some(hold.base))?)?;
            hold_until += hold.seconds;
        }
        if !options.hold.is_empty() && drive.now() - beaten > BEAT {
            beaten = drive.now();
            drive.beat()?;
        }
        drive.listen(Duration::from_millis(5))?;
        let mut buffer = [0; FRAME_MAX];
        while let Some(frame) = drive.take_telemetry() {
            if let Some(bytes) = frame.encode(&mut buffer) {
                recorder.take(bytes)?;
            }
        }
        let count = recorder.count();
        if count.rows != last {
            (last, silent) = (count.rows, drive.now());
        } else if drive.now() - silent > SILENT {
            bail!("the drive sends no telemetry any more");
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        bar.set_position((taken * 1e3) as u64);
        bar.set_message(match waits {
            true => format!("waits for its trigger, {now:.1} s"),
            false => format!("{taken:.1} s, {} lost", count.lost),
        });
        if drive.now() - looked > LOOK {
            looked = drive.now();
            if let Some(State::Fault(fault)) = look(drive)?.state {
                if let Some(gate) = recorder.gate() {
                    gate.fault();
                }
                if !options.hold.is_empty() && trigger != Some(Trigger::Fault) {
                    bail!(Stopped(fault, None));
                }
            }
        }
    }
    bar.finish_and_clear();
    Ok(())
}
