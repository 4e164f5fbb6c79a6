//! Covariance of least squares whose residual is no white noise.
//!
//! The residual of a filtered record is correlated from row to row, and more so where a model lacks something: the formula
//! for white noise would promise intervals that are too narrow. The sandwich estimate (White 1980; Newey and West 1987)
//! asks the residual itself: how far the pulls on the parameters, summed over stretches longer than the correlation,
//! scatter about 0.

use crate::regression::bounded::Solution;
use crate::regression::column::dot;
use crate::regression::inverse::of_gram;
use crate::regression::normal::Normal;
use nalgebra::{DMatrix, DVector};

/// Rows over which a correlation length is estimated.
const CORRELATED_ROWS: usize = 3000;
/// Half-width of a 95 % interval in standard deviations.
pub(crate) const NORMAL_95: f64 = 1.96;
/// Length of a stretch in correlation lengths: what reaches from one stretch into the next is then small.
const LENGTHS: f64 = 8.0;
/// Stretches that a record must have for each parameter, or their scatter says nothing.
const LEAST_STRETCHES: usize = 3;

/// Rows over which a signal is correlated: one and twice the sum of its squared autocorrelation, over a tenth of it.
pub(crate) fn correlated(left: &[f64]) -> f64 {
    let rows = left.len();
    let energy = dot(left, left).max(1e-300);
    let square = |lag: usize| (dot(&left[..rows - lag], &left[lag..]) / energy).powi(2);
    1.0 + 2.0 * (1..rows / 10).map(square).sum::<f64>()
}

/// Covariance of some of a regression's parameters, robust to a residual that is no white noise over time and not the same
/// in all channels: the scatter of their influence functions over stretches (Newey and West 1987), all channels of one
/// instant together. What was known of the others before, a plate's tolerance, pulls on the parameters as a row of a record
/// does whose noise is that tolerance (mixed estimation; Theil and Goldberger 1961): what only a plate tells apart from a parameter
/// leaves that parameter as uncertain as the plate.
pub(crate) fn robust(normal: &Normal, solution: &Solution, parameters: &[usize]) -> DMatrix<f64> {
    let left = normal.residual(&solution.values);
    let free = normal.covariance();
    let parts = || left.parts.iter().flatten();
    let rows = parts().map(Vec::len).max().unwrap_or(0);
    let n = parameters.len();
    // The residual of a channel is correlated over some rows; beyond a second's worth a model error is not noise.
    let length = parts()
        .filter(|part| part.iter().any(|x| *x != 0.0))
        .map(|part| correlated(&part[..part.len().min(CORRELATED_ROWS)]))
        .fold(1.0, f64::max);
    let stretch = ((LENGTHS * length) as usize).clamp(1, (rows / 8).max(1));
    let mut influence = vec![vec![0.0; rows]; n];
    for (pull, &parameter) in influence.iter_mut().zip(parameters) {
        for (channel, residual) in left.parts.iter().enumerate() {
            let Some(residual) = residual else { continue };
            let mut regressor = vec![0.0; residual.len()];
            for (k, column) in normal.columns.iter().enumerate() {
                let weight = free[(parameter, k)];
                if let Some(part) = column.parts[channel].as_ref().filter(|_| weight != 0.0) {
                    regressor
                        .iter_mut()
                        .zip(part)
                        .for_each(|(sum, x)| *sum += weight * x);
                }
            }
            for ((pull, x), e) in pull.iter_mut().zip(&regressor).zip(residual) {
                *pull += x * e;
            }
        }
    }
    let known = normal.known();
    let by_plates = DMatrix::from_fn(n, n, |k, j| {
        let rows = known.iter().enumerate().map(|(row, precision)| {
            let weight = |parameter: usize| free[(parameter, row)];
            precision * weight(parameters[k]) * weight(parameters[j])
        });
        rows.sum::<f64>()
    });
    long_run(&influence, stretch) + by_plates
}

