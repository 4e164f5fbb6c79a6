//! One record as the judge looks at it: a residual, known regressors, and the blocks that count.

use super::basis::At;
use crate::regression::column::dot;
use crate::regression::inverse::of_gram;
use crate::regression::sandwich::correlated;
use nalgebra::DMatrix;
use std::ops::Range;

/// Length of a block in correlation times: what reaches into the next is then small.
const BLOCK_OF_CORRELATED: f64 = 12.0;
/// Shortest block, s: some periods of a speed loop of 10 Hz.
pub(super) const BLOCK_S: f64 = 0.4;
/// Rows over which a correlation time is taken.
const CORRELATED_ROWS: usize = 2000;

/// One record's side: rows in which it counts are not 0.
pub(crate) struct Side {
    /// What the declared and named regressors leave of the drive quantity.
    pub(crate) left: Vec<f64>,
    /// Those regressors, and nuisances.
    pub(crate) known: Vec<Known>,
    /// Where the machine is.
    pub(crate) at: Vec<At>,
    /// Rows that count.
    pub(crate) open: Vec<bool>,
    /// Rows of each stretch without a gap.
    pub(crate) stretches: Vec<Range<usize>>,
    /// Rows a second.
    pub(crate) rate: f64,
    /// Rms of the drive quantity.
    pub(crate) drive_rms: f64,
}

/// A regressor that is declared or named, or a nuisance.
pub(crate) struct Known {
    /// Number of its parameter, by which both records have it; `None`: it belongs to this record alone.
    pub(crate) parameter: Option<usize>,
    /// Rows.
    pub(crate) column: Vec<f64>,
    /// Inverse variance of the remaining information of its parameter before a record is seen, in units of the noise.
    pub(crate) precision: f64,
}

impl Known {
    /// One of both records, of whose parameter nothing is known.
    pub(crate) fn free(parameter: usize, column: Vec<f64>) -> Self {
        Known {
            parameter: Some(parameter),
            column,
            precision: 0.0,
        }
    }
}

/// A side without what the known regressors explain.
pub(super) struct Partialled {
    pub(super) left: Vec<f64>,
    /// Parameters of the known regressors.
    pub(super) parameters: Vec<Option<usize>>,
    /// Coefficients of the known regressors in the residual.
    pub(super) of_left: Vec<f64>,
    pub(super) columns: Vec<Vec<f64>>,
    /// Rms of each column after over before.
    pub(super) own: Vec<f64>,
    /// Coefficients of the known regressors in each column.
    pub(super) of_known: Vec<Vec<f64>>,
}

pub(super) fn rms(values: &[f64]) -> f64 {
    (dot(values, values) / values.len().max(1) as f64).sqrt()
}

impl Side {
    /// Blocks of rows, none across a gap.
    pub(super) fn blocks(&self, length: usize) -> Vec<Range<usize>> {
        let of = |stretch: &Range<usize>| {
            let count = (stretch.len() / length).max(1);
            let at = |k: usize, stretch: &Range<usize>| stretch.start + k * stretch.len() / count;
            (0..count)
                .map(|k| at(k, stretch)..at(k + 1, stretch))
                .collect::<Vec<_>>()
        };
        let counts = |rows: &Range<usize>| {
            2 * self.open[rows.clone()].iter().filter(|open| **open).count() > rows.len()
        };
        self.stretches.iter().flat_map(of).filter(counts).collect()
    }

    /// Rows of a block: longer than what a residual is correlated over.
    pub(super) fn block_length(&self, left: &[f64]) -> usize {
        let longest = self.stretches.iter().max_by_key(|rows| rows.len());
        let left = longest.map_or(&[][..], |rows| &left[rows.clone()]);
        let length = correlated(&left[..left.len().min(CORRELATED_ROWS)]);
        ((BLOCK_OF_CORRELATED * length).max(BLOCK_S * self.rate) as usize).max(1)
    }

