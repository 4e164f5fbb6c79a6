//! The search for what a motor's current has beyond its inertia: frictions, a lag, and orders of the turn.

use super::base::Base;
use super::columns::Columns;
use super::fit::{Both, rms};
use super::orders::of_map;
use crate::effects::limits::{ABOVE_BAND, NOT_TURNED};
use crate::regression::normal::Prior;
use crate::search::forward::{Choice, Contender, Forward, search};
use crate::search::holdout::{Holdout, Validated};
use crate::search::selection::{MATERIAL_OF_CURRENT, MOST_NAMES, TOO_LITTLE, VOUCHED_OF_CURRENT};
use crate::signal::noise::SHARE_OF_DRIVE;
use rayon::prelude::*;

/// Highest order that is looked for: what 100 Hz leave at a turn in 1.3 s.
const HIGHEST: u32 = 130;
/// Turns that a record must cover for its orders to be looked for.
const LEAST_TURNS: f64 = 0.75;
/// Time constants of a lag that are tried: none, and from one period of the record up to here by this factor, s; and how
/// finely the best is followed.
pub(super) const LONGEST_LAG_S: f64 = 0.5;
const NEXT_LAG: f64 = 2.0;
const FINER: [f64; 4] = [0.35, 0.17, 0.08, 0.04];
/// How often orders are looked for again beside a lag that was followed.
const MOST_ROUNDS: usize = 3;
/// Delays that are tried, rows: of a log and of a control period.
const DELAYS_ROWS: [f64; 4] = [1.0, 2.0, 4.0, 8.0];
/// Orders that are fitted beside a lag, and rows for each.
const BESIDE_LAG: u32 = 40;
const ROWS_PER_ORDER: usize = 24;
/// Share by which a lag must lower the check record's square error.
const LEAST_LAG: f64 = 0.1;

/// A candidate that was not taken, and why.
#[derive(Debug, Clone)]
pub struct Lost {
    /// The order.
    pub order: u32,
    /// Share of the fit record's square that it would take.
    pub share: f64,
    /// Why.
    pub reason: &'static str,
}

/// No lag, and the time constants of a lag that suit rows at this rate, s.
pub(super) fn lags(rate: f64) -> Vec<f64> {
    let lags = std::iter::successors(Some(1.0 / rate), |lag| Some(NEXT_LAG * lag));
    std::iter::once(0.0)
        .chain(lags.take_while(|lag| *lag < LONGEST_LAG_S))
        .collect()
}

/// The lag with which inertia, friction and orders, fitted together, predict the check record best.
fn lag(records: [&Columns; 2], base: &[Base], orders: &[u32], lags_s: &[f64]) -> f64 {
    let square = |lag_s: f64| Both::new(records, base, orders, lag_s).squares()[1];
    let tried = lags_s.par_iter().map(|lag| (square(*lag), *lag));
    let tried: Vec<(f64, f64)> = tried.collect();
    let best = tried.iter().min_by(|a, b| a.0.total_cmp(&b.0));
    match best {
        Some((least, lag_s)) if *least < (1.0 - LEAST_LAG) * tried[0].0 => *lag_s,
        _ => 0.0,
    }
}

/// Follows a lag to where the orders that were found leave the smallest residual of the fit record.
fn followed(records: [&Columns; 2], base: &[Base], orders: &[u32], start: f64) -> [f64; 2] {
    let way = start.signum();
    let square = |log: f64| Both::new(records, base, orders, way * log.exp()).squares()[0];
    let (mut least, mut at) = (square(start.abs().ln()), start.abs().ln());
    for step in FINER {
        for log in [at - step, at + step] {
            if log > LONGEST_LAG_S.ln() {
                continue;
            }
            let here = square(log);
            if here < least {
                (least, at) = (here, log);
            }
        }
    }
    // Its standard deviation by the curvature, in as many independent rows as the residual's band leaves.
    let beside = 0.1;
    let curvature = (square(at + beside) + square(at - beside) - 2.0 * least) / (beside * beside);
    let rows = records[0].current().len() as f64;
    let relative = match curvature > 0.0 {
        true => (2.0 * least / (rows * curvature)).sqrt(),
        // No minimum: the record does not tell the lag.
        false => f64::INFINITY,
    };
    [way * at.exp(), at.exp() * relative]
}

