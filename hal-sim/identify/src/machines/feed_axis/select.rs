//! Which effects an axis has, from one record alone.
//!
//! Forward selection by two-fold cross-validation over the record's operating points (stretches of one speed and
//! direction). The closed loop's simulation is linearised at the model as it is: each parameter and each further term is
//! then a regressor, fitted on either fold and judged on the other by the criterion of all machines
//! ([`selection`](crate::search::selection)). The term that lowers the error there most is taken, and all parameters are fitted
//! again by simulation. No other record is looked at.

use super::axis::{Axis, Term};
use super::fit::{Free, MARGIN, beside, fitted};
use super::limits::plausible_on_axis;
use super::record::Record;
use crate::regression::column::{Column, dot};
use crate::regression::normal::{Normal, Prior};
use crate::search::selection::{Evidence, MATERIAL_OF_ERROR, TOO_LITTLE};
use crate::signal::filter::butterworth_100;
use nalgebra::DVector;
use std::f64::consts::TAU;

/// Orders at most.
const MOST: usize = 8;
/// Length of record that a search uses, s: a lap or two of a programme; the fit that follows uses all of it.
const LENGTH_S: f64 = 12.5;
/// What the filter of the force leaves, Hz.
const BAND_HZ: f64 = 100.0;
/// Share of the rows that must show an order.
const LEAST_SHOWN: f64 = 0.1;
/// Hundredths of the orders per turn that are looked for.
const ORDERS: std::ops::Range<i32> = 70..4500;
/// How near to a whole order one is tried as whole, too.
const NEAR_WHOLE: f64 = 0.1;
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

/// Speeds over which Stribeck friction may decay, m/s, and stiffnesses of friction's spring before sliding, N/m, from which
/// a fit begins.
const STRIBECK_M_PER_S: [f64; 3] = [5e-3, 2e-2, 8e-2];
const PRESLIDING_N_PER_M: [f64; 3] = [1e6, 4e6, 1.6e7];

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
    let speed = crate::signal::fourier::slope(
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

/// What a model leaves of a record's force and what its parameters add to it, N and N per scale, filtered.
struct Linearised<'a> {
    axis: Axis,
    record: &'a Record,
    force: Vec<f64>,
    left: Vec<f64>,
    parameters: Vec<Vec<f64>>,
}

impl<'a> Linearised<'a> {
    fn new(axis: Axis, record: &'a Record) -> Self {
        let measured = butterworth_100(&record.force(), record.rate);
        let force = simulated(&axis, record);
        let own = axis.parameters();
        let column = |k: usize| {
            let (beside, step) = beside(&own, k);
            difference(&simulated(&axis.with(&beside), record), &force, step)
        };
        Linearised {
            parameters: (0..own.len()).map(column).collect(),
            left: difference(&measured, &force, 1.0),
            axis,
            record,
            force,
        }
    }

    /// What a further term adds per unit of its linear parameters. One that is not linear is its whole difference.
    fn further(&self, start: &Start) -> Vec<Vec<f64>> {
        let with = |values: Vec<f64>, by: f64| {
            let mut axis = self.axis.clone();
            axis.terms.push((start.term, values));
            difference(&simulated(&axis, self.record), &self.force, by)
        };
        match start.term {
            Term::Stribeck => vec![with(vec![1.0, start.shape], 1.0)],
            Term::Presliding => vec![with(vec![start.shape], 1.0)],
            Term::Periodic(_) => vec![with(vec![1.0, 0.0], 1.0), with(vec![0.0, 1.0], 1.0)],
            Term::Lag => vec![with(vec![start.shape], start.shape)],
            term => {
                let unit = 0.1 * term.scale()[0];
                vec![with(vec![unit], unit)]
            }
        }
    }
}

/// The force of a simulation as it is compared, N.
fn simulated(axis: &Axis, record: &Record) -> Vec<f64> {
    butterworth_100(&axis.simulate(record).force, record.rate)
}

fn difference(a: &[f64], b: &[f64], by: f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| (a - b) / by).collect()
}

/// A term, and the number in which it is not linear.
#[derive(Debug, Clone, Copy)]
struct Start {
    term: Term,
    shape: f64,
}

impl Start {
    /// A term over the shapes that it may have.
    fn all(term: Term) -> Vec<Start> {
        let shapes: &[f64] = match term {
            Term::Stribeck => &STRIBECK_M_PER_S,
            Term::Presliding => &PRESLIDING_N_PER_M,
            Term::Lag => &[1e-3],
            _ => &[0.0],
        };
        shapes.iter().map(|&shape| Start { term, shape }).collect()
    }

    /// Candidates of which it is the best.
    fn best_of(self) -> usize {
        match self.term {
            Term::Periodic(_) => ORDERS.len(),
            _ => TERMS.len() * STRIBECK_M_PER_S.len(),
        }
    }

