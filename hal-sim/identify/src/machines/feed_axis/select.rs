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
use crate::regression::column::Column;
use crate::regression::normal::Prior;
use crate::search::forward::{Choice, Contender, Forward, search};
use crate::search::holdout::{Holdout, Validated};
use crate::search::selection::{
    MATERIAL_OF_ERROR, MATERIAL_OF_FORCE, MATERIAL_ORDER_OF_FORCE, TOO_LITTLE,
};
use crate::signal::filter::butterworth_100;
use crate::signal::leftover::{Over, Residual};
use crate::signal::signals::mean_square;
use std::f64::consts::TAU;

/// Orders at most.
const MOST: usize = 8;
/// Length of record that a search uses, s: a lap or two of a programme; the fit that follows uses all of it.
const LENGTH_S: f64 = 12.5;
/// What the filter of the force leaves, Hz.
const BAND_HZ: f64 = 100.0;
/// Share of the rows that must show an order.
const LEAST_SHOWN: f64 = 0.1;
/// Orders per turn that are looked for, how far apart, and how near to a whole one they are that.
const ORDERS: std::ops::Range<f64> = 0.7..45.0;
const APART: f64 = 0.3;
const WHOLE: f64 = 0.015;
/// How near to a whole order one is tried as whole, too.
const NEAR_WHOLE: f64 = 0.1;
/// Orders of which the strongest is taken: as far apart as some turns tell them.
const CANDIDATES: usize = 4500;
/// Slower an axis rests, m/s.
const MOVES_M_PER_S: f64 = 5e-3;
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
/// Half waves of a shape over the travel at most, and how many more a step adds.
const MOST_HALF_WAVES: usize = 16;
const STEP_OF_HALF_WAVES: usize = 2;
/// Blocks of rows by which corrections are cross-validated, s: several times what a loop of 100 Hz is correlated over.
const BLOCK_S: f64 = 0.25;

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

/// A model linearised about its parameters, N and N per scale, filtered.
struct Linearised<'a> {
    axis: Axis,
    record: &'a Record,
    folds: &'a [Vec<usize>; 2],
    force: Vec<f64>,
    /// Rms of the force that a term must explain, N: an order of the turn, and any other.
    material_n: [f64; 2],
    /// Its parameters fitted on either fold and compared with the other.
    holdouts: [Holdout; 2],
}

impl<'a> Linearised<'a> {
    fn new(axis: Axis, record: &'a Record, folds: &'a [Vec<usize>; 2], shares: [f64; 2]) -> Self {
        let measured = butterworth_100(&record.force(), record.rate);
        let force = simulated(&axis, record);
        let own = axis.parameters();
        let column = |k: usize| {
            let (beside, step) = beside(&own, k);
            difference(&simulated(&axis.with(&beside), record), &force, step)
        };
        let parameters: Vec<Vec<f64>> = (0..own.len()).map(column).collect();
        let left = difference(&measured, &force, 1.0);
        let rms = mean_square(&measured).sqrt();
        let holdouts = SIDES.map(|sides| {
            let mut holdout = Holdout::new(sides.map(|fold| cut(&left, &folds[fold])));
            let columns = sides.map(|fold| cut_all(&parameters, &folds[fold]));
            holdout.extend(columns.each_ref());
            holdout
        });
        Linearised {
            axis,
            record,
            folds,
            force,
            material_n: shares.map(|share| share * rms),
            holdouts,
        }
    }

    /// What a further term with given parameters adds, per `by` of them.
    fn column(&self, term: Term, values: Vec<f64>, by: f64) -> Vec<f64> {
        let mut axis = self.axis.clone();
        axis.terms.push((term, values));
        difference(&simulated(&axis, self.record), &self.force, by)
    }

