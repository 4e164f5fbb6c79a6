//! Which effects an axis has, from one record alone.
//!
//! Two-fold cross-validation over the record's operating points (stretches of one speed and direction): a model is fitted
//! on either fold and judged by the force error on the other, by the criterion of all machines
//! ([`selection`](crate::selection)). All terms of friction and amplifier are put in together, since some hide each
//! other; then orders of the screw, the strongest first, as long as each is worth it; then each term is taken out in
//! turn, the least certain first, and stays out if it was not worth it. No other record is looked at.

use super::axis::{Axis, Term};
use super::filter::butterworth_100;
use super::fit::{Free, MARGIN, covariance, fitted};
use super::record::Record;
use crate::design::{Column, dot};
use crate::limits::plausible_on_axis;
use crate::normal::Normal;
use crate::selection::{Evidence, MATERIAL_OF_ERROR, TOO_LITTLE};
use std::f64::consts::TAU;

/// Orders at most.
const MOST: usize = 8;
/// Length of record that a search uses, s: a lap or two of a programme; the fit that follows uses all of it.
const LENGTH_S: f64 = 12.5;
/// What the filter of the force leaves, Hz.
const BAND_HZ: f64 = 100.0;
/// Share of the rows that must show an order.
const LEAST_SHOWN: f64 = 0.1;
/// What may be there besides orders of the screw.
const TERMS: [Term; 7] = [
    Term::Asymmetry,
    Term::Lag,
    Term::Stribeck,
    Term::Saturation,
    Term::Presliding,
    Term::PositionFriction,
    Term::PositionLoad,
];

/// A term that was tried.
#[derive(Debug, Clone)]
pub struct Trial {
    /// Which.
    pub term: Term,
    /// Share by which the force error on what was not fitted is less with it.
    pub fall: f64,
    /// Why it was not taken.
    pub lost: Option<&'static str>,
}

/// The two folds of a record's rows.
pub(super) fn folds(record: &Record) -> [Vec<usize>; 2] {
    let speed = crate::fourier::slope(
        &butterworth_100(&record.reference, record.rate),
        record.rate,
    );
    let top = speed.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    let mut folds = [Vec::new(), Vec::new()];
    // Segments end where the reference all but stands still. Each second stroke is dealt the other way round, so that
    // both folds have all speeds, though not in the same direction.
    let (mut segment, mut stroke, mut moving, mut way) = (0_usize, 0_usize, false, 0.0);
    for (row, v) in speed.iter().enumerate() {
        let now = v.abs() > 0.05 * top;
        if now && !moving {
            if way * v < 0.0 {
                stroke += 1;
                segment = 0;
            } else {
                segment += 1;
            }
            way = *v;
        }
        moving = now;
        if (MARGIN..record.len() - MARGIN).contains(&row) {
            folds[(segment + stroke) % 2].push(row);
        }
    }
    folds
}

/// Force that a model leaves of some rows of a record, N.
fn left(axis: &Axis, record: &Record, rows: &[usize]) -> Vec<f64> {
    let simulated = butterworth_100(&axis.simulate(record).force, record.rate);
    let measured = butterworth_100(&record.force(), record.rate);
    rows.iter().map(|&k| measured[k] - simulated[k]).collect()
}

/// Models fitted on either fold, and what they leave of the other, N.
struct Pair<'a> {
    record: &'a Record,
    folds: &'a [Vec<usize>; 2],
    fits: [Axis; 2],
    left: Vec<f64>,
}

impl<'a> Pair<'a> {
    fn new(start: [Axis; 2], record: &'a Record, folds: &'a [Vec<usize>; 2]) -> Self {
        let [first, second] = start;
        let fits = [(first, 0), (second, 1)]
            .map(|(axis, fold)| fitted(&axis, record, Free::Model, &folds[fold]));
        Pair {
            left: [0, 1]
                .map(|k: usize| left(&fits[k], record, &folds[1 - k]))
                .concat(),
            record,
            folds,
            fits,
        }
    }

    /// Share by which the force error on what was not fitted is less than without a term, and why that is not enough.
    fn worth(&self, without: &Pair, term: Term) -> (f64, Option<&'static str>) {
        let rms = |left: &[f64]| (dot(left, left) / left.len().max(1) as f64).sqrt();
        let fall = 1.0 - rms(&self.left) / rms(&without.left);
        if fall < MATERIAL_OF_ERROR {
            return (fall, Some(TOO_LITTLE));
        }
        for fit in &self.fits {
            let force = fit.limit_v * self.record.force_per_volt.abs();
            let values = fit.find(term).unwrap_or_default();
            let travel = self.record.travel();
            if let Err(reason) = plausible_on_axis(term, values, fit.base[2], force, travel) {
                return (fall, Some(reason));
            }
        }
        let whole = std::iter::once(0..self.left.len()).collect();
        let normal = Normal::new(Column::alone(without.left.clone()), &whole);
        let part =
            Column::alone(without.left.clone()).plus([&Column::alone(self.left.clone())], &[-1.0]);
        (fall, Evidence::new(&normal, part).borne_out().err())
    }

    /// With other terms, fitted again from where it is.
    fn changed(&self, change: impl Fn(&mut Axis)) -> Self {
        let start = self.fits.clone().map(|mut axis| {
            change(&mut axis);
            axis
        });
        Self::new(start, self.record, self.folds)
    }
}

