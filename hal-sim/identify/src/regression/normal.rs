//! Weighted least squares over all channels at once, with sums kept for each operating point.

use crate::regression::bounded::{solve_holding, solve_within};
use crate::regression::column::{Column, dot};
use crate::signal::channel::Channel;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;
use std::rc::Rc;

pub use crate::regression::bounded::Solution;

/// What is known of a column's parameter before the record is seen.
#[derive(Debug, Clone, Copy)]
pub struct Prior {
    /// Where it is most likely.
    mean: f64,
    /// Standard deviation about that.
    spread: f64,
    /// Greatest size.
    bound: f64,
    /// The value, if the column leaves none open.
    fixed: Option<f64>,
}

impl Prior {
    /// Nothing is known: the parameter of an effect.
    pub const FREE: Prior = Prior {
        mean: 0.0,
        spread: f64::INFINITY,
        bound: f64::INFINITY,
        fixed: None,
    };

    /// Mean 0, a standard deviation, and a size of at most `bound`.
    pub fn within(spread: f64, bound: f64) -> Self {
        Prior {
            spread,
            bound,
            ..Self::FREE
        }
    }

    /// A mean and a standard deviation.
    pub fn about(mean: f64, spread: f64) -> Self {
        Prior {
            mean,
            spread,
            ..Self::FREE
        }
    }

    /// The column counts with this value.
    pub fn fixed(value: f64) -> Self {
        Prior {
            fixed: Some(value),
            ..Self::FREE
        }
    }

    fn precision(self) -> f64 {
        if self.spread.is_finite() {
            self.spread.powi(-2)
        } else {
            0.0
        }
    }
}

/// The normal equations of a set of columns for one residual.
#[derive(Clone)]
pub struct Normal {
    pub(crate) columns: Vec<Rc<Column>>,
    pub(crate) target: Column,
    pub(crate) gram: Vec<DMatrix<f64>>,
    pub(crate) rhs: Vec<DVector<f64>>,
    pub(crate) energy: Vec<f64>,
    priors: Vec<Prior>,
    /// Rows of each operating point.
    folds: Rc<[Range<usize>]>,
}

/// A regression with further columns.
pub struct With {
    /// Sum of squares that is left, the spread of the parameters included.
    pub cost: f64,
    /// Sum of squares that is left in each channel.
    pub channels: [f64; Channel::COUNT],
    /// Parameters of the further columns.
    pub values: Vec<f64>,
    /// Parameters of the columns that were there which it holds at a bound.
    pub held: Vec<(usize, f64)>,
}

impl Normal {
    /// No columns yet; `folds` are the rows of each operating point.
    pub fn new(target: Column, folds: &Rc<[Range<usize>]>) -> Self {
        let mut normal = Normal {
            energy: Vec::new(),
            columns: Vec::new(),
            gram: vec![DMatrix::zeros(0, 0); folds.len()],
            rhs: vec![DVector::zeros(0); folds.len()],
            priors: Vec::new(),
            folds: folds.clone(),
            target,
        };
        normal.energy = normal.inner(&normal.target, &normal.target);
        normal
    }

    /// Inner product of two columns for each operating point.
    pub(crate) fn inner(&self, a: &Column, b: &Column) -> Vec<f64> {
        let mut sums = vec![0.0; self.folds.len()];
        for (x, y) in a.parts.iter().zip(&b.parts) {
            if let (Some(x), Some(y)) = (x, y) {
                for (sum, fold) in sums.iter_mut().zip(self.folds.iter()) {
                    *sum += dot(&x[fold.clone()], &y[fold.clone()]);
                }
            }
        }
        sums
    }

    /// Adds a column.
    pub fn push(&mut self, column: Column, prior: Prior) {
        let n = self.columns.len();
        let products: Vec<Vec<f64>> = self
            .columns
            .iter()
            .map(|c| self.inner(c, &column))
            .collect();
        let own = self.inner(&column, &column);
        let with_target = self.inner(&column, &self.target);
        for fold in 0..self.gram.len() {
            let mut gram = std::mem::replace(&mut self.gram[fold], DMatrix::zeros(0, 0)).resize(
                n + 1,
                n + 1,
                0.0,
            );
            for (k, product) in products.iter().enumerate() {
                gram[(k, n)] = product[fold];
                gram[(n, k)] = product[fold];
            }
            gram[(n, n)] = own[fold];
            self.gram[fold] = gram;
            let rhs = std::mem::replace(&mut self.rhs[fold], DVector::zeros(0));
            self.rhs[fold] = rhs.push(with_target[fold]);
        }
        self.priors.push(prior);
        self.columns.push(Rc::new(column));
    }

    /// Removes the columns from `n` on.
    pub fn truncate(&mut self, n: usize) {
        self.columns.truncate(n);
        self.priors.truncate(n);
        for fold in 0..self.gram.len() {
            self.gram[fold] = self.gram[fold].view((0, 0), (n, n)).into_owned();
            self.rhs[fold] = self.rhs[fold].rows(0, n).into_owned();
        }
    }

