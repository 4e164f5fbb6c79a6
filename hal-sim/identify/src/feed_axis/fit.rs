//! Output-error fit of the closed loop.

use super::axis::Axis;
use super::filter::butterworth_100;
use super::record::Record;
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::storage::Owned;
use nalgebra::{DMatrix, DVector, Dyn};

/// Rows that are left out at either end.
pub(super) const MARGIN: usize = 100;
/// Evaluations of a fit, as a multiple of its parameters.
const PATIENCE: usize = 3;
/// Every how many rows of the filtered error one is used.
const STEP: usize = 3;

/// Which parameters move.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Free {
    /// All of the model.
    Model,
    /// The homing only.
    Homing,
}

struct Problem<'a> {
    axis: Axis,
    record: &'a Record,
    measured: &'a [f64],
    free: Free,
    rows: &'a [usize],
    parameters: DVector<f64>,
}

impl Problem<'_> {
    fn axis_at(&self, parameters: &DVector<f64>) -> Axis {
        match self.free {
            Free::Model => self.axis.with(parameters.as_slice()),
            Free::Homing => Axis {
                homing: parameters[0],
                ..self.axis.clone()
            },
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
        let column = &|k: usize| {
            let mut beside = self.parameters.clone();
            let step = 1e-4 * beside[k].abs().max(0.05);
            beside[k] += step;
            (self.errors(&beside) - here) / step
        };
        let count = self.parameters.len();
        let threads = std::thread::available_parallelism().map_or(1, |n| n.get().min(count));
        let columns = std::thread::scope(|scope| {
            let work: Vec<_> = (0..threads)
                .map(|first| {
                    scope.spawn(move || {
                        let own = (first..count).step_by(threads);
                        own.map(|k| (k, column(k))).collect::<Vec<_>>()
                    })
                })
                .collect();
            work.into_iter()
                .flat_map(|thread| thread.join().expect("a simulation does not panic"))
                .collect::<Vec<_>>()
        });
        let mut jacobian = DMatrix::zeros(here.len(), count);
        for (k, values) in columns {
            jacobian.set_column(k, &values);
        }
        Some(jacobian)
    }
}

/// The model that follows a record's force best over `rows`.
pub(super) fn fitted(axis: &Axis, record: &Record, free: Free, rows: &[usize]) -> Axis {
    let measured = butterworth_100(&record.force(), record.rate);
    let start = match free {
        Free::Model => DVector::from_vec(axis.parameters()),
        Free::Homing => DVector::from_vec(vec![axis.homing]),
    };
    let problem = Problem {
        axis: axis.clone(),
        record,
        measured: &measured,
        free,
        rows,
        parameters: start,
    };
    let (problem, _) = LevenbergMarquardt::new()
        .with_ftol(3e-5)
        .with_xtol(3e-5)
        .with_patience(PATIENCE)
        .minimize(problem);
    problem.axis_at(&problem.parameters)
}

/// Standard deviations of the parameters, in their units. What is left of a fit is no white noise: pieces of it are
/// taken as one value each.
pub(super) fn deviations(axis: &Axis, record: &Record, rows: &[usize]) -> Vec<f64> {
    const PIECE: usize = 60;
    let measured = butterworth_100(&record.force(), record.rate);
    let problem = Problem {
        axis: axis.clone(),
        record,
        measured: &measured,
        free: Free::Model,
        rows,
        parameters: DVector::from_vec(axis.parameters()),
    };
    let scales = axis.scales();
    let (Some(left), Some(jacobian)) = (problem.residuals(), problem.jacobian()) else {
        return vec![f64::NAN; scales.len()];
    };
    let n = jacobian.ncols();
    let mut spread = DMatrix::zeros(n, n);
    for first in (0..left.len()).step_by(PIECE) {
        let count = PIECE.min(left.len() - first);
        let pull = jacobian.rows(first, count).transpose() * left.rows(first, count);
        spread += &pull * pull.transpose();
    }
    let curvature = jacobian.transpose() * &jacobian;
    match curvature.pseudo_inverse(1e-12) {
        Ok(inverse) => {
            let covariance = &inverse * spread * &inverse;
            (0..n)
                .map(|k| scales[k] * covariance[(k, k)].max(0.0).sqrt())
                .collect()
        }
        Err(_) => vec![f64::NAN; n],
    }
}
