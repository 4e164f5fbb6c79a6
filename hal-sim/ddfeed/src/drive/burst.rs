//! `drive burst`: every PWM period of a motor around a trigger, into a CSV file.

use super::connect::Drive;
use super::options::BurstOptions;
use crate::interrupt::ctrl_c;
use crate::output::Folder;
use anyhow::{Context, Result, bail};
use link::burst::{BurstState, Signal};
use link::host::burst::{Burst, COLUMNS, unit};
use link::message::Command;
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

/// How often the drive is asked whether the trigger has come.
const LOOK: Duration = Duration::from_millis(20);

/// Arms, waits, reads and writes, as far as is asked.
pub fn run(drive: &mut Drive, options: &BurstOptions) -> Result<()> {
    if options.end {
        drive.tell(Command::EndBurst)?;
        return say(options, "ended: no burst waits or is kept", "none");
    }
    if options.leave {
        drive.tell(Command::Burst(options.request()?))?;
        let said = "armed: `drive burst --read` waits for it and reads it, `--end` ends it";
        return say(options, said, "waiting");
    }
    let name = options.out.file_name().and_then(|name| name.to_str());
    let name = name.with_context(|| {
        format!(
            "--out is {}, which is no name of a file",
            options.out.display()
        )
    })?;
    let folder = match options.out.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let folder = Folder::open(folder)?;
    let stop = ctrl_c().context("Ctrl-C cannot be caught, and is what ends the waiting")?;
    let settings = drive.settings()?;
    if !options.read {
        drive.tell(Command::Burst(options.request()?))?;
    }
    wait(drive, options, &stop)?;
    let burst = drive.read_burst(&settings)?;
    folder.put_text(name, &csv(&burst))?;
    let report = report(&burst, &options.out);
    if options.json {
        println!("{report:#}");
    } else {
        println!("{}", sentence(&burst, &report));
    }
    Ok(())
}

fn say(options: &BurstOptions, sentence: &str, state: &str) -> Result<()> {
    if options.json {
        println!("{:#}", json!({ "state": state }));
    } else {
        println!("{sentence}");
    }
    Ok(())
}

/// Waits until the burst is complete. Ctrl-C ends the waiting, and the burst that this command has armed.
fn wait(drive: &mut Drive, options: &BurstOptions, stop: &AtomicBool) -> Result<()> {
    let mut told = false;
    loop {
        match BurstState::of_word(drive.burst()?.state) {
            Some(BurstState::Complete) => return Ok(()),
            Some(BurstState::None) => bail!(
                "no burst waits: it was ended, the drive has started anew, or none was armed. `drive burst` arms one"
            ),
            Some(BurstState::Waiting) if !told => {
                told = true;
                eprintln!("waiting for the trigger; Ctrl-C ends it");
            }
            _ => {}
        }
        if stop.load(Relaxed) {
            if options.read {
                bail!(
                    "the burst waits on for its trigger: `drive burst --read` reads it later, `--end` ends it"
                );
            }
            drive.tell(Command::EndBurst)?;
            bail!("the trigger did not come, and the burst was ended");
        }
        drive.listen(LOOK)?;
    }
}

const fn motor(burst: &Burst) -> &'static str {
    match burst.motor {
        0 => "screw",
        _ => "nut",
    }
}

/// A line a sample, with the motor's name before each of its columns, as in a recording.
fn csv(burst: &Burst) -> String {
    let motor = motor(burst);
    let [time, rest @ ..] = COLUMNS;
    let mut text = String::from(time);
    for column in rest {
        // A text takes all that is written.
        let _ = write!(text, ",{motor}_{column}");
    }
    text.push('\n');
    for [time, rest @ ..] in &burst.rows {
        let _ = write!(text, "{time:.6}");
        for value in rest {
            // To the last bit of the words, which is 0.2 mA.
            let rounded = (value * 1e5).round() / 1e5;
            let _ = write!(text, ",{rounded}");
        }
        text.push('\n');
    }
    text
}

/// What was kept: the smallest and the largest of each signal.
fn report(burst: &Burst, file: &Path) -> Value {
    let signals: Map<String, Value> = Signal::ALL
        .iter()
        .enumerate()
        .map(|(k, signal)| {
            let values = burst.column(k + 1);
            let least = values.iter().copied().fold(f64::INFINITY, f64::min);
            let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let ends = json!({ "least": least, "most": most, "unit": unit(*signal) });
            (signal.name().to_owned(), ends)
        })
        .collect();
    json!({
        "file": file.display().to_string(),
        "motor": motor(burst),
        "samples": burst.rows.len(),
        "before": burst.before,
        "interval_s": burst.interval_s,
        "signals": signals,
    })
}

fn sentence(burst: &Burst, report: &Value) -> String {
    let samples = burst.rows.len();
    let ends = |signal: Signal| {
        let ends = &report["signals"][signal.name()];
        let end = |name: &str| ends[name].as_f64().unwrap_or_default();
        format!(
            "{} {:.3} to {:.3} {}",
            signal.sentence(),
            end("least"),
            end("most"),
            unit(signal)
        )
    };
    format!(
        "{}: {samples} samples of the {} over {:.2} ms, {:.0} a second, {} before the trigger; {}, {}, {}",
        report["file"].as_str().unwrap_or_default(),
        motor(burst),
        1e3 * burst.interval_s * samples.saturating_sub(1) as f64,
        1.0 / burst.interval_s,
        burst.before,
        ends(Signal::PhaseA),
        ends(Signal::TorqueCurrent),
        ends(Signal::Speed)
    )
}
