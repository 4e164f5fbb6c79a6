//! Output-error fit of the closed loop.

use super::axis::Axis;
use super::record::Record;
use crate::regression::sandwich::Linear;
use crate::signal::filter::butterworth_100;
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::storage::Owned;
use nalgebra::{DMatrix, DVector, Dyn};
use rayon::prelude::*;

/// Rows that are left out at either end.
pub(super) const MARGIN: usize = 100;
/// Evaluations of a fit, as a multiple of its parameters.
const PATIENCE: usize = 10;
/// Every how many rows of the filtered error one is used.
const STEP: usize = 3;

/// Which parameters move.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Free {
    /// All of the model but its orders.
    Model,
    /// All of the model, its orders too.
    Orders,
    /// The homing only.
    Homing,
    /// These only, of the model.
    Only {
        /// First.
        from: usize,
        /// After the last.
        to: usize,
    },
}

/// The first of viscous friction, Coulomb friction and offset.
pub(super) const FRICTION_FROM: usize = 1;
/// These three.
pub(super) const FRICTION: Free = Free::Only {
    from: FRICTION_FROM,
    to: FRICTION_FROM + 3,
};

struct Problem<'a> {
    axis: Axis,
    record: &'a Record,
    measured: Vec<f64>,
    free: Free,
    rows: &'a [usize],
    parameters: DVector<f64>,
}

impl<'a> Problem<'a> {
    fn new(axis: &Axis, record: &'a Record, free: Free, rows: &'a [usize]) -> Self {
        Problem {
            axis: axis.clone(),
            record,
            measured: butterworth_100(&record.force(), record.rate),
            free,
            rows,
            parameters: start(axis, free),
        }
    }

    fn axis_at(&self, parameters: &DVector<f64>) -> Axis {
        match self.free {
            Free::Model | Free::Orders => {
                let (own, orders) = parameters.as_slice().split_at(self.axis.parameters().len());
                self.axis.with(own).moved(orders)
            }
            Free::Homing => Axis {
                homing: parameters[0],
                ..self.axis.clone()
            },
            Free::Only { from, to } => {
                let mut own = self.axis.parameters();
                own[from..to].copy_from_slice(parameters.as_slice());
                self.axis.with(&own)
            }
        }
    }