/// Everything that was tried on a record, in the order in which the terms that were taken belong into the model.
pub fn search(axis: &Axis, record: &Record) -> Vec<Trial> {
    let record = &record.first((LENGTH_S * record.rate) as usize);
    let folds = folds(record);
    let start = [axis.clone(), axis.clone()];
    let mut pair = Pair::new(start, record, &folds).changed(|axis| {
        axis.terms.extend(TERMS.map(|term| (term, term.start())));
    });
    let mut orders = Vec::new();
    while orders.len() < MOST {
        let Some(term) = strongest_order(&pair.fits, record, &folds) else {
            break;
        };
        let with = pair.changed(|axis| axis.terms.push((term, term.start())));
        let (fall, lost) = with.worth(&pair, term);
        orders.push(Trial { term, fall, lost });
        if lost.is_some() {
            break;
        }
        pair = with;
    }
    let certainty = certainty(&pair.fits[0], record, &folds[0]);
    let mut terms: Vec<(f64, Term)> = TERMS.map(|term| (certainty(term), term)).to_vec();
    terms.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut trials = Vec::new();
    for (_, term) in terms {
        let without = pair.changed(|axis| axis.terms.retain(|(known, _)| *known != term));
        let (fall, lost) = pair.worth(&without, term);
        trials.push(Trial { term, fall, lost });
        if lost.is_some() {
            pair = without;
        }
    }
    // What matters most first.
    trials.sort_by(|a, b| b.fall.total_cmp(&a.fall));
    trials.extend(orders);
    trials
}

/// How many deviations a term's first parameter is from 0. A spring before sliding is none at infinity, not at 0: it is
/// looked at first.
fn certainty(axis: &Axis, record: &Record, rows: &[usize]) -> impl Fn(Term) -> f64 + use<> {
    let covariance = covariance(axis, record, rows);
    let mut at = axis.base.len();
    let list: Vec<(Term, f64)> = axis
        .terms
        .iter()
        .map(|(term, values)| {
            let sure = values[0].abs() / covariance[(at, at)].sqrt().max(1e-300);
            at += values.len();
            (*term, if *term == Term::Presliding { 0.0 } else { sure })
        })
        .collect();
    move |term| {
        list.iter()
            .find(|(known, _)| *known == term)
            .map_or(0.0, |(_, sure)| *sure)
    }
}

/// The order per turn of the screw at which the error of the fits is strongest, on the fold that each was fitted to,
/// and that they do not have yet.
fn strongest_order(fits: &[Axis; 2], record: &Record, folds: &[Vec<usize>; 2]) -> Option<Term> {
    let axis = &fits[0];
    let measured = butterworth_100(&record.force(), record.rate);
    let mut rows: Vec<(f64, f64, f64)> = Vec::new();
    for (fit, fold) in fits.iter().zip(folds) {
        let run = fit.simulate(record);
        let simulated = butterworth_100(&run.force, record.rate);
        // At speed only: at rest an angle says nothing.
        let moving = fold
            .iter()
            .step_by(4)
            .filter(|k| run.velocity[**k].abs() > 5e-3);
        rows.extend(moving.map(|&k| {
            (
                TAU * record.position[k] / axis.lead_m,
                simulated[k] - measured[k],
                BAND_HZ * axis.lead_m / run.velocity[k].abs(),
            )
        }));
    }
    let has = |order: f64| {
        axis.terms
            .iter()
            .any(|(term, _)| matches!(term, Term::Periodic(known) if (known - order).abs() < 0.3))
    };
    // A row shows the orders that the filter leaves at its speed; faster ones it would show as lower ones.
    let strength = |order: f64| {
        let shown = rows.iter().filter(|(_, _, highest)| order < *highest);
        let (c, s, n) = shown.fold((0.0, 0.0, 0.0), |(c, s, n), (angle, error, _)| {
            let (sin, cos) = (order * angle).sin_cos();
            (c + error * cos, s + error * sin, n + 1.0)
        });
        if n < LEAST_SHOWN * rows.len() as f64 {
            return 0.0;
        }
        (c * c + s * s) / n
    };
    (70..4500)
        .map(|k| 0.01 * f64::from(k))
        .filter(|order| !has(*order))
        .map(|order| (strength(order), order))
        .filter(|(strength, _)| *strength > 0.0)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, order)| {
            Term::Periodic(if (order - order.round()).abs() < 0.015 {
                order.round()
            } else {
                order
            })
        })
}

#[cfg(test)]
mod tests {
    use super::super::fit::tests::record;
    use super::*;
    use crate::feed_axis::Law;

    /// At 50 turns a second and 1000 rows, 20.07 periods a turn look like 3.5 Hz.
    #[test]
    fn what_is_slow_at_high_speed_is_no_high_order() {
        let axis = Axis {
            law: Law::Difference(2),
            ..Axis::published()
        };
        let clean = record(&axis, [50.0, -50.0, 10.0, -10.0]);
        let slow = |row: usize| {
            let t = row as f64 / clean.rate;
            f64::from(t < 2.0) * (TAU * 3.5 * t).cos()
        };
        let record = clean.with_force(slow);
        let rows: Vec<usize> = (MARGIN..record.len() - MARGIN).collect();
        let fits = [axis.clone(), axis];
        let found = strongest_order(&fits, &record, &[rows.clone(), rows]);
        // 100 Hz at 10 turns a second.
        assert!(
            !matches!(found, Some(Term::Periodic(order)) if order > 10.5),
            "{found:?}"
        );
    }
}
