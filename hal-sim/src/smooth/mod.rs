//! How smooth the table moves: the machine with its defects, and what a controller leaves of its ripple.

pub mod bench;
pub mod known;
mod machine;
pub mod reversal;
mod rivals;

pub use machine::{Machine, orders, setup, torque_orders};
pub use rivals::{Compensator, Numbers, Rival};

use crate::drive::Drive;
use crate::experiment::{ExperimentError, OperatingPoint, RECORD_S, Setup, record_periods};
use crate::seam::{Seam, Straight};
use crate::vrf::vrf_percent;
use control::plate::CompensationPlate;
use control::supervisor::State;

/// What a run left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothness {
    /// Velocity ripple factor (Eq 19), %.
    pub vrf: f64,
    /// Root mean square of the velocity's error, % of the velocity.
    pub rms: f64,
}

/// True table velocities as the reference figures are measured: 10 kHz, no filter.
fn velocities(drive: &mut Drive, seconds: f64, seam: &mut impl Seam) -> Vec<f64> {
    let periods = record_periods(drive.board.config());
    let samples = seconds / (drive.board.config().pwm_period_s() * f64::from(periods));
    (0..samples.round() as usize)
        .map(|_| {
            for _ in 0..periods {
                drive.period_through(seam);
            }
            drive.board.machine.table_velocity()
        })
        .collect()
}

impl Smoothness {
    /// Of velocities, m/s, that should all be `velocity`.
    #[must_use]
    pub fn of(velocities: &[f64], velocity: f64) -> Self {
        let squares: f64 = velocities
            .iter()
            .map(|v| (v / velocity - 1.0).powi(2))
            .sum();
        Self {
            vrf: vrf_percent(velocities, velocity),
            rms: 100.0 * (squares / velocities.len() as f64).sqrt(),
        }
    }
}

/// Time that transients are given once the references are at their targets, s.
const SETTLE_S: f64 = 0.3;
/// Longest that references may take to their targets, s.
const REACH_S: f64 = 20.0;

/// Commands an operating point and lets the drive come to it.
///
/// # Errors
/// [`ExperimentError`] if the point is not allowed or not reached.
pub fn settle_through(
    drive: &mut Drive,
    point: OperatingPoint,
    seam: &mut impl Seam,
) -> Result<(), ExperimentError> {
    drive.command(point.velocity, point.base)?;
    let period_s = drive.board.config().pwm_period_s();
    let mut steady_s = 0.0;
    for _ in 0..(REACH_S / period_s) as u64 {
        drive.period_through(seam);
        let steady = drive.state() == State::Running && drive.arrived();
        steady_s = if steady { steady_s + period_s } else { 0.0 };
        if steady_s >= SETTLE_S {
            return Ok(());
        }
    }
    Err(ExperimentError::NotSteady {
        seconds: REACH_S,
        velocity_mm_s: point.velocity * 1e3,
        base_rpm: point.base / crate::experiment::RPM,
        state: drive.state(),
    })
}

/// Runs a drive at `point`, for `seconds` of learning first, and measures the true table velocity.
///
/// # Errors
/// [`ExperimentError`] if the drive does not reach the point.
pub fn smoothness_through(
    drive: &mut Drive,
    point: OperatingPoint,
    seconds: f64,
    seam: &mut impl Seam,
) -> Result<Smoothness, ExperimentError> {
    settle_through(drive, point, seam)?;
    velocities(drive, seconds, seam);
    let velocities = velocities(drive, RECORD_S, seam);
    if drive.state() != State::Running {
        return Err(ExperimentError::NotSteady {
            seconds: seconds + RECORD_S,
            velocity_mm_s: point.velocity * 1e3,
            base_rpm: point.base / crate::experiment::RPM,
            state: drive.state(),
        });
    }
    Ok(Smoothness::of(&velocities, point.velocity))
}

/// The same with nothing between board and control.
///
/// # Errors
/// [`ExperimentError`] if the drive does not reach the point.
pub fn smoothness(
    drive: &mut Drive,
    point: OperatingPoint,
    seconds: f64,
) -> Result<Smoothness, ExperimentError> {
    smoothness_through(drive, point, seconds, &mut Straight)
}

/// A drive of `setup` that compensates by `compensation`.
///
/// # Errors
/// [`ExperimentError`] if the drive cannot be configured.
pub fn drive(setup: &Setup, compensation: CompensationPlate) -> Result<Drive, ExperimentError> {
    let mut plate = setup.plate();
    plate.compensation = compensation;
    Ok(Drive::aligned(
        &setup.model,
        setup.coupling,
        setup.board,
        &plate,
    )?)
}
