//! The current of a motor by inertia, friction, the orders of its turn, and the filter by which it is reported late: the
//! regression, covariance and criterion of all machines on one channel.

use super::band::{band_hz, noise};
use super::base::Base;
use super::columns::Columns;
use super::fit::{Both, Fit, rms};
use super::left::remnants;
use super::orders::Order;
use super::record::Record;
use super::search::{Candidates, Explained, LONGEST_LAG_S, Lost, Search, lags};
use crate::conclusion::rest::Remnant;
use crate::predict::basis::{Along, At};
use crate::predict::curve::Curve;
use crate::predict::excitation::Excitation;
use crate::predict::judge::{Judged, LEAST_BLOCKS, judge};
use crate::predict::orders::loudest_orders;
use crate::predict::side::{Known, Side};
use crate::regression::column::{Column, counted};
use crate::regression::sandwich::NORMAL_95;
use crate::signal::fourier::slope;
use rayon::prelude::*;

/// A named lag in rows of the record; delays beside which it is held, in lags; share of their squares that it must leave.
const LAG_ROWS: f64 = 3.0;
const DELAYS_OF_LAG: [f64; 5] = [0.3, 0.5, 0.7, 0.85, 1.0];
const RIVAL: f64 = 0.5;
/// Standard deviation of a lag that is named, of it; and share of the current's rms that is left then.
const WELL_TOLD: f64 = 0.2;
const LITTLE_LEFT: f64 = 0.1;
/// Share by which a width of friction must lower the fit record's square error to be taken for a narrower one.
const LEAST_WIDTH: f64 = 0.02;

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

/// Half of the interval that a free order may have at most: half of the way to the next one.
const HALF_ORDER: f64 = 0.5;

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
    /// What the sensors alone leave of the check record after the filter, A.
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
    let rivals = DELAYS_OF_LAG.par_iter().map(|share| square(-share * value));
    square(value)
        < RIVAL
            * rivals
                .collect::<Vec<_>>()
                .into_iter()
                .fold(f64::INFINITY, f64::min)
}

