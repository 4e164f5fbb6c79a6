//! A recording taken from the emulated chip's memory, as a probe would take it, against the control code on the host.

use ddfeed::output::Folder;
use ddfeed::record::{Recorder, Summary, save};
use identify::records::{How, Mapping, OnFault, double_drive, load};
use link::codes::State;
use link::telemetry::{FRAME_MAX, Request};
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;
use plant::recording::Recording;
use std::f64::consts::TAU;
use std::path::Path;
use tests::bench::{Bench, READY, plate};
use tests::cost::INTERRUPTS;
use tests::emulator::Profile;
use tests::known;

/// A drive that turns its nut at 300 rpm, and how many periods of it came before it was asked to.
const VELOCITY: f64 = 2.5e-3;
const BASE: f64 = 300.0 * TAU / 60.0;

struct Recorded {
    bench: Bench,
    asked: u64,
}

impl Recorded {
    /// Boots, starts, and keeps record of how many of the screw's tops came before.
    fn start() -> Result<Self, String> {
        let mut bench = Bench::new(&Model::paper(), Coupling::Lumped)?;
        bench.emulator.chip().tops = Some(Vec::new());
        bench.wait_for(READY, 0.2)?;
        bench.start(VELOCITY, BASE)?;
        let asked = bench.wait_for_step(|view| view.state() != Some(State::Ready))?;
        bench.pass(0.1)?;
        Ok(Self { bench, asked })
    }

    /// Records into `folder`, looking into the channel after each of `looks`, s.
    fn record(
        &mut self,
        folder: &Path,
        divider: u8,
        looks: impl IntoIterator<Item = f64>,
    ) -> Result<(Summary, Request), String> {
        let said = |error: anyhow::Error| format!("{error:#}");
        let request = self.bench.record(divider)?;
        let folder = Folder::open(folder).map_err(said)?;
        let bench = &mut self.bench;
        let mut look = |recorder: &mut Recorder, seconds: f64| {
            bench.pass(seconds).map_err(anyhow::Error::msg)?;
            let mut buffer = [0; FRAME_MAX];
            for frame in bench.take_telemetry().map_err(anyhow::Error::msg)? {
                recorder.take(frame.encode(&mut buffer).unwrap_or_default())?;
            }
            Ok(())
        };
        let rate = 5000.0 / f64::from(divider);
        let (summary, outcome) = save(&folder, "record", rate, |recorder| {
            recorder.start(request);
            looks
                .into_iter()
                .try_for_each(|seconds| look(recorder, seconds))
        })
        .map_err(said)?;
        outcome.map_err(said)?;
        Ok((summary, request))
    }
}

/// A recording as an identification reads it.
fn loaded(path: &Path, model: &Model) -> Result<Recording, String> {
    let how = How {
        mapping: &Mapping::default(),
        on_fault: OnFault::Refuse,
        declared_hz: Some(model.sensing.sample_hz),
    };
    load(path, how, &mut |_| ())
        .and_then(double_drive)
        .map_err(|error| error.to_string())
}

#[test]
fn a_recording_is_what_the_control_code_knew() -> Result<(), String> {
    let mut recorded = Recorded::start()?;
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let before = recorded.bench.settle()? / 4;
    let (summary, _) = recorded.record(folder.path(), 1, [0.02; 125])?;
    println!(
        "{} rows of {:.1} bytes, {:.0} kB/s",
        summary.count.rows,
        summary.bytes as f64 / summary.count.rows as f64,
        summary.bytes as f64 / summary.seconds / 1e3
    );
    assert_eq!((summary.count.lost, summary.count.damaged), (0, 0));
    // What came in the last milliseconds is still in the drive.
    assert!((summary.seconds - 2.5).abs() < 0.01, "{summary:?}");
    assert!(summary.bytes < 60 * summary.count.rows, "{summary:?}");

    // As an identification reads it.
    let model = Model::load(&folder.path().join("model.toml")).map_err(|e| e.to_string())?;
    let path = folder.path().join("record.csv.gz");
    let rows = loaded(&path, &model)?;
    assert_eq!(rows.len() as u64, summary.count.rows);

    let expected = known::by_the_host(recorded.asked, [VELOCITY, BASE], 3.0)?;
    let first = before as usize;
    known::same_from(&rows, &expected, first..first + 20)?;
    let turned = |k: usize| {
        let angle = &rows.axes[k].angle_rad;
        (angle[rows.len() - 1] - angle[0]) / TAU
    };
    // 300 rpm for 2.5 s, less the start.
    assert!(turned(1) > 11.0 && turned(0) > turned(1), "both turned");

    // The plate's data came with it.
    let plate = plate();
    assert_eq!(model.screw.resistance_ohm, plate.motors[0].resistance_ohm);
    assert_eq!(model.feed.lead_m, plate.feed.lead_m);
    assert_eq!(model.sensing.sample_hz, 5000.0);
    assert_eq!(
        model.sensing.encoder_counts_per_turn,
        plate.motors[0].encoder.counts_per_turn
    );
    Ok(())
}