    fn errors(&self, parameters: &DVector<f64>) -> DVector<f64> {
        let run = self.axis_at(parameters).simulate(self.record);
        let force = butterworth_100(&run.force, self.record.rate);
        let rows = self.rows.iter().step_by(STEP);
        DVector::from_iterator(
            rows.len(),
            rows.map(|&k| {
                let error = force[k] - self.measured[k];
                // A parameter that breaks the loop is only very wrong, not undefined.
                if error.is_finite() {
                    error.clamp(-1e4, 1e4)
                } else {
                    1e4
                }
            }),
        )
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Problem<'_> {
    type ParameterStorage = Owned<f64, Dyn>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;

    fn set_params(&mut self, parameters: &DVector<f64>) {
        self.parameters.copy_from(parameters);
    }

    fn params(&self) -> DVector<f64> {
        self.parameters.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        Some(self.errors(&self.parameters))
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let here = &self.errors(&self.parameters);
        let column = |k: usize| {
            let (beside, step) = beside(self.parameters.as_slice(), k);
            (self.errors(&DVector::from_vec(beside)) - here) / step
        };
        let columns = (0..self.parameters.len()).into_par_iter().map(column);
        Some(DMatrix::from_columns(&columns.collect::<Vec<_>>()))
    }
}

impl Axis {
    /// Force that is measured less simulated, after the 100 Hz filter, N; 0 at the record's ends.
    pub fn left(&self, record: &Record) -> Vec<f64> {
        let simulated = butterworth_100(&self.simulate(record).force, record.rate);
        let measured = butterworth_100(&record.force(), record.rate);
        let inside = MARGIN..record.len() - MARGIN;
        (0..record.len())
            .map(|k| {
                if inside.contains(&k) {
                    measured[k] - simulated[k]
                } else {
                    0.0
                }
            })
            .collect()
    }
}

/// The parameters with the `k`th a little further, and by how much: a difference quotient's step.
pub(super) fn beside(parameters: &[f64], k: usize) -> (Vec<f64>, f64) {
    let mut beside = parameters.to_vec();
    let step = 1e-4 * beside[k].abs().max(0.05);
    beside[k] += step;
    (beside, step)
}

/// Where a fit starts: the model's parameters, then, if they are free, how far its orders are from where they were.
fn start(axis: &Axis, free: Free) -> DVector<f64> {
    let mut start = match free {
        Free::Model | Free::Orders => axis.parameters(),
        Free::Homing => vec![axis.homing],
        Free::Only { from, to } => axis.parameters()[from..to].to_vec(),
    };
    if free == Free::Orders {
        start.extend(axis.orders().iter().map(|_| 0.0));
    }
    DVector::from_vec(start)
}

/// The model that follows a record's force best over `rows`.
pub(super) fn fitted(axis: &Axis, record: &Record, free: Free, rows: &[usize]) -> Axis {
    converged(axis, record, free, rows).0
}

/// The same, and whether the optimiser says that it came to a minimum.
pub(super) fn converged(axis: &Axis, record: &Record, free: Free, rows: &[usize]) -> (Axis, bool) {
    let problem = Problem::new(axis, record, free, rows);
    let (problem, report) = LevenbergMarquardt::new()
        .with_ftol(3e-5)
        .with_xtol(3e-5)
        .with_patience(PATIENCE)
        .minimize(problem);
    let axis = problem.axis_at(&problem.parameters);
    (axis, report.termination.was_successful())
}

/// Covariance of the parameters at a fit, in their units: with [`Free::Orders`] the base four, the terms', then the orders.
pub(super) fn covariance(axis: &Axis, record: &Record, free: Free, rows: &[usize]) -> DMatrix<f64> {
    let problem = Problem::new(axis, record, free, rows);
    let count = problem.parameters.len();
    let mut scales = axis.scales();
    if let Free::Only { from, to } = free {
        scales = scales[from..to].to_vec();
    }
    scales.resize(count, 1.0);
    let left = problem.errors(&problem.parameters);
    let covariance = problem
        .jacobian()
        .and_then(|jacobian| Linear::new(jacobian, &left))
        .map(|fit| fit.covariance());
    match covariance {
        Some(found) => DMatrix::from_fn(count, count, |k, j| scales[k] * scales[j] * found[(k, j)]),
        None => DMatrix::from_element(count, count, f64::NAN),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::axis::Term;
    use super::super::record::Law;
    use super::*;
    use crate::regression::sandwich::{Wave, interval, tests::coloured};

    /// Four strokes of a second each, turns a second.
    pub(in super::super) fn record(axis: &Axis, strokes: [f64; 4]) -> Record {
        const RATE: f64 = 1000.0;
        let speed = |t: f64| axis.lead_m * strokes[t as usize % 4];
        let mut at = 0.0;
        let reference: Vec<f64> = (0..4000)
            .map(|k| {
                at += speed(f64::from(k) / RATE) / RATE;
                at
            })
            .collect();
        followed(axis, reference, RATE)
    }

    /// What an axis makes of a reference, m.
    pub(in super::super) fn followed(axis: &Axis, reference: Vec<f64>, rate: f64) -> Record {
        let mut record = Record::to_follow(reference, rate);
        let run = axis.simulate(&record);
        record.position = run.position;
        record.output = run
            .force
            .iter()
            .map(|f| f / record.force_per_volt)
            .collect();
        record
    }

    impl Record {
        /// With something more in its force, N, row by row.
        pub(in super::super) fn with_force(&self, more: impl Fn(usize) -> f64) -> Self {
            let mut changed = self.clone();
            for (row, u) in changed.output.iter_mut().enumerate() {
                *u += more(row) / self.force_per_volt;
            }
            changed
        }
    }

    #[test]
    fn the_truth_is_in_the_intervals_as_often_as_they_promise() {
        const TRIALS: u64 = 40;
        let real = Axis {
            law: Law::Difference(2),
            terms: vec![(Term::Periodic(4.3), vec![1.5, -0.8])],
            ..Axis::published()
        };
        let clean = record(&real, [2.0, -3.0, 3.0, -2.0]);
        let rows: Vec<usize> = (MARGIN..clean.len() - MARGIN).collect();
        let start = real.moved(&[0.03]);
        let truth = Wave::new([1.5, -0.8], [0.0; 2], 0.0);
        let (mut inside, mut of) = (0, 0);
        for seed in 0..TRIALS {
            let noise = coloured(seed, clean.len(), 0.95);
            let noisy = clean.with_force(|row| 0.7 * noise[row]);
            let found = fitted(&start, &noisy, Free::Orders, &rows);
            let covariance = covariance(&found, &noisy, Free::Orders, &rows);
            let (variance, values) = (|k: usize| covariance[(k, k)], &found.terms[0].1);
            let wave = Wave::new(
                [values[0], values[1]],
                [variance(4), variance(5)],
                covariance[(4, 5)],
            );
            let known = [
                (found.orders()[0], variance(6), 4.3),
                (wave.amplitude[0], wave.amplitude[1], truth.amplitude[0]),
                (wave.phase[0], wave.phase[1], truth.phase[0]),
            ];
            let base = (0..4).map(|k| (found.base[k], variance(k), real.base[k]));
            for (value, variance, truth) in base.chain(known) {
                let [low, high] = interval(value, variance);
                inside += u32::from(low <= truth && truth <= high);
                of += 1;
            }
        }
        let covered = f64::from(inside) / f64::from(of);
        println!("{inside} of {of}");
        assert!((0.89..=0.99).contains(&covered), "{covered}");
    }
}