/// Orders that are looked for.
pub(super) struct Candidates {
    /// The orders; those that a slow turn of the same motor has come first.
    pub(super) orders: Vec<u32>,
    /// How many of the first orders such a turn has.
    vouched: usize,
    /// Low orders that are fitted beside a lag.
    pub(super) lowest: Vec<u32>,
    /// Highest order that both records show.
    pub(super) shown: u32,
    /// How many orders are not tried, and why.
    pub(super) not_tried: (usize, &'static str),
}

impl Candidates {
    /// Of two records, and of a slow turn `map` (position, current) of the same motor.
    pub(super) fn new(records: [&Columns; 2], map: Option<&[Vec<f64>; 2]>) -> Self {
        let shown = records
            .map(Columns::highest_order)
            .into_iter()
            .min()
            .unwrap_or(0);
        let turned = records.iter().all(|record| record.turns() >= LEAST_TURNS);
        let highest = if turned { shown.min(HIGHEST) } else { 0 };
        let vouched: Vec<u32> = map.map_or_else(Vec::new, |[position, current]| {
            let orders = of_map(position, current);
            orders.iter().map(|order| order.order).collect()
        });
        let others = (1..=HIGHEST).filter(|order| !vouched.contains(order));
        let mut orders: Vec<u32> = vouched.iter().copied().chain(others).collect();
        let all = orders.len();
        orders.retain(|order| turned && *order <= shown);
        let rows = records[0].current().len();
        let most = highest.min(BESIDE_LAG).min((rows / ROWS_PER_ORDER) as u32);
        let reason = if turned { ABOVE_BAND } else { NOT_TURNED };
        Candidates {
            vouched: orders.iter().filter(|k| vouched.contains(k)).count(),
            lowest: (1..=most).collect(),
            shown,
            not_tried: (all - orders.len(), reason),
            orders,
        }
    }
}

/// What was found under a lag.
pub(super) struct Found {
    /// The lag, s, and its standard deviation. A lag below 0 is a delay of as much.
    pub(super) late_s: [f64; 2],
    /// The orders, and by how much each lowers the check record's mean square.
    taken: Vec<(u32, f64)>,
    /// Candidates that lost.
    pub(super) lost: Vec<Lost>,
}

impl Found {
    /// The orders, the strongest first.
    pub(super) fn orders(&self) -> Vec<u32> {
        self.taken.iter().map(|(order, _)| *order).collect()
    }

    /// Gives up orders that are not among these.
    pub(super) fn keep(&mut self, told: &[u32]) {
        self.taken.retain(|(order, _)| told.contains(order));
    }

    /// Share of a mean square of the check record that each order takes.
    pub(super) fn shares_of(&self, square: f64) -> Vec<f64> {
        self.taken.iter().map(|(_, fall)| fall / square).collect()
    }
}

/// Frictions, a lag and orders that explain the current.
pub(super) struct Explained {
    /// Columns ahead of the orders'.
    pub(super) base: Vec<Base>,
    /// What the records do not tell apart, and why.
    pub(super) not_told_apart: Vec<(Base, &'static str)>,
    /// The orders and the lag.
    pub(super) found: Found,
}

/// A search in two records.
pub(super) struct Search<'a> {
    records: [&'a Columns; 2],
    candidates: &'a Candidates,
    /// Lags and delays that are tried, s.
    nuisances_s: Vec<f64>,
}

impl<'a> Search<'a> {
    /// Tries these lags, s, and delays of a log of this rate.
    pub(super) fn new(
        records: [&'a Columns; 2],
        candidates: &'a Candidates,
        lags_s: Vec<f64>,
        rate: f64,
    ) -> Self {
        let delays = DELAYS_ROWS.map(|rows| -rows / rate);
        Search {
            records,
            candidates,
            nuisances_s: lags_s.into_iter().chain(delays).collect(),
        }
    }

    /// Looks for frictions first, then for the lag and the orders, and for frictions that the orders hid.
    pub(super) fn explained(&self) -> Explained {
        let mut base = Base::ALWAYS.to_vec();
        let (mut frictions, mut not_told_apart) = self.records[0].told_apart();
        let lost = self.take_frictions(&mut base, &mut frictions, &[], 0.0);
        let mut found = self.found(&base);
        // Orders that were in the way of a friction are known now.
        let known = base.len();
        let orders = found.orders();
        let lost = match orders.is_empty() {
            true => lost,
            false => self.take_frictions(&mut base, &mut frictions, &orders, found.late_s[0]),
        };
        not_told_apart.extend(lost);
        if base.len() > known {
            found = self.found(&base);
        }
        Explained {
            found: self.followed(&base, found),
            base,
            not_told_apart,
        }
    }

    /// Moves frictions that the check record confirms into the base; the others come back with the reason.
    fn take_frictions(
        &self,
        base: &mut Vec<Base>,
        frictions: &mut Vec<Base>,
        orders: &[u32],
        late_s: f64,
    ) -> Vec<(Base, &'static str)> {
        let mut lost = Vec::new();
        frictions.retain(|friction| {
            base.push(*friction);
            let has = Both::new(self.records, base, orders, late_s).has_friction();
            if let Err(reason) = has {
                base.pop();
                lost.push((*friction, reason));
            }
            has.is_err()
        });
        lost
    }

    /// The orders under the lag that predicts best.
    fn found(&self, base: &[Base]) -> Found {
        let best = |orders: &[u32]| lag(self.records, base, orders, &self.nuisances_s);
        let found = self.at_lag(base, best(&self.candidates.lowest));
        // Higher orders that were found may tell another lag.
        match best(&found.orders()) {
            same if same == found.late_s[0] => found,
            other => self.at_lag(base, other),
        }
    }

    /// The orders under a given lag.
    fn at_lag(&self, base: &[Base], late_s: f64) -> Found {
        let Candidates {
            orders, vouched, ..
        } = self.candidates;
        let both = Both::new(self.records, base, orders, late_s);
        let mut of_turn = Orders {
            with: both.regression(0..both.base),
            both: &both,
            candidates: orders,
            vouched: *vouched,
            // The lag is a name too.
            most: MOST_NAMES - usize::from(late_s > 0.0),
            current_rms: rms(both.measured[0].only()),
            taken: Vec::new(),
            lost: Vec::new(),
        };
        search(&mut of_turn);
        let falls = of_turn.taken.iter().map(|k| {
            let ([before, after], _) = of_turn.judged(*k, &of_turn.without(*k));
            (orders[*k], before - after)
        });
        Found {
            late_s: [late_s, 0.0],
            taken: falls.collect(),
            lost: of_turn.lost,
        }
    }

    /// Follows a lag, and looks for the orders again: weak orders show beside the right lag only.
    /// Between two lags that were tried, the residual is the lag's error.
    fn followed(&self, base: &[Base], mut found: Found) -> Found {
        for _ in 0..MOST_ROUNDS {
            let [late_s, _] = found.late_s;
            if late_s == 0.0 {
                break;
            }
            let orders = found.orders();
            found.late_s = followed(self.records, base, &orders, late_s);
            let again = self.at_lag(base, found.late_s[0]);
            if again.orders() == orders {
                break;
            }
            found = Found {
                late_s: found.late_s,
                ..again
            };
        }
        found
    }
}

/// A search for orders, which are counted among the candidates.
struct Orders<'a> {
    both: &'a Both,
    candidates: &'a [u32],
    /// How many of them, the first, a slow turn of the same motor has.
    vouched: usize,
    /// Orders at most, where nothing vouches for more.
    most: usize,
    /// Rms of the fit record's current, A.
    current_rms: f64,
    /// The regression on the base and the orders that were taken.
    with: Holdout,
    taken: Vec<usize>,
    lost: Vec<Lost>,
}

impl Orders<'_> {
    /// The regression on the base and the orders that were taken, but one.
    fn without(&self, own: usize) -> Holdout {
        let others = self.taken.iter().filter(|k| **k != own);
        let pairs = others.flat_map(|k| [0, 1].map(|part| self.both.base + 2 * k + part));
        self.both.regression((0..self.both.base).chain(pairs))
    }

