//! The ripple that a recording will show, simulated with and without a compensation.
//!
//! It is the figure that `record` prints: means over [`INTERVAL_S`] by the table's scale, with its counts and its noise.

use anyhow::Result;
use control::plate::DrivePlate;
use hal_sim::experiment::{ExperimentError, OperatingPoint, Setup};
use hal_sim::hold_ripple::Ripple;
use hal_sim::seam::Straight;
use hal_sim::smooth::{sample_s, settle, still_runs, velocities};
use plant::model::Model;

/// Mean that a recording at its full rate shows, s.
const INTERVAL_S: f64 = 1e-3;
/// Length of a simulated hold, s.
const HOLD_S: f64 = 2.0;

/// Ripple at an operating point, %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Predicted {
    /// Where.
    pub point: OperatingPoint,
    /// Without the compensation: measured if there is a recording, simulated otherwise.
    pub before: Ripple,
    /// With it.
    pub after: Ripple,
}

/// Root mean square of the scale's velocity errors, m/s: noise and counts of both readings.
fn scale_floor(model: &Model) -> f64 {
    let count = model.installation.scale_count_m;
    let reading = model.sensing.table_noise_m.hypot(count / 12f64.sqrt());
    2f64.sqrt() * reading / INTERVAL_S
}

/// Ripple of a drive of `plate` on the machine of `setup`, without the scale's errors.
pub fn simulated(
    setup: &Setup,
    plate: &DrivePlate,
    point: OperatingPoint,
) -> Result<Ripple, ExperimentError> {
    let mut drive = setup.drive_with(plate)?;
    settle(&mut drive, point, &mut Straight)?;
    let raw = velocities(&mut drive, HOLD_S, &mut Straight)?;
    still_runs(&drive, point, HOLD_S)?;
    let step_s = sample_s(&drive);
    let window = ((INTERVAL_S / step_s).round() as usize).max(1);
    let means: Vec<f64> = raw
        .windows(window)
        .map(|some| some.iter().sum::<f64>() / window as f64)
        .collect();
    Ok(Ripple::of(&means, step_s, point.velocity))
}

/// The part by which `after` has less ripple than `before` is what a measured ripple loses: what the model does not know stays. No
/// ripple falls below what the scale and the rest of the simulation leave.
pub fn predicted(
    model: &Model,
    point: OperatingPoint,
    [before, after]: [Ripple; 2],
    measured: Option<Ripple>,
) -> Predicted {
    let floor = 100.0 * scale_floor(model) / point.velocity.abs();
    let with_floor = |ripple: Ripple| {
        let rms_percent = ripple.rms_percent.hypot(floor);
        scaled(ripple, rms_percent)
    };
    let began = measured.unwrap_or_else(|| with_floor(before));
    let least = after.rms_percent.hypot(floor);
    let square = |ripple: Ripple| ripple.rms_percent.powi(2);
    let left = square(began) - square(before) + square(after);
    let rms_percent = left.max(0.0).sqrt().max(least.min(began.rms_percent));
    Predicted {
        point,
        before: began,
        after: scaled(began, rms_percent),
    }
}

/// The same shape with another root mean square.
fn scaled(ripple: Ripple, rms_percent: f64) -> Ripple {
    let factor = if ripple.rms_percent > 0.0 {
        rms_percent / ripple.rms_percent
    } else {
        1.0
    };
    Ripple {
        vrf_percent: factor * ripple.vrf_percent,
        rms_percent,
    }
}