    /// Where its fit begins, from its linear parameters.
    fn values(self, linear: &[f64]) -> Vec<f64> {
        match self.term {
            Term::Stribeck => vec![linear[0], self.shape],
            Term::Presliding => vec![self.shape],
            Term::Periodic(_) => linear.to_vec(),
            _ => vec![linear[0]],
        }
    }
}

/// A term that was tried on either fold and held against the other one.
struct Judged {
    start: Start,
    /// Linear parameters, the mean of both folds.
    linear: Vec<f64>,
    /// Share by which the force error on what was not fitted is less with it.
    fall: f64,
    lost: Option<&'static str>,
}

/// The regressions of a model's parameters on either fold.
struct Search<'a> {
    of: Linearised<'a>,
    /// What is left and the parameters' columns on the rows of either fold.
    left: [Column; 2],
    own: [Vec<Column>; 2],
    normals: [Normal; 2],
}

impl<'a> Search<'a> {
    fn new(of: Linearised<'a>, folds: &[Vec<usize>; 2]) -> Self {
        let left = [0, 1].map(|fold: usize| cut(&of.left, &folds[fold]));
        let own = [0, 1].map(|fold: usize| {
            let columns = of.parameters.iter();
            columns
                .map(|column| cut(column, &folds[fold]))
                .collect::<Vec<_>>()
        });
        let normals = [0, 1].map(|fold: usize| {
            let mut normal = alone(left[fold].clone());
            for column in &own[fold] {
                normal.push(column.clone(), Prior::FREE);
            }
            normal
        });
        Search {
            of,
            left,
            own,
            normals,
        }
    }

    /// The best of the shapes that a term may have.
    fn best(&self, term: Term, folds: &[Vec<usize>; 2]) -> Option<Judged> {
        let judged = Start::all(term).into_iter();
        let judged = judged.map(|start| self.judged(start, folds));
        judged.max_by(|a, b| {
            let is_taken = |judged: &Judged| judged.lost.is_none();
            is_taken(a)
                .cmp(&is_taken(b))
                .then(a.fall.total_cmp(&b.fall))
        })
    }

    /// A term fitted on either fold and judged on the other by the criterion of all machines.
    fn judged(&self, start: Start, folds: &[Vec<usize>; 2]) -> Judged {
        let further = self.of.further(&start);
        let columns = [0, 1].map(|fold: usize| {
            let columns = further.iter();
            columns
                .map(|column| cut(column, &folds[fold]))
                .collect::<Vec<_>>()
        });
        let mut linear = vec![0.0; further.len()];
        let (mut without, mut rest, mut effect) = (Vec::new(), Vec::new(), Vec::new());
        let mut on_fit = Vec::new();
        for fold in [0, 1] {
            let other = 1 - fold;
            let normal = &self.normals[fold];
            let before = normal.solve(None).values;
            let mut with = normal.clone();
            for column in &columns[fold] {
                let prior = match start.term {
                    // Its column is the whole difference to a jump: it is there or it is not.
                    Term::Presliding => Prior::fixed(1.0),
                    _ => Prior::FREE,
                };
                with.push(column.clone(), prior);
            }
            let values = with.solve(None).values;
            let own: Vec<f64> = values
                .rows(normal.len(), further.len())
                .iter()
                .copied()
                .collect();
            let part = Column::default().plus(&columns[fold], &own);
            on_fit.push(Evidence::new(normal, part));
            let left = &self.left[other];
            let less = |values: &DVector<f64>| left.less(&self.own[other], values.iter().copied());
            without.extend_from_slice(less(&before).only());
            rest.extend_from_slice(less(&values).only());
            effect.extend_from_slice(Column::default().plus(&columns[other], &own).only());
            linear
                .iter_mut()
                .zip(&own)
                .for_each(|(mean, value)| *mean += 0.5 * value);
        }
        let effect = Column::alone(effect);
        let rest = Column::alone(rest);
        let rms = |values: &[f64]| (dot(values, values) / values.len().max(1) as f64).sqrt();
        let fall = 1.0 - rms(rest.less([&effect], [1.0]).only()) / rms(&without);
        let axis = &self.of.axis;
        let force = axis.limit_v * self.of.record.force_per_volt.abs();
        let (coulomb, travel) = (axis.base[2], self.of.record.travel());
        let values = start.values(&linear);
        let lost = plausible_on_axis(start.term, &values, coulomb, force, travel)
            .err()
            .or((fall < MATERIAL_OF_ERROR).then_some(TOO_LITTLE))
            .or_else(|| {
                let of_both = Evidence::of_both([on_fit[0], on_fit[1]]);
                of_both.on_fit(start.best_of()).err()
            })
            .or_else(|| Evidence::new(&alone(rest), effect).borne_out().err());
        Judged {
            start,
            linear,
            fall,
            lost,
        }
    }
}

