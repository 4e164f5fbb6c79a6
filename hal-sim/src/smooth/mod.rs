//! How smooth the table moves, and what a drive compensates of its ripple.

pub mod kept;
pub mod known;

use crate::drive::Drive;
use crate::experiment::{
    ExperimentError, OperatingPoint, RECORD_S, Setup, record_periods, settle_through,
    table_velocities_through,
};
use crate::seam::{Seam, Straight};
use crate::vrf::vrf_percent;
use control::compensation::LINES;
use control::plate::CompensationPlate;
use fft::Complex64;

/// What a run left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothness {
    /// Velocity ripple factor (Eq 19), %.
    pub vrf: f64,
    /// Root mean square of the velocity's error, % of the velocity.
    pub rms: f64,
    /// Velocity ripple factor of what is below the frequencies of [`BANDS_HZ`], %.
    pub bands: [f64; 2],
    /// Position about the best-fit line: root mean square and largest, m.
    pub following: [f64; 2],
}

/// Bands in which makers of stages state velocity ripple, Hz: the table's user hardly sees what is above.
pub const BANDS_HZ: [f64; 2] = [1000.0, 100.0];

/// True table velocities as the reference figures are measured: 10 kHz, no filter.
///
/// # Errors
/// [`ExperimentError`] if a fault stops the drive.
pub fn velocities(
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
    pub fn of(velocities: &[f64], velocity: f64, sample_s: f64) -> Self {
        let squares: f64 = velocities
            .iter()
            .map(|v| (v / velocity - 1.0).powi(2))
            .sum();
        Self {
            vrf: vrf_percent(velocities, velocity),
            rms: 100.0 * (squares / velocities.len() as f64).sqrt(),
            bands: BANDS_HZ.map(|hz| vrf_percent(&below(velocities, hz * sample_s), velocity)),
            following: following(velocities, sample_s),
        }
    }
}

/// What of `velocities` is below so many cycles a sample, by its Fourier transform; without a tenth at either end, where the
/// record's ends meet.
fn below(velocities: &[f64], cycles: f64) -> Vec<f64> {
    let count = velocities.len();
    let mut spectrum: Vec<Complex64> = velocities.iter().map(|&v| v.into()).collect();
    fft::forward(&mut spectrum);
    for (k, line) in spectrum.iter_mut().enumerate() {
        if k.min(count - k) as f64 > cycles * count as f64 {
            *line = Complex64::ZERO;
        }
    }
    fft::inverse(&mut spectrum);
    let end = count / 10;
    spectrum[end..count - end]
        .iter()
        .map(|line| line.re / count as f64)
        .collect()
}

/// Position about its best-fit line (least squares): root mean square and largest, in m for velocities in m/s.
fn following(velocities: &[f64], sample_s: f64) -> [f64; 2] {
    let count = velocities.len() as f64;
    let mut at = 0.0;
    let positions: Vec<f64> = velocities
        .iter()
        .map(|v| {
            at += v * sample_s;
            at
        })
        .collect();
    // Sample numbers about their middle, whose squares sum up to n (n^2 - 1) / 12.
    let middle = (count - 1.0) / 2.0;
    let mean = positions.iter().sum::<f64>() / count;
    let moment: f64 = positions
        .iter()
        .enumerate()
        .map(|(k, x)| (k as f64 - middle) * x)
        .sum();
    let slope = 12.0 * moment / (count * (count * count - 1.0));
    let off = |(k, x): (usize, &f64)| x - mean - slope * (k as f64 - middle);
    let (squares, largest) = positions
        .iter()
        .enumerate()
        .map(off)
        .fold((0.0, 0.0_f64), |(sum, most), off| {
            (sum + off * off, most.max(off.abs()))
        });
    [(squares / count).sqrt(), largest]
}

/// Time between two of the true velocities, s.
#[must_use]
pub fn sample_s(drive: &Drive) -> f64 {
    let board = drive.board.config();
    f64::from(record_periods(board)) * board.pwm_period_s()
}

/// Commands an operating point and lets the drive come to it.
///
/// # Errors
/// [`ExperimentError`] if the drive does not reach the point.
pub fn settle(
    drive: &mut Drive,
    point: OperatingPoint,
    seam: &mut impl Seam,
) -> Result<(), ExperimentError> {
    settle_through(drive, point, seam, |_| Ok(()))
}

/// A drive that a fault has stopped has no ripple, and no error either.
///
/// # Errors
/// [`ExperimentError::NotSteady`] of such a drive.
pub fn still_runs(
    drive: &Drive,
    point: OperatingPoint,
    seconds: f64,
) -> Result<(), ExperimentError> {
    match drive.state() {
        state if state.is_driven() => Ok(()),
        state => Err(ExperimentError::NotSteady {
            seconds,
            velocity_mm_s: point.velocity * 1e3,
            base_rpm: point.base / crate::experiment::RPM,
            state,
        }),
    }
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
    still_runs(drive, point, seconds + RECORD_S)?;
    Ok(Smoothness::of(&velocities, point.velocity, sample_s(drive)))
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
    if let (Some(board), true) = (setup.shipped, compensation.learning_s != 0.0) {
        plate.base = board.smooth_plate().base;
    }
    setup.drive_with(&plate)
}

/// What a drive has learned, as its plate would say it.
#[must_use]
pub fn learned(drive: &Drive, mut plate: CompensationPlate) -> CompensationPlate {
    for line in 0..LINES {
        plate.keep(line, drive.compensation().coefficient(line));
        plate.keep_slope(line, drive.compensation().per_load(line));
    }
    plate
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// A velocity with ripple at two frequencies: closed forms of its bands and of its position's.
    #[test]
    fn bands_and_following_error_are_those_of_the_ripple() {
        let (sample_s, mean) = (1e-4, 2.5e-3);
        let ripple = [(40.0, 2e-5), (400.0, 1e-4)];
        let velocities: Vec<f64> = (0..40_000)
            .map(|k| {
                let t = f64::from(k) * sample_s;
                let sum: f64 = ripple.iter().map(|(hz, v)| v * (TAU * hz * t).cos()).sum();
                mean + sum
            })
            .collect();
        let got = Smoothness::of(&velocities, mean, sample_s);
        let expected = [100.0 * (2.4e-4) / mean, 100.0 * 4e-5 / mean];
        for (got, expected) in got.bands.into_iter().zip(expected) {
            assert!(
                (got / expected - 1.0).abs() < 0.01,
                "{got} % for {expected} %"
            );
        }
        let squares: f64 = ripple
            .iter()
            .map(|(hz, v)| (v / (TAU * hz)).powi(2) / 2.0)
            .sum();
        let [rms, largest] = got.following;
        assert!(
            (rms / squares.sqrt() - 1.0).abs() < 0.02,
            "{rms} m for {} m",
            squares.sqrt()
        );
        let sum: f64 = ripple.iter().map(|(hz, v)| v / (TAU * hz)).sum();
        assert!(
            (largest / sum - 1.0).abs() < 0.05,
            "{largest} m for {sum} m"
        );
    }
}
