//! `ddfeed record --probe` against the chip that it records: row by row.

use crate::emulated::Emulated;
use crate::figures::keep;
use crate::program::{ddfeed, printed};
use plant::machine::Coupling;
use plant::model::Model;
use plant::recording::Recording;
use std::f64::consts::TAU;
use tests::bench::{Bench, READY, plate};
use tests::emulator::HaltedTime;
use tests::known;
use tests::pins::Motor;

fn ready() -> Result<Bench, String> {
    let mut bench = Bench::new(&Model::paper(), Coupling::Lumped)?;
    bench.emulator.chip().tops = Some(Vec::new());
    bench.wait_for(READY, 0.2)?;
    Ok(bench)
}

#[test]
fn a_recording_at_the_probe_is_the_chips_truth_row_by_row() {
    const VELOCITY: f64 = 2.5e-3;
    const BASE_RPM: f64 = 300.0;
    let chip = Emulated::start(HaltedTime::Running, ready);
    let folder = tempfile::tempdir().unwrap();
    let mut record = chip.command(ddfeed(), "record");
    record.arg(folder.path());
    record.args(["--arm", "--hold", "2.5,300,0.5"]);
    let said = printed(&record.output().unwrap());
    println!("{said}");
    assert!(said.contains("none lost"), "{said}");
    let rows = Recording::load(&folder.path().join("record.csv.gz")).unwrap();
    assert!(rows.len() >= 2500, "{} rows", rows.len());
    // Each top of the screw's timer that the chip has sampled, and each step of its speed task.
    let tops = chip.ask(|bench| bench.emulator.chip().tops.take().unwrap());
    let tops: Vec<_> = tops
        .iter()
        .filter(|top| top.motor == Motor::Screw)
        .collect();
    let divider = plate().board.speed_divider as usize;
    // The task's step that closed the bridges, or one of those before it.
    let closed = tops.iter().position(|top| top.bridge.enabled).unwrap();
    let seconds = tops.len() as f64 / plate().board.pwm_hz;
    let speeds = [VELOCITY, BASE_RPM * TAU / 60.0];
    let last = closed / divider;
    let mut apart = String::new();
    let first = (last.saturating_sub(4)..=last).rev().find_map(|step| {
        let expected = known::by_the_host((step * divider) as u64, speeds, seconds).unwrap();
        let found = known::same_from(&rows, &expected, 0..expected.len());
        found.map_err(|error| apart += &format!("{error}\n")).ok()
    });
    let first =
        first.unwrap_or_else(|| panic!("the rows are not those of the control code:\n{apart}"));
    keep("record_rows_equal", rows.len());
    // What the chip's pins had.
    for (row, angle) in rows.axes[0].angle_rad.iter().enumerate() {
        let sampled = tops[divider * (first + row)].sensors.encoder;
        assert_eq!(
            known::count(*angle),
            sampled,
            "the screw's angle of row {row}"
        );
    }
}