/// The width of the friction with which inertia, friction and offset leave the smallest residual of the fit record, rad/s; both records get
/// it.
fn widen(fitted: &mut Columns, other: &mut Columns) -> f64 {
    let narrow = fitted.widths();
    let mut best = (f64::INFINITY, narrow.first().copied().unwrap_or(1e-9));
    for width in narrow {
        fitted.set_width(width);
        let both = Both::new([fitted, fitted], &Base::ALL, &[], 0.0);
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
        let columns = last.columns[k].iter();
        let columns = columns.map(|column| column.only().to_vec()).chain([late]);
        Side {
            left: after.left[k].clone(),
            known: columns
                .enumerate()
                .map(|(parameter, column)| Known::free(parameter, column))
                .collect(),
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
    let everywhere = records.map(Columns::everywhere);
    let named = |along| matches!(along, Along::Order(order) if orders.iter().any(|known| f64::from(*known) == order));
    judge(
        [&sides[0], &sides[1]],
        highest,
        &further,
        |along| !named(along),
        |k, group, function| {
            records[k].shown(&everywhere[k], lag_s, |at| group.value(function, at))
        },
    )
}

/// The regressions on what was found.
struct Regressions {
    /// Columns of the base and the orders under the lag.
    last: Both,
    /// Of a current that is reported late.
    lag: Option<Lag>,
    /// Inertia and friction only.
    before: Fit,
    /// With the orders and the lag.
    after: Fit,
    /// By how much each order moves where it is free, and the variance of that.
    steps: Vec<[f64; 2]>,
}

impl Regressions {
    fn new(records: [&Columns; 2], base: &[Base], orders: &[u32], late_s: [f64; 2]) -> Self {
        let [value_s, _] = late_s;
        let last = Both::new(records, base, orders, value_s);
        let plain = last.fit(Vec::new()).0;
        // What the record alone says of the orders: each moves by a Gauss-Newton step, all of them and the other
        // parameters together.
        let slopes = orders.iter().enumerate().map(|(k, order)| {
            let at = base.len() + 2 * k;
            let wave = [plain.values[at], plain.values[at + 1]];
            Column::alone(records[0].slope_by_order(*order, wave, value_s))
        });
        let (after, steps) = last.fit(slopes.collect());
        let is_named = is_lag(records, base, orders, late_s, &after);
        // A nuisance is no name: it is there before.
        let before = Both::new(records, base, &[], if is_named { 0.0 } else { value_s });
        let before = before.fit(Vec::new()).0;
        let lag = (value_s != 0.0).then(|| {
            let without = Both::new(records, base, orders, 0.0).squares()[1];
            let of_check = rms(&before.left[1]).powi(2);
            Lag {
                value_s: late_s,
                is_named,
                explained: ((without - rms(&after.left[1]).powi(2)) / of_check).clamp(0.0, 1.0),
            }
        });
        Regressions {
            last,
            lag,
            before,
            after,
            steps,
        }
    }

    /// Mean square of the check record without the orders.
    fn of_check(&self) -> f64 {
        rms(&self.before.left[1]).powi(2)
    }

    /// The orders that are distinguished from their neighbours. A slow wave over a part of a turn has any order.
    fn told(&self, orders: &[u32]) -> Vec<u32> {
        let pairs = orders.iter().zip(&self.steps);
        let told = pairs.filter(|(_, [_, variance])| NORMAL_95 * variance.sqrt() < HALF_ORDER);
        told.map(|(order, _)| *order).collect()
    }

    /// The orders as the fit record has them where they are free, and their variances.
    fn freed(&self, orders: &[u32]) -> Vec<[f64; 2]> {
        let pairs = orders.iter().zip(&self.steps);
        pairs
            .map(|(order, [step, variance])| [f64::from(*order) + step, *variance])
            .collect()
    }
}

/// A fit with the curve that predicts its residual.
fn curved(after: &Fit, judged: &Judged) -> Fit {
    let left = match judged.carries {
        true => [0, 1].map(|k: usize| {
            let rows = after.left[k].iter().zip(&judged.predicted[k]);
            rows.map(|(left, by)| left - by).collect()
        }),
        false => after.left.clone(),
    };
    Fit {
        left,
        ..after.clone()
    }
}

/// What the rows of a record that count excite.
fn excitation(record: &Columns) -> Excitation {
    let rows = record.at().into_iter().zip(record.open());
    let counted: Vec<At> = rows.filter(|(_, open)| *open).map(|(at, _)| at).collect();
    Excitation::new(&counted, record.rate())
}

impl Study {
    /// Fits on `estimate`, checks on `check`. The candidates are all orders that the filter leaves at the
    /// records' speeds; those of the slow turn `map` (position, current) need less proof.
    pub fn new(estimate: &Record, check: &Record, map: Option<&[Vec<f64>; 2]>) -> Self {
        Self::of_stretches([estimate, check].map(std::slice::from_ref), map)
    }

    /// The same of records of several stretches each, all at one rate.
    pub fn of_stretches(records: [&[Record]; 2], map: Option<&[Vec<f64>; 2]>) -> Self {
        Self::below(band_hz(records), records, map)
    }

    /// The same up to a frequency, Hz.
    pub fn below(hz: f64, [estimate, check]: [&[Record]; 2], map: Option<&[Vec<f64>; 2]>) -> Self {
        let rate = estimate.first().map_or(1.0, |first| first.rate);
        let lags_s = lags(rate);
        let of = |records| Columns::new(records, hz).quiet();
        let mut sides: [Columns; 2] = rayon::join(|| of(estimate), || of(check)).into();
        // Of inertia alone: records at other speeds are what friction and orders are checked by.
        let [fitted, other] = &mut sides;
        other.close_beyond(fitted, &Base::ALWAYS, &lags_s);
        let width_rad_s = widen(fitted, other);
        let records = [&sides[0], &sides[1]];
        let candidates = Candidates::new(records, map);
        let Explained {
            base,
            not_told_apart,
            mut found,
        } = Search::new(records, &candidates, lags_s, rate).explained();
        let mut numbers = found.orders();
        let mut regressions = Regressions::new(records, &base, &numbers, found.late_s);
        let told = regressions.told(&numbers);
        if told.len() < numbers.len() {
            found.keep(&told);
            numbers = told;
            regressions = Regressions::new(records, &base, &numbers, found.late_s);
        }
        let Regressions { before, after, .. } = &regressions;
        let orders = numbers.iter().enumerate();
        let orders = orders.map(|(k, order)| {
            let at = base.len() + 2 * k;
            Order {
                order: *order,
                amplitude_a: after.values[at].hypot(after.values[at + 1]),
            }
        });
        let inertia = after.values[0];
        let noises = [0, 1].map(|k: usize| noise([estimate, check][k], records[k], inertia));
        let position = records.map(Columns::position);
        let judged = judged(records, &regressions.last, after, &numbers, found.late_s[0]);
        Study {
            width_rad_s,
            band_hz: hz,
            excitation: excitation(records[1]),
            does_not_carry: judged.own,
            is_judged: judged.blocks >= LEAST_BLOCKS,
            curves: judged.curves(),
            freed: regressions.freed(&numbers),
            explained: found.shares_of(regressions.of_check()),
            remnants: remnants(
                after,
                [&position[0], &position[1]],
                records.map(Columns::open),
                records[0].rate(),
                noises[0].max(noises[1]),
                candidates.shown,
                hz,
            ),
            curved: curved(after, &judged),
            velocity: records.map(Columns::velocity),
            orders: orders.collect(),
            base,
            not_told_apart,
            lag: regressions.lag,
            before: before.clone(),
            after: after.clone(),
            rate: records[0].rate(),
            noise: noises[1],
            current: records.map(Columns::current),
            position,
            open: records.map(Columns::open),
            lost: found.lost,
            tried: candidates.orders.len(),
            not_tried: candidates.not_tried,
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
