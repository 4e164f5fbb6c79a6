//! Ripple of a shipped board's drive that has learned at the point where it is measured.

use super::progress::progress_bar;
use anyhow::Result;
use hal_sim::boards::BoardKind;
use hal_sim::experiment::{
    ExperimentError, OperatingPoint, Setup, driven, record_periods, settle_quietly,
    table_velocities,
};
use hal_sim::parallel::on_all_cores;
use hal_sim::vrf::vrf_percent;

/// Time that the drive learns at each point, s. It has learned nothing before.
pub const LEARNING_S: f64 = 12.0;

/// Ripple at each point, %; none where the drive does not reach the point or does not stay there.
///
/// The drive has the settings that its board's guide gives for smooth motion ([`BoardKind::smooth_plate`]).
///
/// # Errors
/// The drive cannot be configured.
pub fn learned(
    setup: &Setup,
    board: BoardKind,
    points: &[OperatingPoint],
    seconds: f64,
) -> Result<Vec<Option<f64>>> {
    let progress = progress_bar(points.len());
    let ripples = on_all_cores(points, |&point| {
        progress.set_message("the drive learns");
        let ripple = ripple(setup, board, point, seconds);
        progress.inc(1);
        ripple
    });
    progress.finish_and_clear();
    Ok(ripples.into_iter().collect::<Result<_, _>>()?)
}

fn ripple(
    setup: &Setup,
    board: BoardKind,
    point: OperatingPoint,
    seconds: f64,
) -> Result<Option<f64>, ExperimentError> {
    let mut drive = setup.drive_with(&board.smooth_plate())?;
    let periods = record_periods(&setup.board);
    let mut measured = || {
        settle_quietly(&mut drive, point)?;
        let mut run =
            |seconds| table_velocities(&mut drive, seconds, periods, |drive| driven(drive, point));
        run(LEARNING_S)?;
        run(seconds)
    };
    match measured() {
        Ok(velocities) => Ok(Some(vrf_percent(&velocities, point.velocity))),
        Err(ExperimentError::NotSteady { .. } | ExperimentError::Faulted { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}