    /// Columns without what the known regressors explain of them.
    pub(super) fn partialled(&self, columns: Vec<Vec<f64>>) -> Option<Partialled> {
        let sizes: Vec<f64> = self
            .known
            .iter()
            .map(|known| rms(&known.column).max(1e-300))
            .collect();
        let n = sizes.len();
        let gram = DMatrix::from_fn(n, n, |k, j| {
            let [own, other] = [k, j].map(|k| &self.known[k]);
            let prior = if k == j { own.precision } else { 0.0 };
            (dot(&own.column, &other.column) + prior) / sizes[k] / sizes[j]
        });
        let inverse = of_gram(&gram)?;
        let of_known = |values: &[f64]| -> Vec<f64> {
            let pairs = self.known.iter().zip(&sizes);
            let products: Vec<f64> = pairs
                .map(|(known, size)| dot(&known.column, values) / size)
                .collect();
            (0..n)
                .map(|k| (0..n).map(|j| inverse[(k, j)] * products[j]).sum::<f64>() / sizes[k])
                .collect()
        };
        let less = |values: &[f64], of_known: &[f64]| -> Vec<f64> {
            let mut left = values.to_vec();
            for (value, known) in of_known.iter().zip(&self.known) {
                left.iter_mut()
                    .zip(&known.column)
                    .for_each(|(x, c)| *x -= value * c);
            }
            left
        };
        let before: Vec<f64> = columns.iter().map(|column| rms(column)).collect();
        let coefficients: Vec<Vec<f64>> = columns.iter().map(|column| of_known(column)).collect();
        let columns: Vec<Vec<f64>> = columns
            .iter()
            .zip(&coefficients)
            .map(|(column, own)| less(column, own))
            .collect();
        let own = columns
            .iter()
            .zip(&before)
            .map(|(after, before)| rms(after) / before.max(1e-300));
        let of_left = of_known(&self.left);
        Some(Partialled {
            parameters: self.known.iter().map(|known| known.parameter).collect(),
            left: less(&self.left, &of_left),
            of_left,
            own: own.collect(),
            columns,
            of_known: coefficients,
        })
    }

    /// What the chosen functions add.
    pub(super) fn alone(&self, own: &Partialled, chosen: &[usize], values: &[f64]) -> Vec<f64> {
        let sum = predicted(&own.columns, chosen, values, self.left.len());
        self.plus(sum, own, chosen, values, |k, _| Some(k))
    }

    /// A prediction as it is on a record that nothing was fitted to: the known regressors' shares are the fit record's.
    pub(super) fn untouched(
        &self,
        alone: &[f64],
        fit: &Partialled,
        chosen: &[usize],
        values: &[f64],
    ) -> Vec<f64> {
        let less: Vec<f64> = values.iter().map(|value| -value).collect();
        self.plus(alone.to_vec(), fit, chosen, &less, |_, known| {
            fit.place(known)
        })
    }

    /// With what the known regressors have of the chosen functions on a record, where each has its `place`.
    fn plus(
        &self,
        mut sum: Vec<f64>,
        record: &Partialled,
        chosen: &[usize],
        values: &[f64],
        place: impl Fn(usize, &Known) -> Option<usize>,
    ) -> Vec<f64> {
        for (k, known) in self.known.iter().enumerate() {
            let Some(k) = place(k, known) else {
                continue;
            };
            let pairs = chosen.iter().zip(values);
            let share: f64 = pairs.map(|(c, value)| value * record.of_known[*c][k]).sum();
            sum.iter_mut()
                .zip(&known.column)
                .for_each(|(s, x)| *s += share * x);
        }
        sum
    }

    /// The residual with the known regressors as the fit record has them.
    pub(super) fn with_parameters_of(&self, fit: &Partialled) -> Vec<f64> {
        let mut left = self.left.clone();
        for known in &self.known {
            if let Some(k) = fit.place(known) {
                let value = fit.of_left[k];
                left.iter_mut()
                    .zip(&known.column)
                    .for_each(|(x, c)| *x -= value * c);
            }
        }
        left
    }
}

impl Partialled {
    /// Where this record has the parameter of another record's regressor.
    fn place(&self, known: &Known) -> Option<usize> {
        let parameter = known.parameter?;
        self.parameters
            .iter()
            .position(|own| *own == Some(parameter))
    }
}

pub(super) fn predicted(
    columns: &[Vec<f64>],
    chosen: &[usize],
    values: &[f64],
    rows: usize,
) -> Vec<f64> {
    let mut sum = vec![0.0; rows];
    for (column, value) in chosen.iter().zip(values) {
        sum.iter_mut()
            .zip(&columns[*column])
            .for_each(|(s, x)| *s += value * x);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check record's table rests where the fit record's never did: it has a parameter more, and not at the end.
    #[test]
    fn a_parameter_of_one_record_alone_takes_nothing_from_the_other() {
        const ROWS: usize = 8;
        let side = |known: Vec<Known>| Side {
            left: vec![0.0; ROWS],
            known,
            at: Vec::new(),
            open: vec![true; ROWS],
            stretches: std::iter::once(0..ROWS).collect(),
            rate: 1.0,
            drive_rms: 1.0,
        };
        let ones = vec![1.0; ROWS];
        let own = Known {
            parameter: None,
            column: (0..ROWS).map(|row| row as f64).collect(),
            precision: 0.0,
        };
        let fit = side(vec![Known::free(4, ones.clone())]);
        let check = side(vec![own, Known::free(4, ones)]);
        let of_fit = fit.partialled(vec![vec![3.0; ROWS]]).unwrap();
        let left = check.untouched(&[0.0; ROWS], &of_fit, &[0], &[1.0]);
        assert!(left.iter().all(|x| (x + 3.0).abs() < 1e-9), "{left:?}");
    }
}
