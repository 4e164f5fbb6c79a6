//! The regression of both records' current on its base and given orders, under a given lag.

use super::columns::{Base, Columns};
use crate::effects::limits::FEEDS_IN;
use crate::regression::column::Column;
use crate::regression::normal::{Normal, Prior};
use crate::regression::sandwich::robust;
use crate::search::selection::Evidence;
use nalgebra::DMatrix;
use std::ops::Range;
use std::rc::Rc;

/// A fitted current and what it leaves, on the filtered records.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Coefficients: the base columns, then cosine and sine of each order.
    pub values: Vec<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// What is left of the current of fit and check record, A.
    pub left: [Vec<f64>; 2],
}

/// Rms of a signal.
pub(super) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// One operating point: all rows of a record.
pub(super) fn whole(rows: usize) -> Rc<[Range<usize>]> {
    std::iter::once(0..rows).collect()
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
            let plain = base.iter().map(|base| record.base(*base, lag_s));
            let waves = orders.iter().flat_map(|order| record.wave(*order, lag_s));
            plain.chain(waves).map(Column::alone).collect::<Vec<_>>()
        });
        Both {
            columns,
            measured: records.map(|record| Column::alone(record.current())),
            base: base.len(),
        }
    }

    /// The regression of the fit record on its first columns.
    pub(super) fn regression(&self, columns: usize) -> Normal {
        let folds = whole(self.measured[0].only().len());
        let mut normal = Normal::new(self.measured[0].clone(), &folds);
        for column in &self.columns[0][..columns] {
            normal.push(column.clone(), Prior::FREE);
        }
        normal
    }

    /// Whether the check record bears out the last column of the base, a friction, beside all others.
    pub(super) fn has_friction(&self) -> Result<(), &'static str> {
        let values = self.regression(self.columns[0].len()).solve(None).values;
        let last = self.base - 1;
        if values[last] <= 0.0 {
            return Err(FEEDS_IN);
        }
        let part = Column::default().plus([&self.columns[1][last]], &[values[last]]);
        let rest = self.measured[1].less(&self.columns[1], values.iter().copied());
        let rest = rest.less([&part], [-1.0]);
        let folds = whole(rest.only().len());
        Evidence::new(&Normal::new(rest, &folds), part).borne_out()
    }

    /// Mean squares that all columns leave of fit and check record.
    pub(super) fn squares(&self) -> [f64; 2] {
        let normal = self.regression(self.columns[0].len());
        let solution = normal.solve(None);
        let values = || solution.values.iter().copied();
        [0, 1].map(|record| {
            let left = self.measured[record].less(&self.columns[record], values());
            rms(left.only()).powi(2)
        })
    }

    /// All columns, and then some of the fit record's alone (`more`), whose coefficients and covariance come with it.
    pub(super) fn fit(&self, more: Vec<Column>) -> (Fit, Vec<[f64; 2]>) {
        let own = self.columns[0].len();
        let normal = self.regression(own);
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
