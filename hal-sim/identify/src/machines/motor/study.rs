//! The current of a motor by inertia, friction, the orders of its turn, and the filter by which it is reported late: the
//! regression, covariance and criterion of all machines on one channel.

use super::columns::{Base, Columns};
use super::fit::{Both, Fit, rms};
use super::left::remnants;
use super::orders::{Order, of_map};
use super::record::Record;
use crate::conclusion::rest::Remnant;
use crate::effects::limits::{ABOVE_BAND, NOT_TURNED};
use crate::predict::basis::{Along, At};
use crate::predict::curve::Curve;
use crate::predict::excitation::Excitation;
use crate::predict::judge::{Judged, Known, LEAST_BLOCKS, Side, judge};
use crate::predict::orders::loudest_orders;
use crate::regression::column::{Column, counted};
use crate::regression::normal::Prior;
use crate::search::forward::{Choice, Contender, Forward, search};
use crate::search::holdout::{Holdout, Validated};
use crate::search::selection::{MATERIAL_OF_CURRENT, MOST_NAMES, VOUCHED_OF_CURRENT};
use crate::signal::fourier::slope;
use crate::signal::noise::white_below_100;

/// Highest order that is looked for: what 100 Hz leave at a turn in 1.3 s.
const HIGHEST: u32 = 130;
/// Time constants of a lag that are tried: none, and from one period of the record up to here by this factor, s; and how
/// finely the best is followed.
const LONGEST_LAG_S: f64 = 0.5;
const NEXT_LAG: f64 = 2.0;
const FINER: [f64; 4] = [0.35, 0.17, 0.08, 0.04];
/// How often orders are looked for again beside a lag that was followed.
const MOST_ROUNDS: usize = 3;
/// Delays that are tried, rows: of a log and of a control period.
const DELAYS_ROWS: [f64; 4] = [1.0, 2.0, 4.0, 8.0];
/// A named lag in rows of the record; delays beside which it is held, in lags; share of their squares that it must leave.
const LAG_ROWS: f64 = 3.0;
const DELAYS_OF_LAG: [f64; 5] = [0.3, 0.5, 0.7, 0.85, 1.0];
const RIVAL: f64 = 0.5;
/// Standard deviation of a lag that is named, of it; and share of the current's rms that is left then.
const WELL_TOLD: f64 = 0.2;
const LITTLE_LEFT: f64 = 0.1;
/// Orders that are fitted beside a lag, and rows for each.
const BESIDE_LAG: u32 = 40;
const ROWS_PER_ORDER: usize = 24;
/// Share by which a width of friction must lower the fit record's square error to be taken for a narrower one.
const LEAST_WIDTH: f64 = 0.02;
/// Share by which a lag must lower the check record's square error.
const LEAST_LAG: f64 = 0.1;

/// A first-order filter on the current that is reported.
#[derive(Debug, Clone, Copy)]
pub struct Lag {
    /// Time constant, s, and its standard deviation; below 0 a delay of as much.
    pub value_s: [f64; 2],
    /// Share of the check record's square that it takes beside the orders.
    pub explained: f64,
    /// Whether it is named: the record tells it well, and with it little is left. Otherwise it is a nuisance that may stand for
    /// any smooth misfit.
    pub is_named: bool,
}

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