/// Covariance of the sums of influences that are correlated over less than `stretch` rows (Newey and West 1987): the
/// scatter of their sums over all stretches, those that overlap included; at the ends these reach beyond the record, so
/// that each row counts alike.
fn long_run(influence: &[Vec<f64>], stretch: usize) -> DMatrix<f64> {
    let sums: Vec<Vec<f64>> = influence
        .iter()
        .map(|pull| {
            let mut sum = 0.0;
            (0..pull.len() + stretch - 1)
                .map(|row| {
                    sum += pull.get(row).copied().unwrap_or(0.0);
                    sum -= row.checked_sub(stretch).map_or(0.0, |row| pull[row]);
                    sum
                })
                .collect()
        })
        .collect();
    let n = influence.len();
    DMatrix::from_fn(n, n, |k, j| dot(&sums[k], &sums[j]) / stretch as f64)
}

/// A fit's linearisation at its solution.
pub(crate) struct Linear<'a> {
    /// Columns of length 1: parameters of very different size make even equations.
    unit: DMatrix<f64>,
    /// Their lengths before.
    norms: Vec<f64>,
    /// Inverse of the curvature.
    inverse: DMatrix<f64>,
    left: &'a DVector<f64>,
}

impl<'a> Linear<'a> {
    /// Of the `jacobian` and what the fit leaves, both row by row in time; `None` if a number of them is not finite.
    pub(crate) fn new(mut jacobian: DMatrix<f64>, left: &'a DVector<f64>) -> Option<Self> {
        let norms: Vec<f64> = jacobian
            .column_iter()
            .map(|c| c.norm().max(1e-300))
            .collect();
        for (mut column, norm) in jacobian.column_iter_mut().zip(&norms) {
            column /= *norm;
        }
        let curvature = jacobian.tr_mul(&jacobian);
        if !curvature.iter().chain(left.iter()).all(|x| x.is_finite()) {
            return None;
        }
        Some(Linear {
            inverse: of_gram(&curvature)?,
            unit: jacobian,
            norms,
            left,
        })
    }

    /// How far the parameters are from where the residual would be smallest.
    #[cfg(test)]
    fn step(&self) -> Vec<f64> {
        let step = &self.inverse * self.unit.tr_mul(self.left);
        step.iter()
            .zip(&self.norms)
            .map(|(step, norm)| step / norm)
            .collect()
    }

    /// Covariance of the parameters.
    pub(crate) fn covariance(&self) -> DMatrix<f64> {
        let (rows, n) = self.unit.shape();
        let most = (rows / (LEAST_STRETCHES * n.max(1))).max(1);
        let stretch = ((LENGTHS * correlated(self.left.as_slice())) as usize).clamp(1, most);
        let pulls: Vec<Vec<f64>> = self
            .unit
            .column_iter()
            .map(|column| column.iter().zip(self.left).map(|(x, e)| x * e).collect())
            .collect();
        let spread = long_run(&pulls, stretch);
        // A fit takes of the scatter what its parameters can: their share of the independent stretches.
        let taken = (n * stretch) as f64 / rows as f64;
        let covariance = &self.inverse * spread * &self.inverse / (1.0 - taken);
        DMatrix::from_fn(n, n, |k, j| {
            covariance[(k, j)] / (self.norms[k] * self.norms[j])
        })
    }
}

/// 95 % interval about a value of this variance.
pub(crate) fn interval(value: f64, variance: f64) -> [f64; 2] {
    let half = NORMAL_95 * variance.max(0.0).sqrt();
    [value - half, value + half]
}

/// c cos x + s sin x as amplitude cos(x + phase).
pub(crate) struct Wave {
    /// Amplitude, and its variance.
    pub(crate) amplitude: [f64; 2],
    /// Phase, rad, and its variance.
    pub(crate) phase: [f64; 2],
}

