//! Linear least squares with 95 % intervals.

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
            values: Vec::new(),
            share,
        }
    }

    /// One more equation; regressors that are left out are 0.
    pub fn add(&mut self, regressors: &[f64], value: f64) {
        debug_assert!(regressors.len() <= self.unknowns);
        let from = self.regressors.len();
        self.regressors.extend_from_slice(regressors);
        self.regressors.resize(from + self.unknowns, 0.0);
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
        let mut a = DMatrix::from_row_slice(rows, columns, &self.regressors);
        let y = DVector::from_column_slice(&self.values);
        // Columns of length 1, so that no unit decides what is small.
        let lengths: Vec<f64> = a.column_iter().map(|column| column.norm()).collect();
        for (mut column, length) in a.column_iter_mut().zip(&lengths) {
            if *length == 0.0 {
                return None;
            }
            column /= *length;
        }
        let svd = a.clone().svd(true, true);
        let (most, least) = (svd.singular_values.max(), svd.singular_values.min());
        if !(most.is_finite() && least * CONDITION_MAX > most) {
            return None;
        }
        let x = svd.solve(&y, 0.0).ok()?;
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

#[cfg(test)]
mod tests {
    use super::*;

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
