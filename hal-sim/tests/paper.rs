//! The paper's experiment on the fixed-point drive, against figures computed outside the project.

use hal_sim::analytic::Sensitivity;
use hal_sim::experiment::{OperatingPoint, RPM, Setup, ripple_percent};
use hal_sim::response;
use plant::machine::Coupling;
use plant::model::Model;

const NUT_RPM: [f64; 4] = [0.0, 300.0, 500.0, 800.0];

fn ripple(setup: &Setup) -> [f64; 4] {
    NUT_RPM.map(|rpm| {
        ripple_percent(
            setup,
            OperatingPoint {
                velocity: 2.5e-3,
                base: rpm * RPM,
            },
        )
        .unwrap()
    })
}

#[track_caller]
fn assert_within(found: [f64; 4], expected: [f64; 4], part: f64) {
    for ((found, expected), rpm) in found.into_iter().zip(expected).zip(NUT_RPM) {
        assert!(
            (found / expected - 1.0).abs() <= part,
            "{found:.2} % at {rpm} rpm, expected {expected} %"
        );
    }
}

#[test]
fn ideal_sensors_meet_the_discrete_loops_within_three_percent() {
    assert_within(
        ripple(&Setup::ideal(Model::paper(), Coupling::Lumped)),
        [21.19, 15.23, 9.58, 6.24],
        0.03,
    );
}

/// The observer's damping was fitted to these figures (`PAPER_TUNING`): this test keeps the drive as it was. The independent check is
/// the one without an observer, above.
#[test]
fn real_sensors_meet_the_loops_with_an_observer() {
    assert_within(
        ripple(&Setup::real(Model::paper(), Coupling::Lumped)),
        [24.3, 17.2, 9.3, 5.8],
        0.02,
    );
}

#[test]
fn measured_sensitivity_is_that_of_appendix_a_up_to_1000_rad_s() {
    let setup = Setup::ideal(Model::paper(), Coupling::Lumped);
    let analytic = Sensitivity::new(
        &setup.model.screw,
        &setup.plate().motors[0].gains(&setup.tuning),
    );
    let mut worst = 0.0f64;
    for k in 0..=16 {
        let omega = 5.0 * 200f64.powf(f64::from(k) / 16.0);
        let measured = response::measure(&setup, 100.0 * RPM, omega)
            .unwrap()
            .norm();
        let off = measured / analytic.at(omega).norm() - 1.0;
        println!(
            "{omega:8.1} rad/s: {measured:.3}, {:+.2} % of Appendix A",
            100.0 * off
        );
        worst = worst.max(off.abs());
    }
    assert!(worst <= 0.05, "{worst}");
}