    /// What a further term adds per unit of its linear parameters. One that is not linear is its whole difference.
    fn further(&self, start: &Start) -> Vec<Vec<f64>> {
        let with = |values: Vec<f64>, by: f64| self.column(start.term, values, by);
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
            Term::Periodic(_) => CANDIDATES,
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

/// A term that was fitted on either fold and compared with the other one.
#[derive(Clone)]
struct Judged {
    start: Start,
    validated: Validated,
    stands: Result<(), &'static str>,
}

impl Judged {
    fn trial(&self) -> Trial {
        Trial {
            term: self.start.term,
            fall: self.validated.fall(),
            lost: self.stands.err(),
        }
    }
}

impl Linearised<'_> {
    /// The best of the shapes that a term may have.
    fn best(&self, term: Term) -> Option<Judged> {
        let judged = Start::all(term).into_iter().map(|start| self.judged(start));
        judged.max_by(|a, b| {
            let stands = |judged: &Judged| judged.stands.is_ok();
            let fall = |judged: &Judged| judged.validated.fall();
            (stands(a).cmp(&stands(b))).then(fall(a).total_cmp(&fall(b)))
        })
    }

    /// Columns fitted on either fold and compared with the other one.
    fn validated(&self, columns: &[Vec<f64>], prior: Prior) -> Validated {
        let columns = [0, 1].map(|fold: usize| cut_all(columns, &self.folds[fold]));
        let sides = SIDES.map(|sides| sides.map(|fold| columns[fold].as_slice()));
        Validated::new(self.holdouts.iter().zip(sides), prior)
    }

    fn judged(&self, start: Start) -> Judged {
        let further = self.further(&start);
        let prior = match start.term {
            // Its column is the whole difference to a jump: it is there or it is not.
            Term::Presliding => Prior::fixed(1.0),
            _ => Prior::FREE,
        };
        let validated = self.validated(&further, prior);
        let values = start.values(&validated.values);
        let [order_n, other_n] = self.material_n;
        let least_n = match start.term {
            Term::Periodic(_) => order_n,
            _ => other_n,
        };
        let stands = plausible_on_axis(start.term, &values, &self.axis, self.record)
            .and_then(|()| validated.stands(start.best_of(), MATERIAL_OF_ERROR))
            .and_then(|()| match validated.explained_rms() > least_n {
                true => Ok(()),
                false => Err(TOO_LITTLE),
            });
        Judged {
            start,
            validated,
            stands,
        }
    }
}

/// The fold that is fitted, and the one that is not.
const SIDES: [[usize; 2]; 2] = [[0, 1], [1, 0]];

/// Some rows of a signal.
fn cut(values: &[f64], rows: &[usize]) -> Column {
    Column::alone(rows.iter().map(|&row| values[row]).collect())
}

fn cut_all(columns: &[Vec<f64>], rows: &[usize]) -> Vec<Column> {
    columns.iter().map(|column| cut(column, rows)).collect()
}

/// Shares of the force that a term must explain of a record that does not tell its own noise.
const MATERIAL: [f64; 2] = [MATERIAL_ORDER_OF_FORCE, MATERIAL_OF_FORCE];

/// A search for the terms of an axis.
struct Terms<'a> {
    /// See [`MATERIAL`].
    shares: [f64; 2],
    record: &'a Record,
    folds: &'a [Vec<usize>; 2],
    rows: &'a [usize],
    axis: Axis,
    taken: Vec<Trial>,
    lost: Vec<Trial>,
    /// With which the fit came to parameters beyond physics.
    refused: Vec<Trial>,
}

