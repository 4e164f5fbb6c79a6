//! Linear least squares, or instrumental variables, with 95 % intervals.
//!
//! Least squares is biased where the part that is left out of an equation moves its regressors, as a torque ripple moves the acceleration
//! that a speed loop does not hold. Instruments are what the regressors follow and nothing that is left out moves: the commanded
//! motion. The estimate solves `Z' (A x - y) = 0` in place of `A' (A x - y) = 0` (Soderstrom and Stoica, Instrumental Variable
//! Methods for System Identification, 1983; for machines Janot, Vandanjon and Gautier, IEEE Trans. Control Systems Technology 22,
//! 2014, who simulate the motion that is commanded).

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// A measured value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Half of its 95 % interval.
    pub plus_minus: f64,
}

impl Estimate {
    /// The same in a unit of which one is `per` of this one's.
    #[must_use]
    pub fn times(self, per: f64) -> Self {
        Self {
            value: self.value * per,
            plus_minus: self.plus_minus * per.abs(),
        }
    }

    /// The sum of two that are independent.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            plus_minus: self.plus_minus.hypot(other.plus_minus),
        }
    }
}

/// Equations `regressors . x = value`.
#[derive(Clone, Debug)]
pub struct Fit {
    unknowns: usize,
    regressors: Vec<f64>,
    instruments: Vec<f64>,
    values: Vec<f64>,
    /// How many equations share one independent error: those of windows that overlap.
    share: f64,
}

/// 95 % of a normal distribution, on either side.
const NORMAL_95: f64 = 1.96;

/// Largest ratio of the singular values of the scaled regressors: past it the records cannot tell the unknowns apart.
const CONDITION_MAX: f64 = 1e6;

impl Fit {
    /// For so many unknowns, of whose equations `share` have one independent error.
    #[must_use]
    pub fn new(unknowns: usize, share: f64) -> Self {
        Self {
            unknowns,
            regressors: Vec::new(),
            instruments: Vec::new(),
            values: Vec::new(),
            share,
        }
    }

    /// One more equation of least squares; regressors that are left out are 0.
    pub fn add(&mut self, regressors: &[f64], value: f64) {
        self.add_with(regressors, regressors, value);
    }

    /// One more equation, with an instrument for each of its regressors.
    pub fn add_with(&mut self, instruments: &[f64], regressors: &[f64], value: f64) {
        let held = [
            (&mut self.instruments, instruments),
            (&mut self.regressors, regressors),
        ];
        for (held, row) in held {
            debug_assert!(row.len() <= self.unknowns);
            let from = held.len();
            held.extend_from_slice(row);
            held.resize(from + self.unknowns, 0.0);
        }
        self.values.push(value);
    }

    /// How many equations there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// There is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The unknowns; `None` if the equations do not tell them apart.
    #[must_use]
    pub fn solve(&self) -> Option<Vec<Estimate>> {
        let (rows, columns) = (self.values.len(), self.unknowns);
        let freedom = rows as f64 / self.share - columns as f64;
        if freedom < 1.0 {
            return None;
        }
        let (a, lengths) = scaled(rows, columns, &self.regressors)?;
        let (instruments, _) = scaled(rows, columns, &self.instruments)?;
        let y = DVector::from_column_slice(&self.values);
        // What the instruments span: of least squares the regressors' own, so that `u' a` has their singular values.
        let span = instruments.svd(true, false);
        let is_clear = |values: &DVector<f64>| {
            values.max().is_finite() && values.min() * CONDITION_MAX > values.max()
        };
        if !is_clear(&span.singular_values) {
            return None;
        }
        let u = span.u?;
        let svd = u.tr_mul(&a).svd(true, true);
        if !is_clear(&svd.singular_values) {
            return None;
        }
        let x = svd.solve(&u.tr_mul(&y), 0.0).ok()?;
        let residual = (&a * &x - &y).norm_squared() / rows as f64;
        let variance = residual * (rows as f64 / self.share) / freedom * self.share;
        let v = svd.v_t?.transpose();
        let estimates = (0..columns).map(|k| {
            let spread: f64 = (0..columns)
                .map(|j| (v[(k, j)] / svd.singular_values[j]).powi(2))
                .sum();
            Estimate {
                value: x[k] / lengths[k],
                plus_minus: NORMAL_95 * (spread * variance).sqrt() / lengths[k],
            }
        });
        Some(estimates.collect())
    }
}

