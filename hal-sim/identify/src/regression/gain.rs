//! What candidates would bring to a regression without being added to it, and what columns bring where they were not
//! fitted.

use crate::regression::column::Column;
use crate::regression::normal::{Normal, Solution};
use nalgebra::{DMatrix, DVector};

/// Gain of a candidate over the columns that are there.
#[derive(Debug, Clone)]
pub struct Gain {
    /// Fall of the sum of squares on all operating points.
    pub fall: f64,
    /// Parameters of the candidate.
    pub values: Vec<f64>,
}

impl Gain {
    /// Part of a candidate's rms that the parameters which are there cannot take over; `whole` is the candidate with its values.
    pub(crate) fn own_part(&self, whole: &Column) -> f64 {
        (self.fall / whole.power().max(f64::MIN_POSITIVE))
            .clamp(0.0, 1.0)
            .sqrt()
    }
}

impl Normal {
    /// Gram matrix and right-hand side of candidate columns, less what the columns that are there can do as well; and
    /// the candidates' own weights before that.
    fn reduced(
        &self,
        candidates: &[Column],
        solution: &Solution,
    ) -> (DMatrix<f64>, DVector<f64>, Vec<f64>) {
        let (n, m) = (self.len(), candidates.len());
        let mut cross = DMatrix::zeros(n, m);
        let mut own = DMatrix::zeros(m, m);
        let mut rhs = DVector::zeros(m);
        for (j, candidate) in candidates.iter().enumerate() {
            for (k, column) in self.columns.iter().enumerate() {
                cross[(k, j)] = self.inner(column, candidate).iter().sum();
            }
            for (i, other) in candidates.iter().enumerate().take(j + 1) {
                let product: f64 = self.inner(other, candidate).iter().sum();
                own[(i, j)] = product;
                own[(j, i)] = product;
            }
            rhs[j] = self.inner(&self.target, candidate).iter().sum();
        }
        let before = own.diagonal().iter().copied().collect();
        own -= cross.transpose() * &solution.covariance * &cross;
        rhs -= cross.transpose() * &solution.values;
        (own, rhs, before)
    }

    /// What candidate columns would gain, without adding them.
    pub fn gain(&self, candidates: &[Column], solution: &Solution) -> Gain {
        let m = candidates.len();
        let (own, rhs, before) = self.reduced(candidates, solution);
        let nothing = Gain {
            fall: 0.0,
            values: vec![0.0; m],
        };
        // What the declared parameters can do as well is not the candidate's.
        if (0..m).any(|j| own[(j, j)] <= 1e-6 * before[j] || before[j] == 0.0) {
            return nothing;
        }
        own.cholesky().map_or(nothing, |factor| {
            let values = factor.solve(&rhs);
            Gain {
                fall: values.dot(&rhs),
                values: values.iter().copied().collect(),
            }
        })
    }

    /// What candidate columns with given parameters would gain, all other parameters solved again within their bounds.
    pub fn gain_at(&self, candidates: &[Column], values: &[f64]) -> f64 {
        let before = self.cost(&self.solve(None).values);
        let mut less = self.clone();
        for (candidate, value) in candidates.iter().zip(values) {
            let with_target = self.inner(candidate, &self.target);
            for (energy, product) in less.energy.iter_mut().zip(with_target) {
                *energy -= 2.0 * value * product;
            }
            for (other, other_value) in candidates.iter().zip(values) {
                for (energy, product) in less.energy.iter_mut().zip(self.inner(candidate, other)) {
                    *energy += value * other_value * product;
                }
            }
            for (k, column) in self.columns.iter().enumerate() {
                for (rhs, product) in less.rhs.iter_mut().zip(self.inner(column, candidate)) {
                    rhs[k] -= value * product;
                }
            }
        }
        before - less.cost(&less.solve(None).values)
    }

    /// Fall of the sum of squares on each operating point that the columns from `base` on bring when fitted on all, or
    /// on all others.
    pub fn falls(&self, base: usize, on_others: bool) -> Vec<f64> {
        let mut narrow = self.clone();
        narrow.truncate(base);
        (0..self.gram.len())
            .map(|fold| {
                let without = on_others.then_some(fold);
                narrow.left(fold, &narrow.solve(without).values)
                    - self.left(fold, &self.solve(without).values)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regression::normal::Prior;
    use std::rc::Rc;

    /// A candidate at 45 degrees to the column that is there: half of its square is its own.
    #[test]
    fn a_candidate_has_its_part_beside_what_is_there() {
        let column = |values: &[f64]| Column::alone(values.to_vec());
        let (there, candidate) = (column(&[1.0, 0.0]), column(&[1.0, 1.0]));
        let mut normal = Normal::new(column(&[3.0, 2.0]), &Rc::from([0..1, 1..2]));
        normal.push(there, Prior::FREE);
        let gain = normal.gain(std::slice::from_ref(&candidate), &normal.solve(None));
        let whole = Column::default().plus([&candidate], &gain.values);
        assert!((gain.values[0] - 2.0).abs() < 1e-6, "{gain:?}");
        assert!((gain.own_part(&whole) - 0.5_f64.sqrt()).abs() < 1e-6);
    }
}