impl Forward for Terms<'_> {
    type Trial = Judged;

    fn contenders(&mut self) -> Vec<Contender<Judged>> {
        let axis = &self.axis;
        let here = Linearised::new(axis.clone(), self.record, self.folds, self.shares);
        let order = strongest_order(axis, self.record);
        let order = order.filter(|_| axis.orders().len() < MOST);
        // A whole order is the simpler one; a few turns hardly tell it from one beside it.
        let whole = order.and_then(|term| match term {
            Term::Periodic(order) if order.fract() != 0.0 => (order.round() >= 1.0
                && (order - order.round()).abs() < NEAR_WHOLE)
                .then_some(Term::Periodic(order.round())),
            _ => None,
        });
        let open = |term: &Term| {
            axis.find(*term).is_none() && !self.refused.iter().any(|tried| tried.term == *term)
        };
        let judged = TERMS.into_iter().chain(order).chain(whole).filter(open);
        let judged = judged.filter_map(|term| here.best(term));
        let contender = |trial: Judged| Contender {
            credit: trial.validated.fall(),
            trial,
        };
        judged.map(contender).collect()
    }

    /// All of them: each was fitted and judged by then.
    fn most_contenders(&self) -> usize {
        usize::MAX
    }

    fn weighed(&self, judged: &Contender<Judged>) -> (f64, Result<(), &'static str>) {
        (judged.credit, judged.trial.stands)
    }

    fn take(&mut self, choice: Choice<Judged>, _: &[Contender<Judged>]) -> bool {
        let doubtful = choice.doubtful.iter();
        self.lost = doubtful.map(|(lost, _)| lost.trial.trial()).collect();
        let Some((_, trial)) = choice.best else {
            return false;
        };
        let values = trial.start.values(&trial.validated.values);
        let mut with = self.axis.clone();
        with.terms.push((trial.start.term, values));
        let with = fitted(&with, self.record, Free::Model, self.rows);
        let plausible = |(term, values): &(Term, Vec<f64>)| {
            plausible_on_axis(*term, values, &with, self.record).err()
        };
        let mut tried = trial.trial();
        tried.lost = with.terms.iter().find_map(plausible);
        match tried.lost {
            Some(_) => self.refused.push(tried),
            None => {
                self.taken.push(tried);
                self.axis = with;
            }
        }
        true
    }

    /// What was taken early may be what later ones are.
    fn reconsider(&mut self) -> bool {
        let before = self.taken.len();
        for k in (0..before.saturating_sub(1)).rev() {
            let term = self.taken[k].term;
            let mut without = self.axis.clone();
            without.terms.retain(|(known, _)| *known != term);
            let without = fitted(&without, self.record, Free::Model, self.rows);
            let here = Linearised::new(without.clone(), self.record, self.folds, self.shares);
            let judged = here.best(term);
            if let Some(judged) = judged.filter(|judged| judged.stands.is_err()) {
                self.lost.push(judged.trial());
                self.taken.remove(k);
                self.axis = without;
            }
        }
        self.taken.len() < before
    }
}

/// Everything that was tried on a record, in the order in which the terms that were taken belong into the model. Whether it
/// `tells_noise`, as a programme that repeats does.
pub(super) fn tried(axis: &Axis, record: &Record, tells_noise: bool) -> Vec<Trial> {
    let record = &record.first((LENGTH_S * record.rate) as usize);
    let rows: Vec<usize> = (MARGIN..record.len() - MARGIN).collect();
    let mut terms = Terms {
        shares: match tells_noise {
            true => [0.0; 2],
            false => MATERIAL,
        },
        axis: fitted(axis, record, Free::Model, &rows),
        folds: &folds(record),
        rows: &rows,
        taken: Vec::new(),
        lost: Vec::new(),
        refused: Vec::new(),
        record,
    };
    search(&mut terms);
    // Orders last: their phase belongs to a record.
    let mut taken = terms.taken;
    taken.sort_by_key(|trial| matches!(trial.term, Term::Periodic(_)));
    taken.extend(terms.lost.into_iter().chain(terms.refused));
    taken
}