    /// Number of columns.
    pub fn len(&self) -> usize {
        self.priors.len()
    }

    /// Whether there are no columns.
    pub fn is_empty(&self) -> bool {
        self.priors.is_empty()
    }

    /// What was known of each parameter before the record was seen, as the inverse of its variance.
    pub(crate) fn known(&self) -> Vec<f64> {
        self.priors.iter().map(|prior| prior.precision()).collect()
    }

    fn sums(&self, without: Option<usize>) -> (DMatrix<f64>, DVector<f64>) {
        let n = self.len();
        let (mut gram, mut rhs) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for fold in (0..self.gram.len()).filter(|fold| Some(*fold) != without) {
            gram += &self.gram[fold];
            rhs += &self.rhs[fold];
        }
        for k in 0..n {
            // A column that nothing excites keeps a tiny precision, so that its parameter stays 0.
            let precision = self.priors[k].precision();
            rhs[k] += precision * self.priors[k].mean;
            gram[(k, k)] += precision.max(1e-9 * gram[(k, k)]).max(1e-12);
        }
        (gram, rhs)
    }

    /// Covariance of the parameters under white noise of variance 1, as if none were at its bound: one that is there may be off by what
    /// its prior and the record let it, towards the inside.
    pub(crate) fn covariance(&self) -> DMatrix<f64> {
        let (gram, rhs) = self.sums(None);
        solve_holding(&gram, &rhs, &self.fixed()).covariance
    }

    /// Nothing is known of a parameter.
    pub(crate) fn release(&mut self, k: usize) {
        self.priors[k] = Prior::FREE;
    }

    /// By how much the cost falls if nothing is known of given parameters.
    pub(crate) fn fall_without_priors(&self, of: &[usize]) -> f64 {
        if of.is_empty() {
            return 0.0;
        }
        let mut free = self.clone();
        of.iter().for_each(|&k| free.release(k));
        let cost = |normal: &Normal| normal.cost(&normal.solve(None).values);
        cost(self) - cost(&free)
    }

    /// Columns that count with a given value.
    fn fixed(&self) -> Vec<(usize, f64)> {
        let priors = self.priors.iter().enumerate();
        priors
            .filter_map(|(k, prior)| Some((k, prior.fixed?)))
            .collect()
    }

    /// Least squares within the bounds over all operating points, or all but one.
    pub fn solve(&self, without: Option<usize>) -> Solution {
        let (gram, rhs) = self.sums(without);
        let bounds: Vec<f64> = self.priors.iter().map(|prior| prior.bound).collect();
        solve_within(&gram, &rhs, &bounds, &self.fixed())
    }

    /// The regression with further columns.
    pub fn with(&mut self, candidates: &[(Column, Prior)]) -> With {
        let n = self.len();
        for (column, prior) in candidates {
            self.push(column.clone(), *prior);
        }
        let full = self.solve(None);
        let with = With {
            cost: self.cost(&full.values),
            channels: self.left_by_channel(&full.values),
            values: full
                .values
                .rows(n, candidates.len())
                .iter()
                .copied()
                .collect(),
            held: full.held.into_iter().filter(|(k, _)| *k < n).collect(),
        };
        self.truncate(n);
        with
    }

    /// The solution of the columns that are there when given parameters are held. Against that of a regression with
    /// further columns ([`With::held`]) a candidate like them is judged without the bias of parameters that went to
    /// their bounds without it.
    pub fn solve_beside(&self, held: &[(usize, f64)]) -> Solution {
        let (gram, rhs) = self.sums(None);
        solve_holding(&gram, &rhs, held)
    }

    /// Sum of squares that is left in each channel under given parameters.
    pub fn left_by_channel(&self, values: &DVector<f64>) -> [f64; Channel::COUNT] {
        self.residual(values)
            .parts
            .map(|part| part.map_or(0.0, |part| dot(&part, &part)))
    }

    /// Sum of squares of one operating point under given parameters.
    pub fn left(&self, fold: usize, values: &DVector<f64>) -> f64 {
        self.energy[fold] - 2.0 * self.rhs[fold].dot(values)
            + (&self.gram[fold] * values).dot(values)
    }

    /// Sum of squares that is left on all operating points, the spread of the parameters included.
    pub fn cost(&self, values: &DVector<f64>) -> f64 {
        let data: f64 = (0..self.gram.len())
            .map(|fold| self.left(fold, values))
            .sum();
        data + values
            .iter()
            .zip(&self.priors)
            .map(|(v, prior)| (v - prior.mean).powi(2) * prior.precision())
            .sum::<f64>()
    }

    /// The residual of the target under given parameters.
    pub fn residual(&self, values: &DVector<f64>) -> Column {
        let columns = self.columns.iter().map(Rc::as_ref);
        self.target.less(columns, values.iter().copied())
    }
}
