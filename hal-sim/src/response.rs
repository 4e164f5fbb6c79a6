//! The sensitivity `S` of the simulated drive, measured as one would on a machine: a sine torque in, a speed out.

use crate::drive::Drive;
use crate::experiment::{ExperimentError, OperatingPoint, Setup, settle_through};
use crate::seam::Disturbed;
use fft::Complex64;
use plant::Axis;
use plant::machine::Machine;
use std::f64::consts::TAU;

/// Amplitude of the injected torque, N m: large against the sensors' resolution, small against the torque limit.
const TORQUE_NM: f64 = 0.1;

/// Smallest time that is measured at each frequency, s.
const MEASURE_S: f64 = 0.25;

/// `S` of the screw's motor at `omega` rad/s: electrical speed per torque, rad/s per N m, phase included.
///
/// The model's own torque harmonics are left out, and the motors turn at `base` mechanical rad/s.
///
/// # Errors
/// [`ExperimentError`] if the drive cannot be configured or does not reach `base`.
pub fn measure(setup: &Setup, base: f64, omega: f64) -> Result<Complex64, ExperimentError> {
    measure_beside(setup, base, omega, |_, _| 0.0)
}

/// [`measure`] where `beside` acts on the screw too: its torque, N m, for half a PWM period, of a machine and that time, s.
///
/// # Errors
/// As [`measure`].
pub fn measure_beside(
    setup: &Setup,
    base: f64,
    omega: f64,
    mut beside: impl FnMut(&Machine, f64) -> f64,
) -> Result<Complex64, ExperimentError> {
    let mut setup = setup.clone();
    for axis in Axis::ALL {
        setup.model.motor_mut(axis).torque_harmonics.clear();
    }
    let mut drive = setup.drive()?;
    let point = OperatingPoint {
        velocity: 0.0,
        base,
    };
    let half_s = drive.board.period_s() / 2.0;
    let mut alone = Disturbed(|machine: &mut Machine, _| {
        let torque = beside(machine, half_s);
        machine.set_disturbance_torque(Axis::Screw, torque);
    });
    settle_through(&mut drive, point, &mut alone, |_| {
        Ok::<(), ExperimentError>(())
    })?;
    let p = f64::from(setup.model.screw.pole_pairs);
    let speed = |drive: &Drive| p * drive.board.machine.motor(Axis::Screw).omega;
    // The machine is a period on from the sample.
    let late = Complex64::cis(-omega * 2.0 * half_s);
    Ok(late * answer(&mut drive, omega, beside, speed))
}

/// What `seen` has of a sine torque at `omega` rad/s at the screw of a steady drive, per N m: amplitude and phase at the samples of the
/// currents. `beside` is as in [`measure_beside`].
pub fn answer(
    drive: &mut Drive,
    omega: f64,
    mut beside: impl FnMut(&Machine, f64) -> f64,
    seen: impl Fn(&Drive) -> f64,
) -> Complex64 {
    let period_s = drive.board.period_s();
    let half_s = period_s / 2.0;
    let cycles = (MEASURE_S * omega / TAU).ceil().max(2.0);
    let measured = (cycles * TAU / omega / period_s).round() as usize;
    // Transients of the loops are gone after 0.1 s; a slow sine needs a cycle of its own.
    let before = ((0.1f64).max(TAU / omega) / period_s) as usize;
    let (mut sum, mut sum_of_reference, mut mean) = (Complex64::ZERO, Complex64::ZERO, 0.0);
    for k in 0..before + measured {
        // Two half periods; the torque of each is the sine at its middle.
        let t = period_s * k as f64;
        drive.period_with(|machine, half| {
            let at = t + half_s * (half as f64 + 0.5);
            let torque = TORQUE_NM * (omega * at).cos() + beside(machine, half_s);
            machine.set_disturbance_torque(Axis::Screw, torque);
        });
        if k >= before {
            let phasor = Complex64::cis(-omega * t);
            let value = seen(drive);
            sum += phasor * value;
            sum_of_reference += phasor;
            mean += value / measured as f64;
        }
    }
    (sum - sum_of_reference * mean) * (2.0 / measured as f64 / TORQUE_NM)
}