/// Corrections for which no hypothesis stands: the force per volt by direction, and load and friction over the travel with as many half
/// waves as lower the error most on what they are not fitted to. A travel's parts have an operating point each, which folds of
/// operating points would make extrapolate; these are of blocks in time, longer than the residual is correlated (h-block
/// cross-validation; Burman, Chow and Nolan, *Biometrika* 81, 1994).
pub(super) fn corrections(axis: &Axis, record: &Record) -> Option<[Term; 3]> {
    let (from_m, length_m) = record.travelled();
    let shape = |friction, half_waves| Term::Travel {
        friction,
        from_m,
        length_m,
        half_waves,
    };
    let record = &record.first((LENGTH_S * record.rate) as usize);
    let block = (BLOCK_S * record.rate) as usize;
    let rows = MARGIN..record.len() - MARGIN;
    let folds = [0, 1].map(|fold| rows.clone().filter(|row| row / block % 2 == fold).collect());
    let here = Linearised::new(axis.clone(), record, &folds, [0.0; 2]);
    let unit = 0.1 * Term::DirectionGain.scale()[0];
    let mut columns = vec![here.column(Term::DirectionGain, vec![unit], unit)];
    columns.extend((1..=MOST_HALF_WAVES).flat_map(|half_waves| {
        let mut values = vec![0.0; half_waves];
        values[half_waves - 1] = 0.1;
        [false, true].map(|friction| here.column(shape(friction, half_waves), values.clone(), 0.1))
    }));
    let fall = |half_waves: usize| {
        let first = &columns[..=2 * half_waves];
        here.validated(first, Prior::FREE).fall()
    };
    (0..=MOST_HALF_WAVES)
        .step_by(STEP_OF_HALF_WAVES)
        .map(|half_waves| (fall(half_waves), half_waves))
        .filter(|(fall, _)| *fall > MATERIAL_OF_ERROR)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, n)| [Term::DirectionGain, shape(false, n), shape(true, n)])
}

/// The order per turn of the screw at which most is left, of those that the model does not have yet.
fn strongest_order(axis: &Axis, record: &Record) -> Option<Term> {
    // Half of the rows' rate is where the filter ends: a row shows the orders that the filter leaves at its speed.
    let step = ((record.rate / (2.0 * BAND_HZ)) as usize).max(1);
    let rate = record.rate / step as f64;
    let every = |values: Vec<f64>| values.into_iter().step_by(step);
    let positions = butterworth_100(&record.position, record.rate);
    let speeds = every(crate::signal::fourier::slope(&positions, record.rate));
    let turns = TAU / axis.lead_m;
    let angle: Vec<f64> = every(positions).map(|x| turns * x).collect();
    // At speed only: at rest an angle says nothing.
    let speeds: Vec<f64> = speeds.map(|v| turns * v.abs()).collect();
    let open: Vec<bool> = speeds.iter().map(|w| *w > turns * MOVES_M_PER_S).collect();
    let mut moving: Vec<f64> = speeds
        .into_iter()
        .filter(|w| *w > turns * MOVES_M_PER_S)
        .collect();
    moving.sort_by(f64::total_cmp);
    let slow = *moving.get((LEAST_SHOWN * moving.len() as f64) as usize)?;
    let left = every(axis.left(record)).zip(&open);
    let residual = Residual {
        values: &left
            .map(|(x, open)| x * f64::from(*open))
            .collect::<Vec<_>>(),
        open: &open,
        rate,
    };
    let known = axis.orders();
    let over = Over::angle(&angle, ORDERS);
    let spectrum = residual.orders(&over, ORDERS.start..ORDERS.end.min(TAU * BAND_HZ / slow));
    let mut peaks = spectrum.peaks(MOST + 1, APART).into_iter();
    let order = peaks.find(|order| known.iter().all(|other| (order - other).abs() > APART))?;
    let order = residual.sharpest(&over, order);
    let near = (order - order.round()).abs() < WHOLE;
    Some(Term::Periodic(if near { order.round() } else { order }))
}

