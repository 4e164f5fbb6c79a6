//! Ridge regression on groups of columns, from products of columns that are summed once for each fold.

use crate::regression::column::dot;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Penalty in units of a column's own square: it shrinks a coefficient that the record tells by a thousandth.
const PENALTY: f64 = 1e-3;

/// Smoothness of functions side by side, in the same units: second differences of their coefficients cost so much (P-splines: Eilers
/// and Marx, *Statistical Science* 11, 1996). Where a record has no rows the curve goes straight on.
const SMOOTHNESS: f64 = 1e-3;

/// Columns, a target, and their products in each fold.
pub(super) struct Products {
    gram: Vec<DMatrix<f64>>,
    rhs: Vec<DVector<f64>>,
    energy: Vec<f64>,
    /// Cost of products of coefficients.
    smoothness: DMatrix<f64>,
}

impl Products {
    /// Of rows that are divided into folds; each fold is a list of stretches. Functions of `smooth` are side by side.
    pub(super) fn new(
        columns: &[Vec<f64>],
        target: &[f64],
        folds: &[Vec<Range<usize>>],
        smooth: &[Range<usize>],
    ) -> Self {
        let n = columns.len();
        let sum = |a: &[f64], b: &[f64], fold: &[Range<usize>]| -> f64 {
            fold.iter()
                .map(|rows| dot(&a[rows.clone()], &b[rows.clone()]))
                .sum()
        };
        let gram = folds.iter().map(|fold| {
            let mut gram = DMatrix::zeros(n, n);
            for k in 0..n {
                for j in 0..=k {
                    let product = sum(&columns[k], &columns[j], fold);
                    gram[(k, j)] = product;
                    gram[(j, k)] = product;
                }
            }
            gram
        });
        let rhs = folds.iter().map(|fold| {
            DVector::from_iterator(n, columns.iter().map(|column| sum(column, target, fold)))
        });
        let gram: Vec<DMatrix<f64>> = gram.collect();
        let own = |k: usize| gram.iter().map(|fold| fold[(k, k)]).sum::<f64>();
        let mut smoothness = DMatrix::zeros(n, n);
        for group in smooth {
            let mean = group.clone().map(own).sum::<f64>() / group.len().max(1) as f64;
            for first in group.start..group.end.saturating_sub(2) {
                for (k, a) in [1.0, -2.0, 1.0].into_iter().enumerate() {
                    for (j, b) in [1.0, -2.0, 1.0].into_iter().enumerate() {
                        smoothness[(first + k, first + j)] += SMOOTHNESS * mean * a * b;
                    }
                }
            }
        }
        Products {
            smoothness,
            gram,
            rhs: rhs.collect(),
            energy: folds.iter().map(|fold| sum(target, target, fold)).collect(),
        }
    }

    fn sums(
        &self,
        chosen: &[usize],
        folds: impl Iterator<Item = usize>,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let n = chosen.len();
        let mut gram = DMatrix::zeros(n, n);
        let mut rhs = DVector::zeros(n);
        for fold in folds {
            gram += self.gram[fold].select_rows(chosen).select_columns(chosen);
            rhs += self.rhs[fold].select_rows(chosen);
        }
        (gram, rhs)
    }

    fn smoothness_of(&self, chosen: &[usize]) -> DMatrix<f64> {
        self.smoothness.select_rows(chosen).select_columns(chosen)
    }

    /// Coefficients of the chosen columns on all folds but one.
    pub(super) fn fitted(&self, chosen: &[usize], without: Option<usize>) -> Option<DVector<f64>> {
        let folds = (0..self.gram.len()).filter(|fold| Some(*fold) != without);
        let (gram, rhs) = self.sums(chosen, folds);
        let gram = gram + self.smoothness_of(chosen);
        penalised(gram)?.cholesky().map(|factor| factor.solve(&rhs))
    }

    /// Inverse of the curvature of the chosen columns on all folds.
    pub(super) fn inverse(&self, chosen: &[usize]) -> Option<DMatrix<f64>> {
        let (gram, _) = self.sums(chosen, 0..self.gram.len());
        penalised(gram + self.smoothness_of(chosen))?
            .cholesky()
            .map(|factor| factor.inverse())
    }

    /// Sum of squares that the chosen columns leave of folds to which they were not fitted.
    pub(super) fn held_back(&self, chosen: &[usize]) -> f64 {
        let left = |fold: usize| {
            let Some(values) = self.fitted(chosen, Some(fold)) else {
                return self.energy[fold];
            };
            let (gram, rhs) = self.sums(chosen, std::iter::once(fold));
            self.energy[fold] - 2.0 * values.dot(&rhs) + (&gram * &values).dot(&values)
        };
        (0..self.gram.len()).map(left).sum()
    }
}

/// A Gram matrix with the penalty on its diagonal; `None` where it is not finite.
fn penalised(mut gram: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let most = gram.diagonal().amax();
    if !most.is_finite() {
        return None;
    }
    for k in 0..gram.nrows() {
        gram[(k, k)] += (PENALTY * gram[(k, k)]).max(1e-9 * most).max(1e-300);
    }
    Some(gram)
}