/// Some rows of a signal.
fn cut(values: &[f64], rows: &[usize]) -> Column {
    Column::alone(rows.iter().map(|&row| values[row]).collect())
}

/// A regression without columns, of one operating point.
fn alone(target: Column) -> Normal {
    let whole = std::iter::once(0..target.only().len()).collect();
    Normal::new(target, &whole)
}

/// Everything that was tried on a record, in the order in which the terms that were taken belong into the model.
pub fn search(axis: &Axis, record: &Record) -> Vec<Trial> {
    let record = &record.first((LENGTH_S * record.rate) as usize);
    let folds = folds(record);
    let all: Vec<usize> = (MARGIN..record.len() - MARGIN).collect();
    let mut axis = fitted(axis, record, Free::Model, &all);
    let mut taken: Vec<Trial> = Vec::new();
    let mut lost: Vec<Trial>;
    let of = |judged: &Judged| Trial {
        term: judged.start.term,
        fall: judged.fall,
        lost: judged.lost,
    };
    loop {
        let search = Search::new(Linearised::new(axis.clone(), record), &folds);
        let has = |term: &Term| axis.find(*term).is_none();
        let order = strongest_order(&axis, record, &folds).filter(|_| axis.orders().len() < MOST);
        // A whole order is the simpler one; a few turns hardly tell it from one beside it.
        let whole = order.and_then(|term| match term {
            Term::Periodic(order) if order.fract() != 0.0 => (order.round() >= 1.0
                && (order - order.round()).abs() < NEAR_WHOLE)
                .then_some(Term::Periodic(order.round())),
            _ => None,
        });
        let candidates = TERMS.into_iter().filter(has).chain(order).chain(whole);
        let judged = candidates.filter_map(|term| search.best(term, &folds));
        let mut judged: Vec<Judged> = judged.collect();
        judged.sort_by(|a, b| b.fall.total_cmp(&a.fall));
        lost = judged.iter().filter(|j| j.lost.is_some()).map(of).collect();
        let Some(best) = judged.iter().find(|judged| judged.lost.is_none()) else {
            break;
        };
        taken.push(of(best));
        let values = best.start.values(&best.linear);
        axis.terms.push((best.start.term, values));
        axis = fitted(&axis, record, Free::Model, &all);
    }
    // What was taken early may be what later ones are.
    for k in (0..taken.len().saturating_sub(1)).rev() {
        let mut without = axis.clone();
        without.terms.retain(|(known, _)| *known != taken[k].term);
        let without = fitted(&without, record, Free::Model, &all);
        let search = Search::new(Linearised::new(without.clone(), record), &folds);
        let Some(judged) = search.best(taken[k].term, &folds) else {
            continue;
        };
        if judged.lost.is_some() {
            lost.push(of(&judged));
            taken.remove(k);
            axis = without;
        }
    }
    // Orders last: their phase belongs to a record.
    taken.sort_by_key(|trial| matches!(trial.term, Term::Periodic(_)));
    taken.extend(lost);
    taken
}

/// The order per turn of the screw at which the error is strongest and that the model does not have yet.
fn strongest_order(axis: &Axis, record: &Record, folds: &[Vec<usize>; 2]) -> Option<Term> {
    let measured = butterworth_100(&record.force(), record.rate);
    let mut rows: Vec<(f64, f64, f64)> = Vec::new();
    let run = axis.simulate(record);
    let simulated = butterworth_100(&run.force, record.rate);
    for fold in folds {
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
    ORDERS
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
    use crate::machines::feed_axis::Law;
    use crate::regression::sandwich::tests::coloured;

    /// The record of an axis without further terms, under white and coloured noise of the force.
    #[test]
    fn a_clean_axis_has_no_further_terms() {
        let axis = Axis {
            law: Law::Difference(2),
            ..Axis::published()
        };
        let clean = record(&axis, [2.0, -3.0, 1.2, -0.7]);
        for (seed, kept) in [(1, 0.0), (2, 0.9), (3, 0.0), (4, 0.9), (5, 0.9)] {
            let noise = coloured(seed, clean.len(), kept);
            let noisy = clean.with_force(|row| 0.7 * noise[row]);
            let trials = search(&axis, &noisy);
            let taken: Vec<&Trial> = trials.iter().filter(|trial| trial.lost.is_none()).collect();
            assert!(
                taken.is_empty(),
                "seed {seed}, {kept} kept: expected none, {taken:?}"
            );
        }
    }

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
        let found = strongest_order(&axis, &record, &[rows.clone(), rows]);
        // 100 Hz at 10 turns a second.
        assert!(
            !matches!(found, Some(Term::Periodic(order)) if order > 10.5),
            "{found:?}"
        );
    }
}