#[cfg(test)]
mod tests {
    use super::super::fit::tests::{followed, record};
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
            let trials = tried(&axis, &noisy, false);
            let taken: Vec<&Trial> = trials.iter().filter(|trial| trial.lost.is_none()).collect();
            assert!(
                taken.is_empty(),
                "seed {seed}, {kept} kept: expected none, {taken:?}"
            );
        }
    }

    /// A viscosity that grows a little less than the speed is too little of the force for a name, where the record does not tell its
    /// noise: friction repeats no better.
    #[test]
    fn a_term_has_a_name_if_it_is_enough_of_the_force() {
        let clean = Axis {
            law: Law::Difference(2),
            ..Axis::published()
        };
        // Eight strokes of 1.5 s with 0.8 m/s^2.
        let (mut at, mut v) = (0.0, 0.0_f64);
        let rows = (0..12_000).map(|row| {
            let aim = [0.02, -0.02, 0.05, -0.05, 0.1, -0.1, 0.01, -0.01][row / 1500];
            v += (aim - v).clamp(-8e-4, 8e-4);
            at += 1e-3 * v;
            at
        });
        let reference: Vec<f64> = rows.collect();
        let taken = |term: Term, values: Vec<f64>| {
            let mut real = clean.clone();
            real.terms.push((term, values));
            let record = followed(&real, reference.clone(), 1000.0);
            let noise = coloured(7, record.len(), 0.0);
            let noisy = record.with_force(|row| 0.2 * noise[row]);
            let trials = tried(&clean, &noisy, false).into_iter();
            let taken = trials.filter(|trial| trial.lost.is_none());
            taken.map(|trial| trial.term).collect::<Vec<_>>()
        };
        assert_eq!(taken(Term::Presliding, vec![2e6]), [Term::Presliding]);
        assert_eq!(taken(Term::Saturation, vec![300.0]), [Term::Saturation]);
        assert_eq!(taken(Term::Saturation, vec![100.0]), [], "a small rest");
    }

    /// A force per volt that is 3 % more forth and less back, and a load over the travel, of an axis on which no cause is known.
    #[test]
    fn corrections_are_those_of_the_axis_and_a_clean_one_has_none() {
        let clean = Axis {
            law: Law::Difference(2),
            ..Axis::published()
        };
        let strokes = [9.0, -6.0, 5.0, -8.0];
        let mut real = clean.clone();
        let load = Term::Travel {
            friction: false,
            from_m: 0.0,
            length_m: 9.0 * clean.lead_m,
            half_waves: 2,
        };
        real.terms = vec![(Term::DirectionGain, vec![0.03]), (load, vec![0.0, 4.0])];
        let noisy = |axis: &Axis, seed| {
            let record = record(axis, strokes);
            let noise = coloured(seed, record.len(), 0.9);
            record.with_force(|row| 0.7 * noise[row])
        };
        let none = corrections(&clean, &noisy(&clean, 1));
        assert!(none.is_none(), "{none:?}");
        let record = noisy(&real, 2);
        let terms = corrections(&clean, &record).expect("corrections");
        let mut with = clean.clone();
        with.terms.extend(terms.map(|term| (term, term.start())));
        let (from, to) = (4, with.parameters().len());
        let rows: Vec<usize> = (MARGIN..record.len() - MARGIN).collect();
        let found = fitted(&with, &record, Free::Only { from, to }, &rows);
        let gain = found.one(Term::DirectionGain);
        assert!((gain - 0.03).abs() < 6e-3, "{gain}");
        let [load, friction] = [1, 2].map(|k: usize| &found.terms[k].1);
        assert!((load[1] - 4.0).abs() < 0.8, "{load:?}");
        assert!(friction.iter().all(|n| n.abs() < 0.8), "{friction:?}");
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
        let found = strongest_order(&axis, &record);
        // 100 Hz at 10 turns a second.
        assert!(
            !matches!(found, Some(Term::Periodic(order)) if order > 10.5),
            "{found:?}"
        );
    }
}
