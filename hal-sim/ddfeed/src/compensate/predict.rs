//! The ripple that a recording will show with a compensation.
//!
//! It is the figure that `record` prints: means over 1 ms by the table's scale, with its counts and its noise. The model is simulated
//! with and without the compensation, as long as the hold that is compared. Between both spectra and that of the hold:
//!
//! - The hold's noise floor stays.
//! - A line that the model has too, up to a factor of [`SAME_LINE`], falls as it falls in the simulation: what carries a torque to the
//!   table may be another in the model, and the compensation acts where the torque does.
//! - Of any other line, and of one that grows, the difference stays.

use anyhow::Result;
use control::plate::DrivePlate;
use fft::Complex64;
use hal_sim::experiment::{ExperimentError, OperatingPoint, Setup};
use hal_sim::hold_ripple::{Ripple, WINDOW_S};
use hal_sim::seam::Straight;
use hal_sim::smooth::{sample_s, settle, still_runs, velocities};
use plant::model::Model;
use std::f64::consts::TAU;

/// Length of a simulated hold where none is recorded, s.
pub const HOLD_S: f64 = 2.0;
/// Lines to each side of which the lower quartile gives the noise floor: a line of a speed that varies is broad.
const AROUND: usize = 60;
/// Mean of noise over its lower quartile, where each power is the sum of five: chi squared of 10 degrees of freedom has its lower
/// quartile at 6.737.
const MEAN_OF_QUARTILE: f64 = 10.0 / 6.737;
/// Ratio of two amplitudes up to which they are of one line. A mode that the model has elsewhere raises or lowers a line by its quality,
/// `1 / (2 damping)`: 10 at the damping of 5 % that a model without a measured one has.
const SAME_LINE: f64 = 10.0;
/// Lines to each side over which a tone spreads, by its window.
const SPREAD: usize = 2;
/// Smallest part by which a ripple must fall.
const GAIN: f64 = 0.02;

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

/// Root mean square of `after` over `before`, over all points.
pub fn part_left(all: &[Predicted]) -> f64 {
    let sum = |of: &dyn Fn(&Predicted) -> f64| all.iter().map(|one| of(one).powi(2)).sum::<f64>();
    (sum(&|one| one.after.rms_percent) / sum(&|one| one.before.rms_percent)).sqrt()
}

/// A compensation that leaves so much of the ripple is worth its settings.
pub fn is_gain(part_left: f64) -> bool {
    part_left < 1.0 - GAIN
}

/// Where ripple is predicted, and the hold that was recorded there.
pub struct Place {
    /// Where.
    pub point: OperatingPoint,
    /// Velocities by the scale, m/s, and the time between two, s.
    pub recorded: Option<(Vec<f64>, f64)>,
}

/// Means over [`WINDOW_S`] of the table's velocity, m/s, of a drive of `plate` on the machine of `setup`, every `interval_s` for some seconds.
pub fn simulated(
    setup: &Setup,
    plate: &DrivePlate,
    point: OperatingPoint,
    [interval_s, seconds]: [f64; 2],
) -> Result<Vec<f64>, ExperimentError> {
    let mut drive = setup.drive_with(plate)?;
    settle(&mut drive, point, &mut Straight)?;
    let raw = velocities(&mut drive, seconds, &mut Straight)?;
    still_runs(&drive, point, seconds)?;
    let step_s = sample_s(&drive);
    let steps = |seconds: f64| ((seconds / step_s).round() as usize).max(1);
    Ok(raw
        .windows(steps(WINDOW_S))
        .step_by(steps(interval_s))
        .map(|some| some.iter().sum::<f64>() / some.len() as f64)
        .collect())
}

/// Root mean square of the scale's velocity errors, m/s: noise and counts of both readings.
fn scale_floor(model: &Model) -> f64 {
    let count = model.installation.scale_count_m;
    let reading = model.sensing.table_noise_m.hypot(count / 12f64.sqrt());
    2f64.sqrt() * reading / WINDOW_S
}