/// Rows with columns of length 1, so that no unit decides what is small, and the lengths that they had; `None` if one is 0.
fn scaled(rows: usize, columns: usize, values: &[f64]) -> Option<(DMatrix<f64>, Vec<f64>)> {
    let mut matrix = DMatrix::from_row_slice(rows, columns, values);
    let lengths: Vec<f64> = matrix.column_iter().map(|column| column.norm()).collect();
    for (mut column, length) in matrix.column_iter_mut().zip(&lengths) {
        if *length == 0.0 {
            return None;
        }
        column /= *length;
    }
    Some((matrix, lengths))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A regressor that an unknown moves together with the value: least squares takes a part of the unknown for the slope,
    /// which the instrument, that it does not move, tells apart.
    #[test]
    fn an_instrument_takes_away_what_moves_regressor_and_value_together() {
        let (mut squares, mut with) = (Fit::new(1, 1.0), Fit::new(1, 1.0));
        for k in 0..3000 {
            let commanded = (0.01 * f64::from(k)).sin();
            let unknown = (f64::from(k) * 0.618_033_988_75).fract() - 0.5;
            let regressor = commanded + unknown;
            let value = 2.0 * regressor - unknown;
            squares.add(&[regressor], value);
            with.add_with(&[commanded], &[regressor], value);
        }
        let slope = |fit: Fit| fit.solve().unwrap()[0];
        // Powers of 1/2 and of 1/12: 2 - (1/12) / (1/2 + 1/12).
        let biased = slope(squares);
        assert!(
            (biased.value - (2.0 - 1.0 / 7.0)).abs() < 0.01,
            "{biased:?}"
        );
        // The textbook's standard error: of the unknown, 1 / sqrt(12), over the instrument's length.
        let right = slope(with);
        let error = (1.0 / 12f64).sqrt() / 1500f64.sqrt();
        assert!((right.value - 2.0).abs() < 2.0 * error, "{right:?}");
        let ratio = right.plus_minus / (1.96 * error);
        assert!((0.95..1.05).contains(&ratio), "{right:?}");
    }

    #[test]
    fn a_line_and_its_intervals() {
        let mut fit = Fit::new(2, 1.0);
        for k in 0..1000 {
            let x = f64::from(k) / 1000.0;
            // Noise of variance 1/12 of (0.2)^2, without a trend.
            let noise = 0.2 * (f64::from(k) * 0.618_033_988_75).fract() - 0.1;
            fit.add(&[1.0, x], 3.0 - 2.0 * x + noise);
        }
        let [offset, slope] = fit.solve().unwrap()[..] else {
            panic!("two unknowns")
        };
        // The textbook's standard errors of a line through n points on [0, 1]: 2 s / sqrt(n) and sqrt(12) s / sqrt(n).
        let sigma = 0.2 / 12f64.sqrt();
        for (estimate, value, error) in [
            (offset, 3.0, 2.0 * sigma / 1000f64.sqrt()),
            (slope, -2.0, 12f64.sqrt() * sigma / 1000f64.sqrt()),
        ] {
            assert!(
                (estimate.value - value).abs() < 2.0 * error,
                "{estimate:?}, expected {value}"
            );
            let ratio = estimate.plus_minus / (1.96 * error);
            assert!(
                (0.95..1.05).contains(&ratio),
                "{estimate:?}, expected an interval of {}",
                1.96 * error
            );
        }
    }

    #[test]
    fn what_is_not_told_apart_is_not_solved() {
        let mut fit = Fit::new(2, 1.0);
        for k in 0..10 {
            fit.add(&[f64::from(k), 2.0 * f64::from(k)], 1.0);
        }
        assert_eq!(fit.solve(), None);
    }
}
