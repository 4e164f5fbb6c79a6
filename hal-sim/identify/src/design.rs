//! Weighted least squares over all channels at once, with sums kept for each operating point.

use crate::balance::Contribution;
use crate::channel::Channel;
use crate::fourier::Fourier;
use crate::noise::Noise;
use crate::signals::Signals;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Speeds below which friction may stick and the torque balance says nothing, rad/s.
const STICKING_RAD_S: f64 = 0.5;
/// Time around sticking, and at the ends of a record, over which filters carry what is not modelled, s.
const MARGIN_S: f64 = 0.03;
/// Shortest constant reference that counts as an operating point, s.
const PLATEAU_S: f64 = 0.3;

/// A whitened quantity: its samples in each channel that it reaches.
#[derive(Clone)]
pub struct Column {
    /// By [`Channel::index`].
    pub parts: [Option<Vec<f64>>; Channel::COUNT],
}

/// Sum of products, in eight strands that a compiler can put side by side.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut strands = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let tail: f64 = a8
        .remainder()
        .iter()
        .zip(b8.remainder())
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in a8.zip(b8) {
        for k in 0..8 {
            strands[k] += x[k] * y[k];
        }
    }
    strands.iter().sum::<f64>() + tail
}

/// Turns contributions into columns: whitening, masking, operating points.
pub struct Whitener<'a> {
    fourier: &'a Fourier,
    gains: [Vec<f64>; Channel::COUNT],
    masks: [Vec<bool>; Channel::COUNT],
    /// Decimated rows of each operating point.
    pub folds: Vec<Range<usize>>,
}

/// Rows of each operating point: a stretch of constant references and the ramp that follows it.
pub fn operating_points(signals: &Signals) -> Vec<Range<usize>> {
    let rows = signals.len();
    let same = |k: usize| {
        signals
            .references
            .iter()
            .all(|r| (r[k] - r[k - 1]).abs() <= 1e-6 * (1.0 + r[k].abs()))
    };
    let least = (PLATEAU_S * signals.rate) as usize;
    let mut starts = Vec::new();
    let mut start = 0;
    for k in 1..=rows {
        if k == rows || !same(k) {
            if k - start >= least {
                starts.push(start);
            }
            start = k;
        }
    }
    if starts.len() < 2 {
        // No plateaus: eight equal stretches.
        starts = (0..8).map(|k| k * rows / 8).collect();
    }
    starts[0] = 0;
    let ends = starts[1..].iter().copied().chain([rows]);
    starts
        .iter()
        .copied()
        .zip(ends)
        .map(|(a, b)| a..b)
        .collect()
}

impl<'a> Whitener<'a> {
    /// For one record.
    pub fn new(signals: &Signals, fourier: &'a Fourier, noise: &Noise) -> Self {
        let step = fourier.step();
        let rows = fourier.decimated_rows();
        let margin = (MARGIN_S * signals.rate / step as f64).ceil() as usize;
        let mask = |speeds: &[&[f64]]| -> Vec<bool> {
            let mut open = vec![true; rows];
            let mut close = |at: usize| {
                open[at.saturating_sub(margin)..(at + margin).min(rows)]
                    .iter_mut()
                    .for_each(|x| *x = false);
            };
            close(0);
            close(rows - 1);
            for speed in speeds {
                (0..rows)
                    .filter(|k| speed[k * step].abs() < STICKING_RAD_S)
                    .for_each(&mut close);
            }
            open
        };
        let masks = Channel::ALL.map(|channel| match channel {
            Channel::Torque(axis) => {
                mask(&[&signals.motors[axis.index()].omega, &signals.relative_speed])
            }
            Channel::VoltageD(_) | Channel::VoltageQ(_) => mask(&[]),
            Channel::Table => mask(&[&signals.relative_speed]),
        });
        let folds = operating_points(signals)
            .into_iter()
            .map(|r| r.start.div_ceil(step)..r.end.div_ceil(step))
            .collect();
        Whitener {
            fourier,
            gains: Channel::ALL.map(|c| noise.whitening(c, fourier)),
            masks,
            folds,
        }
    }