/// The ripple before and after, of velocities that were simulated at `place` without and with the compensation.
pub fn predicted(model: &Model, place: &Place, [without, with]: [&[f64]; 2]) -> Predicted {
    let point = place.point;
    let Some((recorded, interval_s)) = &place.recorded else {
        let floor = 100.0 * scale_floor(model) / point.velocity.abs();
        let of = |velocities: &[f64]| {
            let ripple = Ripple::of(velocities, INTERVAL_S, point.velocity);
            scaled(ripple, ripple.rms_percent.hypot(floor))
        };
        return Predicted {
            point,
            before: of(without),
            after: of(with),
        };
    };
    let before = Ripple::of(recorded, *interval_s, point.velocity);
    let length = recorded.len().min(without.len());
    let [measured, without, with] =
        [recorded, without, with].map(|velocities| powers(&velocities[..length]));
    let left = left(&measured, &without, &with);
    let part = (left.iter().sum::<f64>() / measured.iter().sum::<f64>()).sqrt();
    Predicted {
        point,
        before,
        after: scaled(before, part * before.rms_percent),
    }
}

/// Time between two rows of a recording at its full rate, s.
pub const INTERVAL_S: f64 = 2e-4;

/// The power that is left of each line.
fn left(measured: &[f64], without: &[f64], with: &[f64]) -> Vec<f64> {
    (0..measured.len())
        .map(|k| {
            let around = k.saturating_sub(AROUND)..(k + AROUND + 1).min(measured.len());
            let mut near = measured[around].to_vec();
            near.sort_by(f64::total_cmp);
            let floor = (MEAN_OF_QUARTILE * near[near.len() / 4]).min(measured[k]);
            let line = (measured[k] - floor).sqrt();
            let [before, after] = [without[k].sqrt(), with[k].sqrt()];
            let is_same = before < SAME_LINE * line && line < SAME_LINE * before;
            let rest = match is_same && after < before {
                true => line * after / before,
                false => line - before + after,
            };
            floor + rest * rest
        })
        .collect()
}

/// Power of each line, by Hann's window and with its neighbours', over which a tone spreads.
fn powers(velocities: &[f64]) -> Vec<f64> {
    let length = velocities.len();
    let mean = velocities.iter().sum::<f64>() / length as f64;
    let mut spectrum: Vec<Complex64> = velocities
        .iter()
        .enumerate()
        .map(|(k, v)| {
            let hann = 0.5 - 0.5 * (TAU * k as f64 / length as f64).cos();
            Complex64::from((v - mean) * hann)
        })
        .collect();
    fft::forward(&mut spectrum);
    let lines: Vec<f64> = spectrum[..length / 2]
        .iter()
        .map(Complex64::norm_sqr)
        .collect();
    (1..lines.len())
        .map(|k| {
            let around = k.saturating_sub(SPREAD)..(k + SPREAD + 1).min(lines.len());
            lines[around].iter().sum()
        })
        .collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Noise stays, the model's line goes, a line that it does not have stays, and one that the machine does not have comes.
    #[test]
    fn each_line_falls_by_what_the_model_knows_of_it() {
        let (n, noise) = (200, 1.0);
        let mut measured = vec![noise; n];
        let (mut without, mut with) = (vec![0.0; n], vec![0.0; n]);
        (measured[30], without[30], with[30]) = (10_000.0, 9_000.0, 90.0);
        // A mode that the model has elsewhere.
        (measured[180], without[180], with[180]) = (10_000.0, 400.0, 4.0);
        // A compensation that makes a line worse.
        (measured[120], without[120], with[120]) = (101.0, 100.0, 900.0);
        measured[90] = 2_500.0;
        without[150] = 400.0;
        let left = left(&measured, &without, &with);
        for (line, expected) in [
            (10, 1.0),
            (30, 101.0),
            (90, 2_500.0),
            (150, 401.0),
            (180, 101.0),
            (120, 901.0),
        ] {
            assert!(
                (left[line] / expected - 1.0).abs() < 0.05,
                "line {line}: {} of {}, expected {expected}",
                left[line],
                measured[line]
            );
        }
    }
}
