//! The regression of both records' current on its base and given orders, under a given lag.

use super::base::Base;
use super::columns::Columns;
use crate::effects::limits::FEEDS_IN;
use crate::regression::column::Column;
use crate::regression::normal::Prior;
use crate::regression::sandwich::robust;
use crate::search::holdout::{Holdout, Validated};
use nalgebra::DMatrix;
use rayon::prelude::*;

/// A fitted current and what it leaves, on the filtered records.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Coefficients: the base columns, then cosine and sine of each order.
    pub values: Vec<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// The residual of the current of fit and check record, A.
    pub left: [Vec<f64>; 2],
}

/// Rms of a signal.
pub(super) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Both records under a lag.
pub(super) struct Both {
    /// Of fit and check record: the base, then cosine and sine of each order.
    pub(super) columns: [Vec<Column>; 2],
    pub(super) measured: [Column; 2],
    /// How many of the columns are the base.
    pub(super) base: usize,
}

impl Both {
    pub(super) fn new(records: [&Columns; 2], base: &[Base], orders: &[u32], lag_s: f64) -> Self {
        let columns = records.map(|record| {
            let plain = base.par_iter().map(|base| record.base(*base, lag_s));
            let plain: Vec<_> = plain.collect();
            let waves = record.waves(orders, lag_s).into_iter().flatten();
            let all = plain.into_iter().chain(waves);
            all.map(Column::alone).collect::<Vec<_>>()
        });
        Both {
            columns,
            measured: records.map(|record| Column::alone(record.current())),
            base: base.len(),
        }
    }

    /// The columns of a candidate of so many.
    pub(super) fn pair(&self, candidate: usize) -> [&[Column]; 2] {
        let at = self.base + 2 * candidate;
        [0, 1].map(|record: usize| &self.columns[record][at..at + 2])
    }

    /// The regression of the fit record on some columns, and the check record's beside it.
    pub(super) fn regression(&self, columns: impl Iterator<Item = usize> + Clone) -> Holdout {
        let mut regression = Holdout::new([0, 1].map(|k: usize| self.measured[k].clone()));
        regression.extend([0, 1].map(|k: usize| columns.clone().map(move |c| &self.columns[k][c])));
        regression
    }

    /// Whether the check record confirms the last column of the base, a friction, beside all others.
    pub(super) fn has_friction(&self) -> Result<(), &'static str> {
        let own = self.base - 1;
        let others = (0..self.columns[0].len()).filter(|k| *k != own);
        let effect = [0, 1].map(|k: usize| &self.columns[k][own..=own]);
        let validated = Validated::new([(&self.regression(others), effect)], Prior::FREE);
        match validated.values[0] > 0.0 {
            true => validated.borne_out(),
            false => Err(FEEDS_IN),
        }
    }

    /// Mean squares that all columns leave of fit and check record.
    pub(super) fn squares(&self) -> [f64; 2] {
        self.regression(0..self.columns[0].len()).squares()
    }

    /// All columns, and then some of the fit record's alone (`more`), whose coefficients and covariance come with it.
    pub(super) fn fit(&self, more: Vec<Column>) -> (Fit, Vec<[f64; 2]>) {
        let own = self.columns[0].len();
        let normal = self.regression(0..own).fit;
        let solution = normal.solve(None);
        let values: Vec<f64> = solution.values.iter().copied().collect();
        let left = [0, 1].map(|record| {
            let left = self.measured[record].less(&self.columns[record], values.iter().copied());
            left.only().to_vec()
        });
        let fit = Fit {
            covariance: robust(&normal, &solution, &(0..own).collect::<Vec<_>>()),
            values,
            left,
        };
        let mut free = normal;
        let count = more.len();
        for column in more {
            free.push(column, Prior::FREE);
        }
        let solution = free.solve(None);
        let covariance = robust(&free, &solution, &(own..own + count).collect::<Vec<_>>());
        let further = (0..count).map(|k| [solution.values[own + k], covariance[(k, k)]]);
        (fit, further.collect())
    }
}