    /// Whether a decimated row of a channel counts.
    pub fn mask(&self, channel: Channel) -> &[bool] {
        &self.masks[channel.index()]
    }

    /// The whitening gain of a channel over the bins of a spectrum.
    pub fn gain(&self, channel: Channel) -> &[f64] {
        &self.gains[channel.index()]
    }

    /// A contribution as a column.
    pub fn column(&self, contribution: &Contribution) -> Column {
        let mut parts: [Option<Vec<f64>>; Channel::COUNT] = Default::default();
        for (channel, spectrum) in &contribution.0 {
            let index = channel.index();
            let mut signal = self.fourier.filtered(spectrum, &self.gains[index]);
            signal
                .iter_mut()
                .zip(&self.masks[index])
                .filter(|(_, open)| !**open)
                .for_each(|(x, _)| *x = 0.0);
            parts[index] = Some(signal);
        }
        Column { parts }
    }

    /// Rows of all channels that count.
    pub fn used_rows(&self) -> usize {
        self.masks
            .iter()
            .map(|mask| mask.iter().filter(|open| **open).count())
            .sum()
    }

    /// Inner product of two columns for each operating point.
    pub fn inner(&self, a: &Column, b: &Column) -> Vec<f64> {
        let mut sums = vec![0.0; self.folds.len()];
        for (x, y) in a.parts.iter().zip(&b.parts) {
            if let (Some(x), Some(y)) = (x, y) {
                for (sum, fold) in sums.iter_mut().zip(&self.folds) {
                    *sum += dot(&x[fold.clone()], &y[fold.clone()]);
                }
            }
        }
        sums
    }
}

/// The normal equations of a set of columns for one residual.
pub struct Normal {
    columns: Vec<Column>,
    target: Column,
    gram: Vec<DMatrix<f64>>,
    rhs: Vec<DVector<f64>>,
    energy: Vec<f64>,
    precision: Vec<f64>,
    bounds: Vec<f64>,
}

/// Inverse of a Gram matrix; of one whose columns say the same, the least-norm one.
fn inverse(gram: DMatrix<f64>) -> DMatrix<f64> {
    let n = gram.nrows();
    match gram.clone().cholesky() {
        Some(factor) => factor.inverse(),
        None => gram
            .pseudo_inverse(1e-12)
            .unwrap_or_else(|_| DMatrix::zeros(n, n)),
    }
}

/// Parameters, and what the fit explains.
#[derive(Clone)]
pub struct Solution {
    /// Value of each column's parameter.
    pub values: DVector<f64>,
    /// Their covariance under white noise of variance 1.
    pub covariance: DMatrix<f64>,
    /// Parameters that are held at a bound, and where.
    pub held: Vec<(usize, f64)>,
}

/// Least squares with some parameters held.
fn solve_holding(gram: &DMatrix<f64>, rhs: &DVector<f64>, held: &[(usize, f64)]) -> Solution {
    let n = rhs.len();
    let free: Vec<usize> = (0..n)
        .filter(|k| held.iter().all(|(h, _)| h != k))
        .collect();
    let mut reduced = DVector::from_iterator(free.len(), free.iter().map(|&k| rhs[k]));
    for (row, &k) in free.iter().enumerate() {
        reduced[row] -= held
            .iter()
            .map(|&(h, value)| gram[(k, h)] * value)
            .sum::<f64>();
    }
    let inverse = inverse(gram.select_rows(&free).select_columns(&free));
    let found = &inverse * reduced;
    let mut values = DVector::zeros(n);
    let mut covariance = DMatrix::zeros(n, n);
    held.iter().for_each(|&(k, value)| values[k] = value);
    for (row, &k) in free.iter().enumerate() {
        values[k] = found[row];
        for (column, &j) in free.iter().enumerate() {
            covariance[(k, j)] = inverse[(row, column)];
        }
    }
    Solution {
        values,
        covariance,
        held: Vec::new(),
    }
}

