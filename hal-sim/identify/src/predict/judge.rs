//! The judge: whether the residual of a fit record predicts the residual of a check record.

use super::basis::{Along, Group};
use super::ridge::Products;
use super::selected::{groups, members, selected};
use super::side::{BLOCK_S, Partialled, Side, predicted, rms};
use crate::regression::column::dot;
use nalgebra::DMatrix;
use std::ops::Range;

/// Folds into which blocks are dealt in turn.
const FOLDS: usize = 4;
/// Blocks that a statistic needs.
pub(crate) const LEAST_BLOCKS: usize = 8;
/// Quantiles of a normal deviate at 1 %, 5 % and 0.1 %.
const CARRIES: f64 = 2.326;
const WITHIN: f64 = 1.645;
const CARRIES_ORDER: f64 = 3.090;
/// Rms of a prediction over that of the drive quantity, below which nothing is missing that matters: smooth shapes, orders.
const LEAST_SIZE: f64 = 0.01;
const LEAST_ORDER: f64 = 0.002;

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
