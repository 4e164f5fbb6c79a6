//! The judge: whether the residual of a fit record predicts the residual of a check record.

use super::basis::{Along, At, Group};
use super::ridge::Products;
use super::selected::{groups, members, selected};
use crate::regression::column::dot;
use crate::regression::inverse::of_gram;
use crate::regression::sandwich::correlated;
use nalgebra::DMatrix;
use std::ops::Range;

/// Folds into which blocks are dealt in turn.
const FOLDS: usize = 4;
/// Length of a block in correlation times: what reaches into the next is then small.
const BLOCK_OF_CORRELATED: f64 = 12.0;
/// Shortest block, s: some periods of a speed loop of 10 Hz.
const BLOCK_S: f64 = 0.4;
/// Blocks that a statistic needs.
pub(crate) const LEAST_BLOCKS: usize = 8;
/// Quantiles of a normal deviate at 1 %, 5 % and 0.1 %.
const CARRIES: f64 = 2.326;
const WITHIN: f64 = 1.645;
const CARRIES_ORDER: f64 = 3.090;
/// Rms of a prediction over that of the drive quantity, below which nothing is missing that matters: smooth shapes, orders.
const LEAST_SIZE: f64 = 0.01;
const LEAST_ORDER: f64 = 0.002;
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

/// What the judge says.
#[derive(Debug, Clone, Default)]
pub(crate) struct Judged {
    /// The groups that predict, the strongest first, with the coefficients of their functions.
    pub(crate) groups: Vec<(Group, Vec<f64>)>,
    /// Their rms on the check record, all together, and one by one.
    pub(crate) size: f64,
    pub(crate) sizes: Vec<f64>,
    /// Covariance of all coefficients.
    pub(crate) covariance: Option<DMatrix<f64>>,
    /// The prediction of both records beside the known regressors.
    pub(crate) predicted: [Vec<f64>; 2],
    /// What the chosen functions alone add to either record.
    pub(crate) alone: [Vec<f64>; 2],
    /// By how much the check record's square falls with the fit record's parameters.
    pub(crate) fall: f64,
    /// Deviations from 0: fit to check, and within the check record.
    pub(crate) deviations: [f64; 2],
    /// Blocks of the check record.
    pub(crate) blocks: usize,
    /// Whether anything predicts: fit to check, and within the check record.
    pub(crate) carries: bool,
    /// Whether something predicts within the check record and does not carry over.
    pub(crate) own: bool,
}

/// A side without what the known regressors explain.
pub(super) struct Partialled {
    left: Vec<f64>,
    /// Parameters of the known regressors.
    parameters: Vec<Option<usize>>,
    /// Coefficients of the known regressors in the residual.
    of_left: Vec<f64>,
    columns: Vec<Vec<f64>>,
    /// Rms of each column after over before.
    pub(super) own: Vec<f64>,
    /// Coefficients of the known regressors in each column.
    of_known: Vec<Vec<f64>>,
}

fn rms(values: &[f64]) -> f64 {
    (dot(values, values) / values.len().max(1) as f64).sqrt()
}