/// Gain of a candidate over the columns that are there.
#[derive(Debug, Clone)]
pub struct Gain {
    /// Fall of the sum of squares on all operating points.
    pub fall: f64,
    /// Parameters of the candidate.
    pub values: Vec<f64>,
}

impl Normal {
    /// No columns yet.
    pub fn new(target: Column, whitener: &Whitener) -> Self {
        let folds = whitener.folds.len();
        Normal {
            energy: whitener.inner(&target, &target),
            target,
            columns: Vec::new(),
            gram: vec![DMatrix::zeros(0, 0); folds],
            rhs: vec![DVector::zeros(0); folds],
            precision: Vec::new(),
            bounds: Vec::new(),
        }
    }

    /// Adds a column whose parameter has mean 0 and the given standard deviation before the record is seen, and lies
    /// within `bound` of 0 (both infinite for an effect).
    pub fn push(&mut self, column: Column, spread: f64, bound: f64, whitener: &Whitener) {
        let n = self.columns.len();
        let products: Vec<Vec<f64>> = self
            .columns
            .iter()
            .map(|c| whitener.inner(c, &column))
            .collect();
        let own = whitener.inner(&column, &column);
        let with_target = whitener.inner(&column, &self.target);
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
        self.precision.push(if spread.is_finite() {
            spread.powi(-2)
        } else {
            0.0
        });
        self.bounds.push(bound);
        self.columns.push(column);
    }

    /// Removes the columns from `n` on.
    pub fn truncate(&mut self, n: usize) {
        self.columns.truncate(n);
        self.precision.truncate(n);
        self.bounds.truncate(n);
        for fold in 0..self.gram.len() {
            self.gram[fold] = self.gram[fold].view((0, 0), (n, n)).into_owned();
            self.rhs[fold] = self.rhs[fold].rows(0, n).into_owned();
        }
    }

    /// Number of columns.
    pub fn len(&self) -> usize {
        self.precision.len()
    }