impl Wave {
    /// Of cosine and sine, their variances and their covariance.
    pub(crate) fn new([c, s]: [f64; 2], [cc, ss]: [f64; 2], cs: f64) -> Self {
        let square = c * c + s * s;
        Wave {
            amplitude: [
                square.sqrt(),
                (c * c * cc + 2.0 * c * s * cs + s * s * ss) / square,
            ],
            phase: [
                (-s).atan2(c),
                (s * s * cc - 2.0 * c * s * cs + c * c * ss) / square.powi(2),
            ],
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::regression::column::Column;
    use crate::regression::normal::Prior;
    use rand::{RngExt, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// Noise of variance 1 of which `kept` is kept from row to row.
    pub(crate) fn coloured(seed: u64, rows: usize, kept: f64) -> Vec<f64> {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut white = || 12f64.sqrt() * (random.random::<f64>() - 0.5);
        let mut last = white();
        (0..rows)
            .map(|_| {
                let new = white();
                last = kept * last + (1.0 - kept * kept).sqrt() * new;
                last
            })
            .collect()
    }

    /// Share of the trials in which the intervals of a regression on noise have the truth, which is 0.
    fn covered(kept: f64) -> f64 {
        const ROWS: usize = 2000;
        const TRIALS: u64 = 150;
        let jacobian = DMatrix::from_fn(ROWS, 4, |row, k| {
            let x = row as f64 / ROWS as f64;
            [1.0, x, (30.0 * x).cos(), (200.0 * x).sin()][k]
        });
        let mut inside = 0;
        for seed in 0..TRIALS {
            let noise = DVector::from_vec(coloured(seed, ROWS, kept));
            let values = Linear::new(jacobian.clone(), &noise)
                .expect("numbers")
                .step();
            let left = &noise - &jacobian * DVector::from_column_slice(&values);
            let covariance = Linear::new(jacobian.clone(), &left)
                .expect("numbers")
                .covariance();
            inside += (0..4)
                .filter(|&k| {
                    let [low, high] = interval(values[k], covariance[(k, k)]);
                    low <= 0.0 && 0.0 <= high
                })
                .count();
        }
        inside as f64 / (4 * TRIALS) as f64
    }

    #[test]
    fn intervals_hold_what_they_promise_whatever_the_noise_has_of_memory() {
        for kept in [0.0, 0.6, 0.9] {
            let covered = covered(kept);
            println!("{kept}: {covered:.3}");
            assert!((0.91..0.99).contains(&covered), "{kept}: {covered}");
        }
    }

    /// A parameter that the record does not tell from one that a plate gives within a tolerance, beside noise: its interval holds it
    /// for plates that are as far off as they may be.
    #[test]
    fn what_a_plate_alone_tells_apart_is_as_uncertain_as_the_plate() {
        const ROWS: usize = 2000;
        const TRIALS: u64 = 200;
        const TOLERANCE: f64 = 0.1;
        let wave: Vec<f64> = (0..ROWS).map(|k| (0.05 * k as f64).cos()).collect();
        let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
        let mut inside = 0;
        for seed in 0..TRIALS {
            let plate_off = TOLERANCE * 12f64.sqrt() * (random.random::<f64>() - 0.5);
            let noise = coloured(seed, ROWS, 0.5);
            let target = wave.iter().zip(&noise);
            let target = target.map(|(w, e)| (1.0 + plate_off) * w + e).collect();
            let rows = std::iter::once(0..ROWS).collect();
            let mut normal = Normal::new(Column::alone(target), &rows);
            normal.push(Column::alone(wave.clone()), Prior::within(TOLERANCE, 1.0));
            normal.push(Column::alone(wave.clone()), Prior::FREE);
            let solution = normal.solve(None);
            let variance = robust(&normal, &solution, &[1])[(0, 0)];
            let [low, high] = interval(solution.values[1], variance);
            inside += u64::from((low..=high).contains(&1.0));
        }
        let held = inside as f64 / TRIALS as f64;
        assert!(
            (0.92..=1.0).contains(&held),
            "{held} of the intervals hold the truth, expected 0.95"
        );
    }

    #[test]
    fn a_wave_is_its_amplitude_and_phase() {
        let (amplitude, phase) = (0.3_f64, -2.0_f64);
        let wave = Wave::new(
            [amplitude * phase.cos(), -amplitude * phase.sin()],
            [0.04, 0.04],
            0.0,
        );
        assert!((wave.amplitude[0] - amplitude).abs() < 1e-12);
        assert!((wave.phase[0] - phase).abs() < 1e-12);
        assert!((wave.amplitude[1] - 0.04).abs() < 1e-12);
        assert!((wave.phase[1] - 0.04 / 0.09).abs() < 1e-12);
    }
}
