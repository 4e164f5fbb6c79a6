//! Identification as a library: the torque that repeats over the angle of a motor of your own, from two records.
//!
//! `cargo run -p identify --example own_motor` prints the verdict and each order with its amplitude and 95 % interval.

use identify::machines::motor::{MotorModel, Record, Study};
use identify::records::DataQuality;
use identify::report::{Report, motor};

/// Rows a second of a record.
const RATE_HZ: f64 = 1000.0;
/// Inertia, kg m2, torque constant, N m/A, friction, N m, and pole pairs of the motor.
const INERTIA: f64 = 2e-4;
const TORQUE_CONSTANT: f64 = 0.5;
const FRICTION_NM: f64 = 0.04;
const POLE_PAIRS: u32 = 6;

/// The motor under a PI speed loop for 8 s, with a cogging torque of 12 periods a turn. A measured record has the same two columns.
fn record(cogging_nm: f64, speeds_rad_s: [f64; 4], mut seed: u64) -> Record {
    let (mut angle, mut speed, mut integral) = (0.0f64, 0.0f64, 0.0f64);
    let (mut position, mut current) = (Vec::new(), Vec::new());
    for row in 0..(8.0 * RATE_HZ) as usize {
        let error = speeds_rad_s[row / (2.0 * RATE_HZ) as usize] - speed;
        integral += 2.0 * error / RATE_HZ;
        let amps = (0.05 * error + integral).clamp(-2.0, 2.0);
        // The current sensor has 10 mA of noise.
        let noise: f64 = (0..12)
            .map(|_| {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
            })
            .sum();
        current.push(amps + 0.01 * noise);
        for step in 0..10 {
            // Current and angle of a row belong to one moment: half of the time that the current is held.
            if step == 5 {
                position.push(angle);
            }
            let torque = TORQUE_CONSTANT * amps
                - FRICTION_NM * (speed / 0.05).tanh()
                - cogging_nm * (12.0 * angle + 0.4).cos();
            speed += torque / INERTIA / (10.0 * RATE_HZ);
            angle += speed / (10.0 * RATE_HZ);
        }
    }
    Record {
        rate: RATE_HZ,
        position,
        current,
        account: DataQuality::default(),
    }
}

/// Fits one record and confirms on another, which has other speeds.
fn identified(cogging_nm: f64) -> Report {
    let fit = record(cogging_nm, [6.0, -4.0, 9.0, -8.0], 1);
    let check = record(cogging_nm, [5.0, -7.0, 8.0, -5.0], 2);
    let plate = MotorModel {
        pole_pairs: POLE_PAIRS,
    };
    motor(&Study::new(&fit, &check, None), plate, Default::default())
}

fn main() {
    let report = identified(0.02);
    println!("{}: {}", report.verdict, report.summary);
    for effect in report.effects.iter().filter(|e| e.order.is_some()) {
        let [low, high] = effect.interval["amplitude"];
        println!(
            "order {:3}: {:.4} A ({low:.4} to {high:.4}), {:.4} N m",
            effect.order.unwrap_or_default(),
            effect.parameters["amplitude"],
            TORQUE_CONSTANT * effect.parameters["amplitude"],
        );
    }
}

/// The current carries the cogging torque divided by the torque constant.
#[test]
fn the_cogging_torque_is_found_with_its_amplitude() {
    let report = identified(0.02);
    let found = report.effects.iter().find(|e| e.order == Some(12.0));
    let found = found.expect("order 12, which the motor has");
    let expected = 0.02 / TORQUE_CONSTANT;
    let amplitude = found.parameters["amplitude"];
    assert!(
        (amplitude / expected - 1.0).abs() < 0.05,
        "{amplitude} A, expected {expected} A"
    );
    let [low, high] = found.interval["amplitude"];
    assert!(
        (low..=high).contains(&expected),
        "{low} to {high} A, expected {expected} A inside"
    );
    let figures = &report.residual[0];
    assert!(
        figures.check_after < 0.5 * figures.check_before,
        "the residual fell from {} to {} A only",
        figures.check_before,
        figures.check_after
    );
}

#[test]
fn a_motor_without_cogging_has_no_order() {
    let orders: Vec<_> = identified(0.0)
        .effects
        .iter()
        .filter_map(|e| e.order)
        .collect();
    assert!(orders.is_empty(), "{orders:?}");
}