    /// Whether there are no columns.
    pub fn is_empty(&self) -> bool {
        self.precision.is_empty()
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
            gram[(k, k)] += self.precision[k].max(1e-9 * gram[(k, k)]).max(1e-12);
        }
        (gram, rhs)
    }

    /// Least squares over all operating points, or all but one. A parameter that would leave its bounds stays at the
    /// bound, the one that goes furthest first.
    pub fn solve(&self, without: Option<usize>) -> Solution {
        let (gram, rhs) = self.sums(without);
        let mut held: Vec<(usize, f64)> = Vec::new();
        loop {
            let solution = solve_holding(&gram, &rhs, &held);
            let excess = |k: usize| (k, solution.values[k].abs() / self.bounds[k]);
            let free = (0..self.len()).filter(|k| held.iter().all(|(h, _)| h != k));
            match free.map(excess).max_by(|a, b| a.1.total_cmp(&b.1)) {
                Some((k, ratio)) if ratio > 1.0 => {
                    held.push((k, self.bounds[k].copysign(solution.values[k])))
                }
                _ => return Solution { held, ..solution },
            }
        }
    }

    /// The solution of the columns that are there when those parameters are held that a regression with further columns
    /// holds, and what that regression costs. Against this solution a candidate like them is judged without the bias of
    /// parameters that went to their bounds for want of it.
    pub fn solve_beside(&mut self, candidates: &[Column], whitener: &Whitener) -> (Solution, f64) {
        let n = self.len();
        for candidate in candidates {
            self.push(candidate.clone(), f64::INFINITY, f64::INFINITY, whitener);
        }
        let full = self.solve(None);
        let cost = self.cost(&full.values);
        self.truncate(n);
        let (gram, rhs) = self.sums(None);
        let solution = solve_holding(&gram, &rhs, &full.held);
        (
            Solution {
                held: full.held,
                ..solution
            },
            cost,
        )
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
            .zip(&self.precision)
            .map(|(v, p)| v * v * p)
            .sum::<f64>()
    }

    /// What is left of the target under given parameters.
    pub fn residual(&self, values: &DVector<f64>) -> Column {
        let mut left = self.target.clone();
        for (column, value) in self.columns.iter().zip(values.iter()) {
            for (sum, part) in left.parts.iter_mut().zip(&column.parts) {
                if let (Some(sum), Some(part)) = (sum, part) {
                    sum.iter_mut().zip(part).for_each(|(s, p)| *s -= value * p);
                }
            }
        }
        left
    }

    /// Gram matrix and right-hand side of candidate columns, less what the columns that are there can do as well; and
    /// the candidates' own weights before that.
    fn reduced(
        &self,
        candidates: &[Column],
        solution: &Solution,
        whitener: &Whitener,
    ) -> (DMatrix<f64>, DVector<f64>, Vec<f64>) {
        let (n, m) = (self.len(), candidates.len());
        let mut cross = DMatrix::zeros(n, m);
        let mut own = DMatrix::zeros(m, m);
        let mut rhs = DVector::zeros(m);
        for (j, candidate) in candidates.iter().enumerate() {
            for (k, column) in self.columns.iter().enumerate() {
                cross[(k, j)] = whitener.inner(column, candidate).iter().sum();
            }
            for (i, other) in candidates.iter().enumerate().take(j + 1) {
                let product: f64 = whitener.inner(other, candidate).iter().sum();
                own[(i, j)] = product;
                own[(j, i)] = product;
            }
            rhs[j] = whitener.inner(&self.target, candidate).iter().sum();
        }
        let before = own.diagonal().iter().copied().collect();
        own -= cross.transpose() * &solution.covariance * &cross;
        rhs -= cross.transpose() * &solution.values;
        (own, rhs, before)
    }

    /// What candidate columns would gain, without adding them.
    pub fn gain(&self, candidates: &[Column], solution: &Solution, whitener: &Whitener) -> Gain {
        let m = candidates.len();
        let (own, rhs, before) = self.reduced(candidates, solution, whitener);
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
    pub fn gain_at(&self, candidates: &[Column], values: &[f64], whitener: &Whitener) -> f64 {
        let before = self.cost(&self.solve(None).values);
        let mut less = Normal {
            columns: Vec::new(),
            target: Column {
                parts: Default::default(),
            },
            gram: self.gram.clone(),
            rhs: self.rhs.clone(),
            energy: self.energy.clone(),
            precision: self.precision.clone(),
            bounds: self.bounds.clone(),
        };
        for (candidate, value) in candidates.iter().zip(values) {
            let with_target = whitener.inner(candidate, &self.target);
            for (energy, product) in less.energy.iter_mut().zip(with_target) {
                *energy -= 2.0 * value * product;
            }
            for (other, other_value) in candidates.iter().zip(values) {
                for (energy, product) in
                    less.energy.iter_mut().zip(whitener.inner(candidate, other))
                {
                    *energy += value * other_value * product;
                }
            }
            for (k, column) in self.columns.iter().enumerate() {
                for (rhs, product) in less.rhs.iter_mut().zip(whitener.inner(column, candidate)) {
                    rhs[k] -= value * product;
                }
            }
        }
        before - less.cost(&less.solve(None).values)
    }

    /// Fall of the sum of squares on each operating point that the columns from `base` on bring when fitted on all
    /// others.
    pub fn held_back(&self, base: usize) -> Vec<f64> {
        let mut narrow = Normal {
            columns: self.columns[..base].to_vec(),
            target: self.target.clone(),
            gram: self.gram.clone(),
            rhs: self.rhs.clone(),
            energy: self.energy.clone(),
            precision: self.precision.clone(),
            bounds: self.bounds.clone(),
        };
        narrow.truncate(base);
        (0..self.gram.len())
            .map(|fold| {
                narrow.left(fold, &narrow.solve(Some(fold)).values)
                    - self.left(fold, &self.solve(Some(fold)).values)
            })
            .collect()
    }
}
