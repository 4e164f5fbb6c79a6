//! A recording's profile, driven again on a model, and the ripple of both.
//!
//! The profile is a row of holds: stretches in which both speed references stand still. They are commanded through the
//! drive's own coordinator, so the ways between them are the drive's; only the holds are compared. Both ripples are
//! taken from the table's scale in the same way, its noise included: Eq 19 of velocities over 1 ms, in pieces of 0.2 s,
//! averaged over the hold.

use crate::experiment::{ExperimentError, OperatingPoint, Recorder, Setup, settle_quietly};
use crate::vrf::{spectrum, velocities, vrf_percent};
use plant::Axis;
use plant::recording::Recording;

/// Shortest hold that is compared, s.
const SHORTEST_S: f64 = 0.4;

/// What of a hold's beginning is left out, s: the transient of the way to it.
const SETTLE_S: f64 = 0.15;

/// Mean that a velocity is taken over, s: the scale's noise is read at every sample, so a difference of neighbours
/// would show little else.
const WINDOW_S: f64 = 1e-3;

/// Length of the pieces whose peak-to-peak values are averaged, s: longer than any beat or period of the harmonics at
/// the speeds of a feed, and short enough that a hold has several. One extreme of the scale's noise then does not
/// decide the figure.
const PIECE_S: f64 = 0.2;

/// A stretch of a recording in which both references stand still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hold {
    /// First row.
    pub first: usize,
    /// Rows.
    pub rows: usize,
    /// What is asked there.
    pub point: OperatingPoint,
}

/// A hold, recorded and simulated.
#[derive(Clone, Debug, PartialEq)]
pub struct Compared {
    /// The hold.
    pub hold: Hold,
    /// Ripple of the recording, %.
    pub recorded_percent: f64,
    /// Ripple of the simulated drive, %.
    pub simulated_percent: f64,
    /// Amplitude spectrum of the recorded table velocity: (Hz, m/s).
    pub recorded_spectrum: Vec<(f64, f64)>,
    /// The same of the simulated drive.
    pub simulated_spectrum: Vec<(f64, f64)>,
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

/// Drives the holds of `recording` on `setup` and compares the ripple of each.
///
/// # Errors
/// [`ExperimentError`] if the rows are too far apart, the drive cannot be configured, or it does not reach a hold.
pub fn compare(setup: &Setup, recording: &Recording) -> Result<Vec<Compared>, ExperimentError> {
    let interval_s = interval_s(recording);
    if !(1e-5..=1e-2).contains(&interval_s) {
        return Err(ExperimentError::Interval { interval_s });
    }
    let periods = (interval_s / setup.board.pwm_period_s()).round().max(1.0) as u32;
    let skip = (SETTLE_S / interval_s) as usize;
    let mut drive = setup.drive()?;
    let mut recorder = Recorder::default();
    let mut compared = Vec::new();
    for hold in holds(recording, setup.model.feed.travel_per_radian()) {
        settle_quietly(&mut drive, hold.point)?;
        let simulated: Vec<f64> = (skip..hold.rows)
            .map(|_| {
                (0..periods).for_each(|_| drive.period());
                recorder.row(&mut drive).table_position_m
            })
            .collect();
        let recorded = &recording.table_position_m[hold.first + skip..hold.first + hold.rows];
        let window = (WINDOW_S / interval_s).round() as usize;
        let [recorded, simulated] =
            [recorded, &simulated[..]].map(|positions| velocities(positions, interval_s, window));
        let ripple = |velocities: &[f64]| {
            let pieces: Vec<f64> = velocities
                .chunks_exact((PIECE_S / interval_s) as usize)
                .map(|piece| vrf_percent(piece, hold.point.velocity))
                .collect();
            pieces.iter().sum::<f64>() / pieces.len() as f64
        };
        compared.push(Compared {
            hold,
            recorded_percent: ripple(&recorded),
            simulated_percent: ripple(&simulated),
            recorded_spectrum: spectrum(&recorded, 1.0 / interval_s),
            simulated_spectrum: spectrum(&simulated, 1.0 / interval_s),
        });
    }
    Ok(compared)
}

fn interval_s(recording: &Recording) -> f64 {
    let rows = recording.len();
    if rows < 2 {
        return f64::INFINITY;
    }
    (recording.time_s[rows - 1] - recording.time_s[0]) / (rows - 1) as f64
}
