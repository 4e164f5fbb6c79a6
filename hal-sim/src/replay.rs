//! A recording's profile, driven again on a model, and the ripple of both.
//!
//! The profile is a row of holds: stretches in which both speed references stand still. They are commanded through the
//! drive's own coordinator, so the ways between them are the drive's; only the holds are compared. Both ripples are
//! taken from the table's scale in the same way, its noise included: Eq 19 of velocities over 1 ms, in pieces of 0.2 s,
//! averaged over the hold.

use crate::experiment::{ExperimentError, Recorder, Setup, settle_quietly};
use crate::hold_ripple::{Hold, Ripple, SETTLE_S, holds, recorded, ripple_interval_s, window};
use crate::vrf::{spectrum, velocities};
use plant::recording::Recording;

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

/// Drives the holds of `recording` on `setup` and compares the ripple of each.
///
/// # Errors
/// [`ExperimentError`] if the rows are too far apart, the drive cannot be configured, or it does not reach a hold.
pub fn compare(setup: &Setup, recording: &Recording) -> Result<Vec<Compared>, ExperimentError> {
    let interval_s = ripple_interval_s(recording)?;
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
        let recorded = recorded(recording, &hold);
        let simulated = velocities(&simulated, interval_s, window(interval_s));
        let ripple = |velocities: &[f64]| {
            Ripple::of(velocities, interval_s, hold.point.velocity).vrf_percent
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
