//! How smooth the table moves: the machine with its defects, and what a controller leaves of its ripple.

mod machine;

pub use machine::{Machine, orders, setup};

use crate::drive::Drive;
use crate::experiment::{
    ExperimentError, OperatingPoint, RECORD_S, Setup, record_periods, settle_quietly,
    table_velocities,
};
use crate::vrf::vrf_percent;
use control::plate::CompensationPlate;

/// What a run left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothness {
    /// Velocity ripple factor (Eq 19), %.
    pub vrf: f64,
    /// Root mean square of the velocity's error, % of the velocity.
    pub rms: f64,
}

/// Runs a drive at `point`, for `seconds` of learning first, and measures the true table velocity as the reference figures are
/// measured.
///
/// # Errors
/// [`ExperimentError`] if the drive cannot be configured or does not reach the point.
pub fn smoothness(
    drive: &mut Drive,
    setup: &Setup,
    point: OperatingPoint,
    seconds: f64,
) -> Result<Smoothness, ExperimentError> {
    settle_quietly(drive, point)?;
    let periods = record_periods(&setup.board);
    table_velocities(drive, seconds, periods, |_| Ok::<(), ExperimentError>(()))?;
    let velocities = table_velocities(drive, RECORD_S, periods, |_| Ok::<(), ExperimentError>(()))?;
    let square = velocities
        .iter()
        .map(|v| (v / point.velocity - 1.0).powi(2))
        .sum::<f64>()
        / velocities.len() as f64;
    Ok(Smoothness {
        vrf: vrf_percent(&velocities, point.velocity),
        rms: 100.0 * square.sqrt(),
    })
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
