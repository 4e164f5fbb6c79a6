//! Output-error fit of the closed loop.

use super::axis::Axis;
use super::filter::butterworth_100;
use super::record::Record;
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::storage::Owned;
use nalgebra::{DMatrix, DVector, Dyn};

/// Rows that are left out at either end.
pub(super) const MARGIN: usize = 100;
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
    rows: std::ops::Range<usize>,
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
        let force = butterworth_100(&run.force);
        let rows = self.rows.clone().step_by(STEP);
        DVector::from_iterator(
            rows.len(),
            rows.map(|k| {
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
        let here = self.errors(&self.parameters);
        let mut jacobian = DMatrix::zeros(here.len(), self.parameters.len());
        for k in 0..self.parameters.len() {
            let mut beside = self.parameters.clone();
            let step = 1e-4 * beside[k].abs().max(0.05);
            beside[k] += step;
            jacobian.set_column(k, &((self.errors(&beside) - &here) / step));
        }
        Some(jacobian)
    }
}

/// The model that follows a record's force best over `rows`.
pub(super) fn fitted(
    axis: &Axis,
    record: &Record,
    free: Free,
    rows: std::ops::Range<usize>,
) -> Axis {
    let measured = butterworth_100(&record.force());
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
        .with_ftol(1e-5)
        .with_xtol(1e-5)
        .with_patience(3)
        .minimize(problem);
    problem.axis_at(&problem.parameters)
}
