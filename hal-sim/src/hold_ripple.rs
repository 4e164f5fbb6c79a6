//! Ripple of each hold of a recording, by the table's scale.
//!
//! The scale's noise is included. Velocities are means over 1 ms. [`Ripple::vrf_percent`] is Eq 19 in pieces of 0.2 s, averaged.

use crate::experiment::{ExperimentError, OperatingPoint};
use crate::vrf::{velocities, vrf_percent};
use plant::Axis;
use plant::recording::Recording;
use std::f64::consts::PI;
use std::ops::RangeInclusive;

/// Shortest hold, s.
pub const SHORTEST_S: f64 = 0.4;
/// Transient of the way to a hold, which is left out, s.
pub const SETTLE_S: f64 = 0.15;
/// Mean of a velocity, s: a difference of neighbouring readings would be the scale's noise.
pub const WINDOW_S: f64 = 1e-3;
/// Length of a piece, s: longer than any beat or period of the harmonics at the speeds of a feed, and short enough that a hold has several.
/// One extreme of the scale's noise then does not decide the figure.
const PIECE_S: f64 = 0.2;
/// Where a mean over a time `T` passes 1/sqrt(2): `sin(x) = x / sqrt(2)` at `x = pi f T`.
const HALF_POWER: f64 = 1.391_557;
/// Times between two rows that show ripple, s.
const INTERVALS_S: RangeInclusive<f64> = 1e-5..=1e-2;

/// A stretch of a recording in which both references stand still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hold {
    /// First row.
    pub first: usize,
    /// Rows.
    pub rows: usize,
    /// Table velocity and nut speed that are asked.
    pub point: OperatingPoint,
}

/// Ripple of a table's velocity, %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ripple {
    /// Peak to peak over the reference: Eq 19.
    pub vrf_percent: f64,
    /// Root mean square about the mean, over the reference.
    pub rms_percent: f64,
}

impl Ripple {
    /// Of velocities, m/s, `interval_s` apart; `reference` m/s.
    #[must_use]
    pub fn of(velocities: &[f64], interval_s: f64, reference: f64) -> Self {
        let pieces: Vec<f64> = velocities
            .chunks_exact(((PIECE_S / interval_s) as usize).max(1))
            .map(|piece| vrf_percent(piece, reference))
            .collect();
        let count = velocities.len() as f64;
        let mean = velocities.iter().sum::<f64>() / count;
        let square = velocities.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count;
        Self {
            vrf_percent: pieces.iter().sum::<f64>() / pieces.len() as f64,
            rms_percent: 100.0 * square.sqrt() / reference.abs(),
        }
    }
}

/// The holds of a recording in which the table moves.
#[must_use]
pub fn holds(recording: &Recording, travel_per_radian: f64) -> Vec<Hold> {
    let [screw, nut] = Axis::ALL.map(|axis| &recording.axis(axis).speed_ref_rad_s);
    let mut holds = Vec::new();
    let mut first = 0;
    for row in 1..=recording.len() {
        let same = row < recording.len() && screw[row] == screw[first] && nut[row] == nut[first];
        if same {
            continue;
        }
        let long = interval_s(recording) * (row - first) as f64 >= SHORTEST_S;
        let velocity = travel_per_radian * (screw[first] - nut[first]);
        if long && velocity.abs() > 1e-6 {
            holds.push(Hold {
                first,
                rows: row - first,
                point: OperatingPoint {
                    velocity,
                    base: nut[first],
                },
            });
        }
        first = row;
    }
    holds
}

/// Intervals that a velocity is a mean over.
#[must_use]
pub fn window(interval_s: f64) -> usize {
    ((WINDOW_S / interval_s).round() as usize).max(1)
}

/// Frequency above which the mean of a velocity hides ripple, Hz.
#[must_use]
pub fn bandwidth_hz(interval_s: f64) -> f64 {
    HALF_POWER / (PI * interval_s * window(interval_s) as f64)
}

/// Velocities of the table in a hold, m/s, after its transient.
#[must_use]
pub fn recorded(recording: &Recording, hold: &Hold) -> Vec<f64> {
    let interval_s = interval_s(recording);
    let skip = (SETTLE_S / interval_s) as usize;
    let rows = hold.first + skip..hold.first + hold.rows;
    velocities(
        &recording.table_position_m[rows],
        interval_s,
        window(interval_s),
    )
}

/// The ripple of each hold in which the table moves.
///
/// # Errors
/// As [`ripple_interval_s`].
pub fn ripples(
    recording: &Recording,
    travel_per_radian: f64,
) -> Result<Vec<(OperatingPoint, Ripple)>, ExperimentError> {
    let interval_s = ripple_interval_s(recording)?;
    let of = |hold: Hold| {
        let velocities = recorded(recording, &hold);
        let ripple = Ripple::of(&velocities, interval_s, hold.point.velocity);
        (hold.point, ripple)
    };
    Ok(holds(recording, travel_per_radian)
        .into_iter()
        .map(of)
        .collect())
}

/// Mean time between two rows, s, of a recording that shows ripple.
///
/// # Errors
/// [`ExperimentError::Interval`] if the rows are too far apart, or their time stands still.
pub fn ripple_interval_s(recording: &Recording) -> Result<f64, ExperimentError> {
    let interval_s = interval_s(recording);
    match INTERVALS_S.contains(&interval_s) {
        true => Ok(interval_s),
        false => Err(ExperimentError::Interval { interval_s }),
    }
}

/// Mean time between two rows, s.
fn interval_s(recording: &Recording) -> f64 {
    let rows = recording.len();
    if rows < 2 {
        return f64::INFINITY;
    }
    (recording.time_s[rows - 1] - recording.time_s[0]) / (rows - 1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_sine_has_its_peak_to_peak_and_its_root_mean_square() {
        let step = 2e-4;
        let wave: Vec<f64> = (0..10_000)
            .map(|k| 2.5e-3 * (1.0 + 0.01 * (TAU * 40.0 * step * f64::from(k)).sin()))
            .collect();
        let ripple = Ripple::of(&wave, step, -2.5e-3);
        assert!((ripple.vrf_percent - 2.0).abs() < 0.01, "{ripple:?}");
        assert!(
            (ripple.rms_percent - 0.5_f64.sqrt()).abs() < 0.01,
            "{ripple:?}"
        );
    }

    #[test]
    fn the_bandwidth_is_where_a_mean_passes_half_the_power() {
        // Rows faster than a velocity's mean, and slower.
        for (interval_s, mean_s) in [(2e-4, 1e-3), (5e-3, 5e-3)] {
            let x = PI * bandwidth_hz(interval_s) * mean_s;
            assert!((x.sin() / x - 0.5_f64.sqrt()).abs() < 1e-5);
        }
    }
}