    /// By how much an order lowers the check record's square beside others, before and after, and whether it stands.
    fn judged(&self, own: usize, beside: &Holdout) -> ([f64; 2], Result<(), &'static str>) {
        let validated = Validated::new([(beside, self.both.pair(own))], Prior::FREE);
        let least = match own < self.vouched {
            true => VOUCHED_OF_CURRENT,
            false => MATERIAL_OF_CURRENT,
        };
        let rms = 0.5_f64.sqrt() * validated.values[0].hypot(validated.values[1]);
        let stands = match own < self.vouched || rms > SHARE_OF_DRIVE * self.current_rms {
            true => validated.stands(self.candidates.len(), least),
            false => Err(TOO_LITTLE),
        };
        (validated.squares, stands)
    }

    fn lose(&mut self, own: usize, share: f64, reason: &'static str) {
        let order = self.candidates[own];
        self.lost.push(Lost {
            order,
            share,
            reason,
        });
    }
}

impl Forward for Orders<'_> {
    type Trial = usize;

    /// What each explains is its share of the fit record's square.
    fn contenders(&mut self) -> Vec<Contender<usize>> {
        let fit = &self.with.fit;
        let solution = fit.solve(None);
        let all = fit.cost(&solution.values).max(1e-300);
        let is_open = |k: &usize| {
            !self.taken.contains(k)
                && !self
                    .lost
                    .iter()
                    .any(|lost| lost.order == self.candidates[*k])
                && (self.taken.len() < self.most || *k < self.vouched)
        };
        let open = (0..self.candidates.len()).filter(is_open);
        let contender = |trial| Contender {
            credit: fit.gain(self.both.pair(trial)[0], &solution).fall / all,
            trial,
        };
        open.map(contender).collect()
    }

    fn weighed(&self, own: &Contender<usize>) -> (f64, Result<(), &'static str>) {
        let ([before, after], stands) = self.judged(own.trial, &self.with);
        (own.credit + 1.0 - after / before, stands)
    }

    fn take(&mut self, choice: Choice<usize>, _: &[Contender<usize>]) -> bool {
        for (lost, reason) in choice.doubtful {
            self.lose(lost.trial, lost.credit, reason);
        }
        let best = choice.best.map(|(_, order)| order);
        self.taken.extend(best);
        best.map(|order| self.with.extend(self.both.pair(order)))
            .is_some()
    }

    fn reconsider(&mut self) -> bool {
        let before = self.taken.len();
        for own in self.taken.clone() {
            let without = self.without(own);
            if let (_, Err(reason)) = self.judged(own, &without) {
                self.taken.retain(|k| *k != own);
                self.with = without;
                self.lose(own, 0.0, reason);
            }
        }
        self.taken.len() < before
    }
}