#[test]
fn what_a_slow_reader_loses_is_counted_and_left_as_gaps() -> Result<(), String> {
    let mut recorded = Recorded::start()?;
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let looks = [0.04, 0.04, 0.7, 0.04, 0.4, 0.04].into_iter();
    let (summary, _) = recorded.record(folder.path(), 1, looks.chain([0.02; 60]))?;
    let dropped = recorded.bench.look()?.words().telemetry_dropped;
    assert!(dropped > 1000, "the channel was full: {dropped}");
    assert_eq!(summary.count.lost, u64::from(dropped));
    assert_eq!((summary.count.gaps, summary.count.damaged), (2, 0));
    let rows = Recording::load(&folder.path().join("record.csv.gz")).map_err(|e| e.to_string())?;
    let all = (rows.time_s[rows.len() - 1] * 5000.0).round() as u64 + 1;
    assert_eq!(rows.len() as u64 + summary.count.lost, all);
    // Over the gaps the shafts have made several turns; none is missing.
    let nut = recorded
        .bench
        .joint
        .borrow()
        .board
        .machine
        .motor(Axis::Nut)
        .theta;
    let last = rows.axes[1].angle_rad[rows.len() - 1];
    assert!(
        (last - nut).abs() < 1.0,
        "{last} rad, and {nut} rad in the machine"
    );
    // An identification takes a gap as the end of a piece, not for motion; the residual here is too short for it.
    let model = Model::load(&folder.path().join("model.toml")).map_err(|e| e.to_string())?;
    let path = folder.path().join("record.csv.gz");
    let refused = loaded(&path, &model).unwrap_err();
    assert!(refused.contains("in pieces of at least"), "{refused}");
    Ok(())
}

#[test]
fn a_slower_rate_is_a_stream_of_its_own() -> Result<(), String> {
    let mut recorded = Recorded::start()?;
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let (_, first) = recorded.record(folder.path(), 1, [0.01; 3])?;
    let (summary, second) = recorded.record(folder.path(), 5, [0.05; 4])?;
    assert_ne!(first, second);
    assert_eq!((summary.count.lost, summary.count.damaged), (0, 0));
    assert!((summary.interval_s - 1e-3).abs() < 1e-12, "{summary:?}");
    assert!((195..=200).contains(&summary.count.rows), "{summary:?}");
    // Nothing is sent once nothing is asked for.
    recorded.record(folder.path(), 0, [0.01; 2]).unwrap_err();
    let before = recorded.bench.look()?.words().telemetry_dropped;
    recorded.bench.pass(0.5)?;
    assert_eq!(recorded.bench.look()?.words().telemetry_dropped, before);
    Ok(())
}

#[test]
fn recording_costs_the_speed_task_alone_and_little() -> Result<(), String> {
    let mut bench = Recorded::start()?.bench;
    let mut typical = |divider: u8| -> Result<[u64; 3], String> {
        bench.record(divider)?;
        bench.pass(5e-3)?;
        *bench.emulator.profile() = Profile::default();
        bench.emulator.profile().keep = true;
        bench.pass(0.1)?;
        Ok(INTERRUPTS.map(|interrupt| {
            let runs = bench.emulator.profile().of_line(interrupt.line);
            let mut cycles: Vec<u64> = runs.iter().map(|run| run.cycles).collect();
            cycles.sort_unstable();
            cycles[cycles.len() / 2]
        }))
    };
    let ([screw, nut, speed], [screw_sent, nut_sent, speed_sent]) = (typical(0)?, typical(1)?);
    println!("speed task: {speed} cycles, recording {speed_sent}");
    assert_eq!((screw, nut), (screw_sent, nut_sent));
    assert!(
        (1..150).contains(&(speed_sent - speed)),
        "{speed} {speed_sent}"
    );
    Ok(())
}