/// What the orders explain of a motor's current.
pub struct Study {
    /// Orders, the strongest first.
    pub orders: Vec<Order>,
    /// Columns ahead of the orders' in [`Fit::values`].
    pub base: Vec<Base>,
    /// What the records do not tell apart, and why.
    pub not_told_apart: Vec<(Base, &'static str)>,
    /// Of a current that is reported late.
    pub lag: Option<Lag>,
    /// The orders as the fit record has them where they are free, whole or not, and their variances.
    pub freed: Vec<[f64; 2]>,
    /// Share of the check record's square, beyond noise, that each order takes.
    pub explained: Vec<f64>,
    /// Inertia and friction only.
    pub before: Fit,
    /// With the orders and the lag.
    pub after: Fit,
    /// Filtered current of fit and check record, A.
    pub current: [Vec<f64>; 2],
    /// Angles of the same rows, rad.
    pub position: [Vec<f64>; 2],
    /// Which of the rows count: of the check record those at which its regressors are not outside of the fit record's.
    pub open: [Vec<bool>; 2],
    /// Rate of the fit record's rows, Hz.
    pub rate: f64,
    /// What the current's sensor alone leaves of the check record after the filter, A.
    pub noise: f64,
    /// Bandwidth of the rows, Hz.
    pub band_hz: f64,
    /// Speeds of the same rows, rad/s.
    pub velocity: [Vec<f64>; 2],
    /// With the curve that predicts the residual; as `after` where none does.
    pub curved: Fit,
    /// That curve, part by part.
    pub curves: Vec<Curve>,
    /// Whether something predicts the residual within the check record and does not carry over from the fit record.
    pub does_not_carry: bool,
    /// Whether the records are long enough for a judgement of what predicts the rest.
    pub is_judged: bool,
    /// Speed over which friction changes its sign, rad/s: a nuisance, fitted.
    pub width_rad_s: f64,
    /// What the check record excites.
    pub(crate) excitation: Excitation,
    /// Candidates that lost.
    pub lost: Vec<Lost>,
    /// Candidates tried.
    pub tried: usize,
    /// Orders that were not, and why.
    pub not_tried: (usize, &'static str),
    /// What the orders leave of both records above it.
    pub remnants: Vec<Remnant>,
}

/// Whether a lag is named: the record tells it well, little is left with it, it is longer than what sampling makes, and a
/// delay of any such time leaves more.
fn is_lag(
    records: [&Columns; 2],
    base: &[Base],
    orders: &[u32],
    late: [f64; 2],
    after: &Fit,
) -> bool {
    let [value, sigma] = late;
    let told = value > 0.0 && sigma < WELL_TOLD * value && value < 0.9 * LONGEST_LAG_S;
    let little = rms(&after.left[1]) < LITTLE_LEFT * rms(&records[1].current());
    if !told || !little || value < LAG_ROWS / records[0].sample_hz() {
        return false;
    }
    let square = |late: f64| Both::new(records, base, orders, late).squares()[0];
    let rivals = DELAYS_OF_LAG.map(|share| square(-share * value));
    square(value) < RIVAL * rivals.into_iter().fold(f64::INFINITY, f64::min)
}

/// The lag with which inertia, friction and orders, fitted together, predict the check record best.
fn lag(records: [&Columns; 2], base: &[Base], orders: &[u32], lags_s: &[f64]) -> f64 {
    let square = |lag_s: f64| Both::new(records, base, orders, lag_s).squares()[1];
    let tried: Vec<(f64, f64)> = lags_s.iter().map(|lag| (square(*lag), *lag)).collect();
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

/// White noise of the quietest stretch after the filter.
fn noise(records: &[Record]) -> f64 {
    let of = |record: &Record| white_below_100(&record.current, record.rate);
    records.iter().map(of).fold(f64::INFINITY, f64::min)
}

/// The width of the friction with which inertia, friction and offset leave the smallest residual of the fit record, rad/s; both records get
/// it.
fn widen(fitted: &mut Columns, other: &mut Columns) -> f64 {
    let narrow = fitted.widths();
    let mut best = (f64::INFINITY, narrow.first().copied().unwrap_or(1e-9));
    for width in narrow {
        fitted.set_width(width);
        let base = [Base::Inertia, Base::Offset, Base::Coulomb, Base::Viscous];
        let both = Both::new([fitted, fitted], &base, &[], 0.0);
        let square = both.squares()[0];
        // A wider one must be worth it.
        if square < (1.0 - LEAST_WIDTH) * best.0 {
            best = (square, width);
        }
    }
    fitted.set_width(best.1);
    other.set_width(best.1);
    best.1
}

/// What predicts the check record beside inertia, friction, orders, and a small delay of the current.
fn judged(records: [&Columns; 2], last: &Both, after: &Fit, orders: &[u32], lag_s: f64) -> Judged {
    let side = |k: usize| {
        let record = records[k];
        let current = record.current();
        let stretches = record.stretches();
        let fitted: Vec<f64> = current
            .iter()
            .zip(&after.left[k])
            .map(|(i, left)| i - left)
            .collect();
        // A delay adds the derivative of what is fitted, to first order.
        let late = stretches.iter().flat_map(|rows| match rows.len() > 2 {
            true => slope(&fitted[rows.clone()], record.rate()),
            false => vec![0.0; rows.len()],
        });
        let open = record.open();
        let late = late
            .zip(&open)
            .map(|(x, open)| x * f64::from(*open))
            .collect();
        let known = last.columns[k]
            .iter()
            .map(|column| Known::free(column.only().to_vec()));
        Side {
            left: after.left[k].clone(),
            known: known.chain([Known::free(late)]).collect(),
            at: record.at(),
            drive_rms: rms(&current),
            rate: record.rate(),
            open,
            stretches,
        }
    };
    let sides = [side(0), side(1)];
    let highest = records
        .map(Columns::highest_order)
        .into_iter()
        .min()
        .unwrap_or(0);
    let further = loudest_orders(&sides[0], highest);
    let named = |along| matches!(along, Along::Order(order) if orders.iter().any(|known| f64::from(*known) == order));
    judge(
        [&sides[0], &sides[1]],
        highest,
        &further,
        |along| !named(along),
        |k, group, function| records[k].shown(lag_s, |at| group.value(function, at)),
    )
}

impl Study {
    /// Fits on `estimate`, checks on `check`. The candidates are all orders that the filter leaves at the
    /// records' speeds; those of the slow turn `map` (position, current) need less proof.
    pub fn new(estimate: &Record, check: &Record, map: Option<&[Vec<f64>; 2]>) -> Self {
        Self::of_stretches([estimate, check].map(std::slice::from_ref), map)
    }

    /// The same of records of several stretches each, all at one rate.
    pub fn of_stretches([estimate, check]: [&[Record]; 2], map: Option<&[Vec<f64>; 2]>) -> Self {
        let rate = estimate.first().map_or(1.0, |first| first.rate);
        let lags = std::iter::successors(Some(1.0 / rate), |lag| Some(NEXT_LAG * lag));
        let lags_s: Vec<f64> = std::iter::once(0.0)
            .chain(lags.take_while(|lag| *lag < LONGEST_LAG_S))
            .collect();
        let delays = DELAYS_ROWS.map(|rows| -rows / rate);
        let nuisances: Vec<f64> = lags_s.iter().copied().chain(delays).collect();
        let mut sides = [Columns::new(estimate), Columns::new(check)];
        // Of inertia alone: records at other speeds are what friction and orders are checked by.
        let [fitted, other] = &mut sides;
        other.close_beyond(fitted, &Base::ALWAYS, &lags_s);
        let width_rad_s = widen(fitted, other);
        let records = [&sides[0], &sides[1]];
        let mut base = Base::ALWAYS.to_vec();
        let (mut frictions, mut not_told_apart) = records[0].told_apart();
        let take = |base: &mut Vec<Base>, frictions: &mut Vec<Base>, orders: &[u32], lag_s| {
            let mut lost = Vec::new();
            frictions.retain(|friction| {
                base.push(*friction);
                let has = Both::new(records, base, orders, lag_s).has_friction();
                if let Err(reason) = has {
                    base.pop();
                    lost.push((*friction, reason));
                }
                has.is_err()
            });
            lost
        };
        let lost = take(&mut base, &mut frictions, &[], 0.0);
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
        let mut candidates: Vec<u32> = vouched.iter().copied().chain(others).collect();
        let all = candidates.len();
        candidates.retain(|order| turned && *order <= shown);
        let vouched = candidates.iter().filter(|k| vouched.contains(k)).count();
        let reason = if turned { ABOVE_BAND } else { NOT_TURNED };
        let rows = records[0].current().len();
        let most = highest.min(BESIDE_LAG).min((rows / ROWS_PER_ORDER) as u32);
        let lowest: Vec<u32> = (1..=most).collect();
        let at_lag = |base: &[Base], late: f64| {
            let both = Both::new(records, base, &candidates, late);
            let mut orders = Orders {
                with: both.regression(0..both.base),
                both: &both,
                candidates: &candidates,
                vouched,
                // The lag is a name too.
                most: MOST_NAMES - usize::from(late > 0.0),
                taken: Vec::new(),
                lost: Vec::new(),
            };
            search(&mut orders);
            let falls = orders.taken.iter().map(|k| {
                let ([before, after], _) = orders.judged(*k, &orders.without(*k));
                (candidates[*k], before - after)
            });
            (late, falls.collect::<Vec<_>>(), orders.lost)
        };
        let orders =
            |taken: &[(u32, f64)]| taken.iter().map(|(order, _)| *order).collect::<Vec<u32>>();
        let search_in = |base: &[Base]| {
            let found = at_lag(base, lag(records, base, &lowest, &nuisances));
            // Higher orders that were found may tell another lag.
            match lag(records, base, &orders(&found.1), &nuisances) {
                same if same == found.0 => found,
                other => at_lag(base, other),
            }
        };
        let (mut late, mut taken, mut lost_orders) = search_in(&base);
        // Orders that were in the way of a friction are known now.
        let known = base.len();
        let lost = match taken.is_empty() {
            true => lost,
            false => take(&mut base, &mut frictions, &orders(&taken), late),
        };
        not_told_apart.extend(lost);
        if base.len() > known {
            (late, taken, lost_orders) = search_in(&base);
        }
        let mut numbers = orders(&taken);
        let mut late = [late, 0.0];
        // Between two lags that were tried, the residual is the lag's error: weak orders show beside the right one.
        for _ in 0..MOST_ROUNDS {
            if late[0] == 0.0 {
                break;
            }
            late = followed(records, &base, &numbers, late[0]);
            let again = at_lag(&base, late[0]);
            if orders(&again.1) == numbers {
                break;
            }
            (_, taken, lost_orders) = again;
            numbers = orders(&taken);
        }
        let last = Both::new(records, &base, &numbers, late[0]);
        let plain = last.fit(Vec::new()).0;
        // What the record alone says of the orders: each moves by a Gauss-Newton step, all of them and the other
        // parameters together.
        let slopes = numbers.iter().enumerate().map(|(k, order)| {
            let at = base.len() + 2 * k;
            let wave = [plain.values[at], plain.values[at + 1]];
            Column::alone(records[0].slope_by_order(*order, wave, late[0]))
        });
        let (after, steps) = last.fit(slopes.collect());
        let is_named = is_lag([records[0], records[1]], &base, &numbers, late, &after);
        // A nuisance is no name: it is there before.
        let before = Both::new(records, &base, &[], if is_named { 0.0 } else { late[0] });
        let before = before.fit(Vec::new()).0;
        let of_check = rms(&before.left[1]).powi(2);
        let lag = (late[0] != 0.0).then(|| {
            let without = Both::new(records, &base, &numbers, 0.0).squares()[1];
            Lag {
                value_s: late,
                is_named,
                explained: ((without - rms(&after.left[1]).powi(2)) / of_check).clamp(0.0, 1.0),
            }
        });
        let amplitude = |k: usize| {
            let at = base.len() + 2 * k;
            after.values[at].hypot(after.values[at + 1])
        };
        let orders: Vec<Order> = numbers
            .iter()
            .enumerate()
            .map(|(k, order)| Order {
                order: *order,
                amplitude_a: amplitude(k),
            })
            .collect();
        let noises = [estimate, check].map(noise);
        let position = records.map(Columns::position);
        let judged = judged(records, &last, &after, &numbers, late[0]);
        let curves = judged.curves();
        let curved = Fit {
            left: match judged.carries {
                true => [0, 1].map(|k: usize| {
                    let rows = after.left[k].iter().zip(&judged.predicted[k]);
                    rows.map(|(left, by)| left - by).collect()
                }),
                false => after.left.clone(),
            },
            ..after.clone()
        };
        let excitation = {
            let open = records[1].open();
            let rows = records[1].at().into_iter().zip(open);
            let counted: Vec<At> = rows.filter(|(_, open)| *open).map(|(at, _)| at).collect();
            Excitation::new(&counted, records[1].rate())
        };
        Study {
            width_rad_s,
            band_hz: records[1].band_hz(),
            excitation,
            does_not_carry: judged.own,
            is_judged: judged.blocks >= LEAST_BLOCKS,
            curves,

            freed: numbers
                .iter()
                .zip(steps)
                .map(|(order, [step, variance])| [f64::from(*order) + step, variance])
                .collect(),
            explained: taken.iter().map(|(_, fall)| fall / of_check).collect(),
            remnants: remnants(
                &after,
                [&position[0], &position[1]],
                records.map(Columns::open),
                records[0].rate(),
                noises[0].max(noises[1]),
                shown,
            ),
            curved,
            velocity: records.map(Columns::velocity),
            orders,
            base,
            not_told_apart,
            lag,
            before,
            after,
            rate: records[0].rate(),
            noise: noises[1],
            current: records.map(Columns::current),
            position,
            open: records.map(Columns::open),
            lost: lost_orders,
            tried: candidates.len(),
            not_tried: (all - candidates.len(), reason),
        }
    }

    /// Current error of a fit on the check record, of its rms, %.
    fn percent(&self, fit: &Fit) -> f64 {
        100.0 * rms(&fit.left[1]) / rms(&self.current[1])
    }

    /// Rms of what a fit leaves of the rows of a record that count, A.
    pub fn left_rms(&self, fit: &Fit, record: usize) -> f64 {
        let rows = counted(&self.open[record]).max(1) as f64;
        rms(&fit.left[record]) * (fit.left[record].len() as f64 / rows).sqrt()
    }

    /// Rms of the current of the rows of a record that count, A.
    pub fn signal_rms(&self, record: usize) -> f64 {
        let rows = counted(&self.open[record]).max(1) as f64;
        rms(&self.current[record]) * (self.current[record].len() as f64 / rows).sqrt()
    }

    /// Without the orders, %.
    pub fn before_percent(&self) -> f64 {
        self.percent(&self.before)
    }

    /// With them, %.
    pub fn after_percent(&self) -> f64 {
        self.percent(&self.after)
    }

    /// With the curve too, %.
    pub fn curved_percent(&self) -> f64 {
        self.percent(&self.curved)
    }
}

/// Turns that a record must cover for its orders to be looked for.
const LEAST_TURNS: f64 = 0.75;

/// A search for orders, which are counted among the candidates.
struct Orders<'a> {
    both: &'a Both,
    candidates: &'a [u32],
    /// How many of them, the first, a slow turn of the same motor has.
    vouched: usize,
    /// Orders at most, where nothing vouches for more.
    most: usize,
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
        let stands = validated.stands(self.candidates.len(), least);
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