impl Side {
    /// Blocks of rows, none across a gap.
    fn blocks(&self, length: usize) -> Vec<Range<usize>> {
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
    fn block_length(&self, left: &[f64]) -> usize {
        let longest = self.stretches.iter().max_by_key(|rows| rows.len());
        let left = longest.map_or(&[][..], |rows| &left[rows.clone()]);
        let length = correlated(&left[..left.len().min(CORRELATED_ROWS)]);
        ((BLOCK_OF_CORRELATED * length).max(BLOCK_S * self.rate) as usize).max(1)
    }

    /// Columns without what the known regressors explain of them.
    fn partialled(&self, columns: Vec<Vec<f64>>) -> Option<Partialled> {
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
    fn alone(&self, own: &Partialled, chosen: &[usize], values: &[f64]) -> Vec<f64> {
        let sum = predicted(&own.columns, chosen, values, self.left.len());
        self.plus(sum, own, chosen, values, |k, _| Some(k))
    }

    /// A prediction as it is on a record that nothing was fitted to: the known regressors' shares are the fit record's.
    fn untouched(
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
    fn with_parameters_of(&self, fit: &Partialled) -> Vec<f64> {
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

/// Quantile of Student's t from that of the normal distribution (Cornish and Fisher's expansion; Abramowitz and Stegun
/// 26.7.5).
fn student(z: f64, freedom: f64) -> f64 {
    z + (z.powi(3) + z) / (4.0 * freedom)
        + (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / (96.0 * freedom * freedom)
}

/// Deviations of the mean of products from 0, by their scatter from block to block.
fn deviations(left: &[f64], predicted: &[f64], blocks: &[Range<usize>]) -> f64 {
    let sums: Vec<f64> = blocks
        .iter()
        .map(|rows| dot(&left[rows.clone()], &predicted[rows.clone()]))
        .collect();
    let count = sums.len() as f64;
    let mean = sums.iter().sum::<f64>() / count;
    let variance =
        sums.iter().map(|sum| (sum - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    mean / (variance / count).max(1e-300).sqrt()
}

fn predicted(columns: &[Vec<f64>], chosen: &[usize], values: &[f64], rows: usize) -> Vec<f64> {
    let mut sum = vec![0.0; rows];
    for (column, value) in chosen.iter().zip(values) {
        sum.iter_mut()
            .zip(&columns[*column])
            .for_each(|(s, x)| *s += value * x);
    }
    sum
}

/// Blocks that are dealt to the folds in turn.
fn folds(blocks: &[Range<usize>]) -> Vec<Vec<Range<usize>>> {
    (0..FOLDS)
        .map(|fold| blocks.iter().skip(fold).step_by(FOLDS).cloned().collect())
        .collect()
}

/// Each fold of a record as the chosen columns predict it from the other folds.
fn within(
    record: &Partialled,
    products: &Products,
    chosen: &[usize],
    folds: &[Vec<Range<usize>>],
) -> Vec<f64> {
    let mut within = vec![0.0; record.left.len()];
    for (fold, stretches) in folds.iter().enumerate() {
        let Some(own) = products.fitted(chosen, Some(fold)) else {
            continue;
        };
        for rows in stretches {
            for row in rows.clone() {
                within[row] = chosen
                    .iter()
                    .zip(&own)
                    .map(|(k, value)| value * record.columns[*k][row])
                    .sum();
            }
        }
    }
    within
}

/// Covariance of coefficients from the inverse of their curvature, by how far each block pulls them.
fn spread(
    inverse: &DMatrix<f64>,
    fit: &Partialled,
    chosen: &[usize],
    predicted: &[f64],
    blocks: &[Range<usize>],
) -> DMatrix<f64> {
    let after = less(&fit.left, predicted);
    let n = chosen.len();
    let mut spread = DMatrix::zeros(n, n);
    for rows in blocks {
        let pull: Vec<f64> = chosen
            .iter()
            .map(|k| dot(&fit.columns[*k][rows.clone()], &after[rows.clone()]))
            .collect();
        for k in 0..n {
            for j in 0..n {
                spread[(k, j)] += pull[k] * pull[j];
            }
        }
    }
    let count = blocks.len() as f64;
    inverse * spread * inverse * (count / (count - 1.0))
}

/// What is left of values beside a prediction.
fn less(values: &[f64], predicted: &[f64]) -> Vec<f64> {
    values.iter().zip(predicted).map(|(x, p)| x - p).collect()
}

/// Predictions of the check record's residual beside its known regressors.
struct Predictions {
    /// With the fit record's coefficients.
    beside: Vec<f64>,
    /// Each fold with the coefficients of the others.
    within: Vec<f64>,
}

impl Judged {
    /// Tests predictions of `left` by the blocks `tested`.
    fn test(
        &mut self,
        left: &[f64],
        by: &Predictions,
        tested: &[Range<usize>],
        drive_rms: f64,
        orders_alone: bool,
    ) {
        self.deviations = [&by.beside, &by.within].map(|by| deviations(left, by, tested));
        let freedom = tested.len() as f64 - 1.0;
        let (carries, size) = match orders_alone {
            true => (CARRIES_ORDER, LEAST_ORDER),
            false => (CARRIES, LEAST_SIZE),
        };
        self.size = rms(&by.beside);
        let falls = self.fall > 0.0;
        let repeats = self.deviations[1] > student(WITHIN, freedom);
        let matters = self.size > size * drive_rms;
        self.carries =
            falls && matters && repeats && self.deviations[0] > student(carries, freedom);
        self.own = !self.carries
            && self.deviations[1] > student(CARRIES_ORDER, freedom)
            && rms(&by.within) > size * drive_rms;
    }

    /// Lists the groups that were taken, with the coefficients `values` of all their functions.
    fn list(
        &mut self,
        taken: &[usize],
        groups: &[Group],
        members: &[Vec<usize>],
        values: &[f64],
        check: &Partialled,
    ) {
        let mut at = 0;
        for &group in taken {
            let own = &members[group];
            let part = &values[at..at + own.len()];
            let first = members[..group].len();
            let offset: usize = groups[..first].iter().map(Group::len).sum();
            let mut whole = vec![0.0; groups[group].len()];
            own.iter()
                .zip(part)
                .for_each(|(k, value)| whole[k - offset] = *value);
            self.sizes
                .push(rms(&predicted(&check.columns, own, part, check.left.len())));
            self.groups.push((groups[group].clone(), whole));
            at += own.len();
        }
    }
}

/// Judges a check record by a fit record, by the functions that are `offered`. `column` gives a function of the coordinates as it shows in a record's drive
/// quantity: through the filters and lags that this has.
pub(crate) fn judge(
    sides: [&Side; 2],
    highest_order: u32,
    further: &[f64],
    offered: impl Fn(Along) -> bool,
    column: impl Fn(usize, &Group, usize) -> Vec<f64>,
) -> Judged {
    let mut judged = Judged {
        predicted: sides.map(|side| vec![0.0; side.left.len()]),
        ..Judged::default()
    };
    let blocks = sides.map(|side| side.blocks(((BLOCK_S * side.rate) as usize).max(1)));
    judged.blocks = blocks[1].len();
    if blocks.iter().any(|blocks| blocks.len() < LEAST_BLOCKS) {
        return judged;
    }
    let groups = groups(sides, highest_order, further, offered);
    let of_groups = |record: usize| -> Vec<Vec<f64>> {
        groups
            .iter()
            .flat_map(|group| (0..group.len()).map(move |k| (group, k)))
            .map(|(group, k)| column(record, group, k))
            .collect()
    };
    let (Some(fit), Some(check)) = (
        sides[0].partialled(of_groups(0)),
        sides[1].partialled(of_groups(1)),
    ) else {
        return judged;
    };
    let members = members(&groups, &fit);
    let smooth: Vec<Range<usize>> = (groups.iter().zip(&members))
        .filter(|(group, _)| group.is_smooth())
        .filter_map(|(_, own)| Some(*own.first()?..*own.last()? + 1))
        .collect();
    let folds = blocks.each_ref().map(|blocks| folds(blocks));
    let products = Products::new(&fit.columns, &fit.left, &folds[0], &smooth);
    let (taken, chosen) = selected(&products, &members);
    let Some(values) = products
        .fitted(&chosen, None)
        .filter(|values| !values.is_empty())
    else {
        return judged;
    };
    let values: Vec<f64> = values.iter().copied().collect();
    judged.alone = [
        sides[0].alone(&fit, &chosen, &values),
        sides[1].alone(&check, &chosen, &values),
    ];
    judged.predicted = [
        predicted(&fit.columns, &chosen, &values, fit.left.len()),
        sides[1].untouched(&judged.alone[1], &fit, &chosen, &values),
    ];
    let of_check = Products::new(&check.columns, &check.left, &folds[1], &smooth);
    let by = Predictions {
        beside: predicted(&check.columns, &chosen, &values, check.left.len()),
        within: within(&check, &of_check, &chosen, &folds[1]),
    };
    // The residual beside the prediction is what noise and the rest of the misfit are correlated over.
    let rest = less(&check.left, &by.beside);
    let tested = sides[1].blocks(sides[1].block_length(&rest));
    judged.blocks = tested.len();
    if tested.len() < LEAST_BLOCKS {
        return judged;
    }
    let before = sides[1].with_parameters_of(&fit);
    let after = less(&before, &judged.predicted[1]);
    judged.fall = dot(&before, &before) - dot(&after, &after);
    let orders_alone = taken
        .iter()
        .all(|group| groups[*group].along.order().is_some());
    judged.test(&check.left, &by, &tested, sides[1].drive_rms, orders_alone);
    judged.covariance = (products.inverse(&chosen))
        .map(|inverse| spread(&inverse, &fit, &chosen, &judged.predicted[0], &blocks[0]));
    judged.list(&taken, &groups, &members, &values, &check);
    judged
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
