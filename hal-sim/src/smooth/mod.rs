//! How smooth the table moves: the machine with its defects, and what a controller leaves of its ripple.

pub mod bench;
pub mod known;
mod machine;
pub mod reversal;
mod rivals;

pub use machine::{Machine, orders, setup, torque_orders};
pub use rivals::{Compensator, Rival};

use crate::drive::Drive;
use crate::experiment::{
    ExperimentError, OperatingPoint, RECORD_S, Setup, record_periods, settle_through,
    table_velocities_through,
};
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
fn velocities(
    drive: &mut Drive,
    seconds: f64,
    seam: &mut impl Seam,
) -> Result<Vec<f64>, ExperimentError> {
    let periods = record_periods(drive.board.config());
    table_velocities_through(drive, seconds, periods, seam, |_| Ok(()))
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

/// Commands an operating point and lets the drive come to it.
fn settle(
    drive: &mut Drive,
    point: OperatingPoint,
    seam: &mut impl Seam,
) -> Result<(), ExperimentError> {
    settle_through(drive, point, seam, |_| Ok(()))
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
    settle(drive, point, seam)?;
    velocities(drive, seconds, seam)?;
    let velocities = velocities(drive, RECORD_S, seam)?;
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
