//! The drive removes the ripple of the machine with its defects, from cold, and keeps what it has learned.

use control::plate::CompensationPlate;
use hal_sim::experiment::{OperatingPoint, RPM};
use hal_sim::parallel::on_all_cores;
use hal_sim::smooth::{Machine, drive, orders, setup, smoothness};

/// Table mm/s, nut rpm, and what must be left of the ripple, %.
const POINTS: [(Machine, f64, f64, f64); 5] = [
    (Machine::Lumped, 2.5, 0.0, 0.6),
    (Machine::Lumped, 2.5, 800.0, 0.5),
    (Machine::Coupled, 2.5, 0.0, 0.8),
    // Order 30 of the nut on the table's resonance.
    (Machine::Coupled, 2.5, 1006.0, 2.0),
    (Machine::Lumped, 10.0, 500.0, 0.2),
];

#[test]
fn ripple_that_repeats_with_an_angle_is_learned_and_removed() {
    let results = on_all_cores(&POINTS, |&(machine, mm_s, rpm, allowed)| {
        let setup = setup(machine, 1);
        let point = OperatingPoint {
            velocity: mm_s * 1e-3,
            base: rpm * RPM,
        };
        let run = |compensation, seconds| {
            let mut drive = drive(&setup, compensation)?;
            smoothness(&mut drive, point, seconds)
        };
        let before = run(CompensationPlate::NONE, 0.0);
        let after = run(orders(&setup, 0.5, true), 12.0);
        (before, after, allowed)
    });
    for ((machine, mm_s, rpm, _), (before, after, allowed)) in POINTS.into_iter().zip(results) {
        let (before, after) = (before.unwrap().vrf, after.unwrap().vrf);
        println!("{machine:?} {mm_s} mm/s, {rpm} rpm: {before:.2} % before, {after:.2} % after");
        assert!(
            after < allowed && after < 0.2 * before,
            "{machine:?} at {mm_s} mm/s and {rpm} rpm: {after:.2} % is left of {before:.2} %, expected less than {allowed} %"
        );
    }
}
