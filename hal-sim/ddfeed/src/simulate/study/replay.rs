//! A recording's profile, simulated again and laid beside what was recorded.

use super::options::ReplayOptions;
use crate::output::Folder;
use anyhow::{Result, ensure};
use hal_sim::experiment::{RPM, Setup};
use hal_sim::replay::compare;
use plant::machine::Coupling;
use plant::model::Model;
use plant::recording::Recording;
use serde::Serialize;

/// `report.json` of a replay.
#[derive(Serialize)]
struct ReplayReport {
    recording: String,
    model: String,
    segments: Vec<Segment>,
}

/// One hold of the profile. Ripple is Eq 19 of velocities over 1 ms, from the table's scale with its noise, in pieces of
/// 0.2 s, averaged over the hold.
#[derive(Serialize)]
struct Segment {
    start_s: f64,
    seconds: f64,
    table_mm_s: f64,
    nut_rpm: f64,
    recorded_vrf_percent: f64,
    simulated_vrf_percent: f64,
}

/// Runs the replay and writes its report.
pub fn run(options: &ReplayOptions) -> Result<()> {
    let model = Model::load(&options.model)?;
    let recording = Recording::load(&options.recording)?;
    let folder = Folder::open(&options.out)?;
    let mut setup = Setup::declared(model, Coupling::Coupled);
    setup.board.seed = options.seed;
    let compared = compare(&setup, &recording)?;
    ensure!(
        !compared.is_empty(),
        "{} holds no operating point for 0.4 s with the table moving, so there is no ripple to compare: record longer \
         holds",
        options.recording.display()
    );
    println!(
        "{:>8} {:>8} {:>12} {:>9} {:>11} {:>11} {:>7}",
        "from", "for", "table", "nut", "recorded", "simulated", "ratio"
    );
    let mut segments = Vec::new();
    for c in compared {
        let segment = Segment {
            start_s: recording.time_s[c.hold.first],
            seconds: recording.time_s[c.hold.first + c.hold.rows - 1]
                - recording.time_s[c.hold.first],
            table_mm_s: c.hold.point.velocity * 1e3,
            nut_rpm: c.hold.point.base / RPM,
            recorded_vrf_percent: c.recorded_percent,
            simulated_vrf_percent: c.simulated_percent,
        };
        println!(
            "{:>6.2} s {:>6.2} s {:>7.2} mm/s {:>5.0} rpm {:>9.2} % {:>9.2} % {:>7.3}",
            segment.start_s,
            segment.seconds,
            segment.table_mm_s,
            segment.nut_rpm,
            segment.recorded_vrf_percent,
            segment.simulated_vrf_percent,
            segment.simulated_vrf_percent / segment.recorded_vrf_percent
        );
        segments.push(segment);
    }
    let report = ReplayReport {
        recording: options.recording.display().to_string(),
        model: options.model.display().to_string(),
        segments,
    };
    folder.put_text("report.json", &serde_json::to_string_pretty(&report)?)
}
