//! The filters of the speed loop as they step, against the model of the loops that margins and compensation are computed from.

use control::compensation::TORQUE_STEPS;
use control::plate::{DrivePlate, NotchPlate, RejectionPlate, TorqueOrderPlate};
use fft::Complex64;
use hal_sim::drive::Drive;
use hal_sim::experiment::{OperatingPoint, RPM, Setup, settle_quietly};
use hal_sim::parallel::on_all_cores;
use hal_sim::response::answer;
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;
use std::f64::consts::TAU;

/// Measured electrical speed per torque current of a sine of `hz` at the screw, rad/s per A.
fn answered(setup: &Setup, plate: &DrivePlate, hz: f64) -> Complex64 {
    let mut drive = setup.drive_with(plate).unwrap();
    let point = OperatingPoint {
        velocity: 0.0,
        base: 100.0 * RPM,
    };
    settle_quietly(&mut drive, point).unwrap();
    let observer = plate.config().unwrap().current_loops[0].observer;
    let speed = |drive: &Drive| {
        let step = drive.exchange(Axis::Screw).theta_step();
        observer.omega_e(step).to_num()
    };
    let motor = &setup.model.screw;
    let nm_per_a = f64::from(motor.pole_pairs) * motor.flux_wb;
    answer(&mut drive, TAU * hz, |_, _| 0.0, speed) * nm_per_a
}

/// What the drive would learn of that speed a step by the model, of the injected torque current: 1.
fn learned(plate: &DrivePlate, answered: Complex64, hz: f64) -> Complex64 {
    let mut plate = *plate;
    plate.compensation.learning_s = 0.5;
    plate.compensation.torque[0][0] = TorqueOrderPlate::unknown(6.0);
    let config = plate.config().unwrap();
    let turns = hz * plate.board.sample_time() * 2f64.powi(32);
    let response = &config.compensation.response[0];
    let learn = response
        .at(turns as u32)
        .unwrap()
        .learning(|point| point.learn);
    // Twice the part of the way that a step learns, 2^-34.
    let part = plate.speed_step() * f64::from(TORQUE_STEPS) / plate.compensation.learning_s;
    let scale = 2.0 * part * 2f64.powi(34);
    answered * Complex64::new(f64::from(learn.re), f64::from(learn.im)) / scale
}

/// A disturbance observer of second order would be 22 % and 25 degrees off.
#[test]
fn the_filters_step_as_the_model_of_the_loops_says() {
    let mut model = Model::paper();
    for axis in Axis::ALL {
        model.motor_mut(axis).torque_harmonics.clear();
    }
    let setup = Setup::ideal(model, Coupling::Lumped);
    let none = RejectionPlate::NONE;
    let notch = NotchPlate {
        hz: 100.0,
        ..none.notch
    };
    let mut cases = Vec::new();
    for (disturbance_rad_s, notch) in [
        (0.0, none.notch),
        (50.0, none.notch),
        (0.0, notch),
        (50.0, notch),
    ] {
        // Points of the model's table, between which it takes straight lines: 15 to 234 Hz.
        for bits in [21, 22, 23, 24, 25] {
            let hz = setup.board.pwm_hz * 1.5 * 2f64.powi(bits - 32);
            let mut plate = setup.plate();
            plate.rejection = RejectionPlate {
                disturbance_rad_s,
                notch,
            };
            cases.push((plate, hz));
        }
    }
    let found = on_all_cores(&cases, |(plate, hz)| {
        learned(plate, answered(&setup, plate, *hz), *hz)
    });
    for ((plate, hz), found) in cases.into_iter().zip(found) {
        let (gain, degrees) = (found.norm(), found.arg().to_degrees());
        let RejectionPlate {
            disturbance_rad_s,
            notch,
        } = plate.rejection;
        let case = format!(
            "{hz:.1} Hz, disturbance observer {disturbance_rad_s} rad/s, notch {} Hz",
            notch.hz
        );
        println!("{case}: {gain:.3}, {degrees:+.2} degrees");
        assert!(
            (gain - 1.0).abs() < 0.05 && degrees.abs() < 1.0,
            "{case}: the speed is {gain:.3} of the model's, {degrees:+.2} degrees ahead; expected within 5 % and 1 degree"
        );
    }
}
