//! The current of a motor by inertia, friction, the orders of its turn, and the filter by which it is reported late.
//!
//! An order is taken that explains most of the fit record and that the check record bears out: with the amplitude and
//! phase of the fit record the regression of the check record's residual on it must have a coefficient near 1 that differs
//! from 0 by more than chance allows. Chance is what a residual of any colour makes of it (Newey and West 1987).

use super::columns::{Base, Columns};
use super::left::remnants;
use super::orders::{Order, of_map};
use super::record::Record;
use crate::design::dot;
use crate::rest::Remnant;
use crate::sandwich::{Linear, long_run_variance};
use nalgebra::{DMatrix, DVector};

/// Orders that are named at most where no slow turn vouches for more.
const MOST_NAMES: usize = 10;
/// Highest order that is looked for: what 100 Hz leave at a turn in 1.3 s.
const HIGHEST: u32 = 130;
/// Candidates that are looked at closely in each step.
const CONTENDERS: usize = 6;
/// Standard deviations by which the fit record must have an order: the best of a hundred in noise has 3.2.
const ON_FIT: f64 = 3.5;
/// The same of its coefficient on the check record, and where that coefficient must be.
const ON_CHECK: f64 = 3.0;
const COEFFICIENT: std::ops::Range<f64> = 0.5..1.5;
/// Share of the check record's square that an order must take; of one that a slow turn vouches for.
const MATERIAL: f64 = 0.01;
const VOUCHED: f64 = 1e-3;
/// Share of a candidate's own weight that must be left beside the orders that are in: else it says what they say.
const COLLINEAR: f64 = 1e-3;

/// Time constants of a lag that are tried, s, and how finely the best is followed.
const LAGS_S: [f64; 7] = [4e-3, 0.012, 0.03, 0.06, 0.12, 0.25, 0.5];
const FINER: [f64; 4] = [0.35, 0.17, 0.08, 0.04];
/// Orders that are fitted beside a lag, and rows for each.
const BESIDE_LAG: u32 = 40;
const ROWS_PER_ORDER: usize = 24;
/// Share by which a lag must lower the check record's square error.
const LEAST_LAG: f64 = 0.1;

/// A fitted current and what it leaves, on the filtered records.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Coefficients: the base columns, then cosine and sine of each order.
    pub values: Vec<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// What is left of the current of fit and check record, A.
    pub left: [Vec<f64>; 2],
}

/// A first-order filter on the current that is reported.
#[derive(Debug, Clone, Copy)]
pub struct Lag {
    /// Time constant, s, and its standard deviation.
    pub value_s: [f64; 2],
    /// Share of the check record's square that it takes beside the orders.
    pub explained: f64,
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
    /// Rate of the fit record's rows, Hz.
    pub rate: f64,
    /// What the current's sensor alone leaves after the filter, A.
    pub noise: f64,
    /// Candidates that lost.
    pub lost: Vec<Lost>,
    /// Candidates tried.
    pub tried: usize,
    /// What the orders leave of both records above it.
    pub remnants: Vec<Remnant>,
}

/// Rms of a signal.
pub(crate) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Noise of a record's current within the filter's band, A: white noise by its fourth differences, which what moves
/// slowly has not.
fn noise(record: &Record) -> f64 {
    let fourth: Vec<f64> = record
        .current
        .windows(5)
        .map(|i| i[0] - 4.0 * i[1] + 6.0 * i[2] - 4.0 * i[3] + i[4])
        .collect();
    rms(&fourth) / 70f64.sqrt() * (200.0 / record.rate).min(0.8).sqrt()
}

/// Least squares of some of many columns from their products.
struct Products {
    gram: DMatrix<f64>,
    rhs: DVector<f64>,
}

impl Products {
    fn new(columns: &[Vec<f64>], measured: &[f64]) -> Self {
        let n = columns.len();
        let mut gram = DMatrix::zeros(n, n);
        for k in 0..n {
            for j in 0..=k {
                let product = dot(&columns[k], &columns[j]);
                gram[(k, j)] = product;
                gram[(j, k)] = product;
            }
        }
        Products {
            gram,
            rhs: DVector::from_iterator(n, columns.iter().map(|column| dot(column, measured))),
        }
    }

    /// Inverse of the products of some columns, each counted in its own length.
    fn inverse(&self, of: &[usize]) -> DMatrix<f64> {
        let scale: Vec<f64> = of
            .iter()
            .map(|&k| self.gram[(k, k)].sqrt().max(1e-300).recip())
            .collect();
        let unit = DMatrix::from_fn(of.len(), of.len(), |k, j| {
            let ridge = if k == j { 1e-10 } else { 0.0 };
            self.gram[(of[k], of[j])] * scale[k] * scale[j] + ridge
        });
        let inverse = unit.cholesky().map_or_else(
            || DMatrix::zeros(of.len(), of.len()),
            |factor| factor.inverse(),
        );
        DMatrix::from_fn(of.len(), of.len(), |k, j| {
            inverse[(k, j)] * scale[k] * scale[j]
        })
    }

    fn rhs_of(&self, of: &[usize]) -> DVector<f64> {
        DVector::from_iterator(of.len(), of.iter().map(|&k| self.rhs[k]))
    }

    fn solve(&self, of: &[usize]) -> Vec<f64> {
        let solution = self.inverse(of) * self.rhs_of(of);
        solution.iter().copied().collect()
    }

    /// By how much a pair lowers the sum of squares beside those that are in.
    fn fall(&self, of: &[usize], inverse: &DMatrix<f64>, pair: [usize; 2]) -> f64 {
        let cross = DMatrix::from_fn(of.len(), 2, |k, j| self.gram[(of[k], pair[j])]);
        let own = DMatrix::from_fn(2, 2, |k, j| self.gram[(pair[k], pair[j])]);
        let beside = &own - cross.transpose() * inverse * &cross;
        let rhs = self.rhs_of(&pair) - cross.transpose() * inverse * self.rhs_of(of);
        if (0..2).any(|k| beside[(k, k)] < COLLINEAR * own[(k, k)]) {
            return 0.0;
        }
        beside
            .cholesky()
            .map_or(0.0, |factor| factor.solve(&rhs).dot(&rhs))
    }
}

/// What columns with given values leave.
fn left(measured: &[f64], columns: &[Vec<f64>], of: &[usize], values: &[f64]) -> Vec<f64> {
    let mut left = measured.to_vec();
    for (&k, value) in of.iter().zip(values) {
        left.iter_mut()
            .zip(&columns[k])
            .for_each(|(left, x)| *left -= value * x);
    }
    left
}

/// Both records under a lag: columns of the base, then pairs of orders.
struct Both {
    columns: [Vec<Vec<f64>>; 2],
    measured: [Vec<f64>; 2],
    products: Products,
}

impl Both {
    fn new(records: [&Columns; 2], base: &[Base], orders: &[u32], lag_s: f64) -> Self {
        let columns = records.map(|record| {
            let plain = base.iter().map(|base| record.base(*base, lag_s));
            let waves = orders.iter().flat_map(|order| record.wave(*order, lag_s));
            plain.chain(waves).collect::<Vec<_>>()
        });
        let measured = records.map(Columns::current);
        Both {
            products: Products::new(&columns[0], &measured[0]),
            columns,
            measured,
        }
    }

    fn left(&self, record: usize, of: &[usize], values: &[f64]) -> Vec<f64> {
        left(&self.measured[record], &self.columns[record], of, values)
    }

    /// Mean squares that all columns leave of fit and check record.
    fn squares(&self) -> [f64; 2] {
        let all: Vec<usize> = (0..self.columns[0].len()).collect();
        let values = self.products.solve(&all);
        [0, 1].map(|record| rms(&self.left(record, &all, &values)).powi(2))
    }

    fn fit(&self, of: &[usize]) -> Fit {
        let values = self.products.solve(of);
        let sides = [0, 1].map(|record| self.left(record, of, &values));
        let design = DMatrix::from_fn(sides[0].len(), of.len(), |row, k| {
            self.columns[0][of[k]][row]
        });
        let residual = DVector::from_column_slice(&sides[0]);
        let covariance = Linear::new(design, &residual).map(|fit| fit.covariance());
        Fit {
            covariance: covariance
                .unwrap_or_else(|| DMatrix::from_element(of.len(), of.len(), f64::NAN)),
            values,
            left: sides,
        }
    }
}

/// The lag with which inertia, friction and every whole order, fitted together, predict the check record best.
fn lag(records: [&Columns; 2], base: &[Base], highest: u32) -> f64 {
    let rows = records[0].current().len();
    let most = highest.min(BESIDE_LAG).min((rows / ROWS_PER_ORDER) as u32);
    let orders: Vec<u32> = (1..=most).collect();
    let square = |lag_s: f64| Both::new(records, base, &orders, lag_s).squares()[1];
    let without = square(0.0);
    let best = LAGS_S
        .map(|lag_s| (square(lag_s), lag_s))
        .into_iter()
        .min_by(|a, b| a.0.total_cmp(&b.0));
    match best {
        Some((least, lag_s)) if least < (1.0 - LEAST_LAG) * without => lag_s,
        _ => 0.0,
    }
}

/// Follows a lag to where the orders that were found leave least of the fit record.
fn followed(records: [&Columns; 2], base: &[Base], orders: &[u32], start: f64) -> [f64; 2] {
    let square = |log: f64| Both::new(records, base, orders, log.exp()).squares()[0];
    let (mut least, mut at) = (square(start.ln()), start.ln());
    for step in FINER {
        for log in [at - step, at + step] {
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
    let relative = (2.0 * least / (rows * curvature).max(1e-300)).sqrt();
    [at.exp(), at.exp() * relative]
}

impl Study {
    /// Fits on `estimate`, checks on `check`. The candidates are the orders of the slow turn `map` (position, current) or,
    /// without one, all that the filter leaves at the records' speeds.
    pub fn new(estimate: &Record, check: &Record, map: Option<&[Vec<f64>; 2]>) -> Self {
        let sides = [Columns::new(estimate), Columns::new(check)];
        let records = [&sides[0], &sides[1]];
        let (base, not_told_apart) = records[0].told_apart();
        let shown = records
            .map(Columns::highest_order)
            .into_iter()
            .min()
            .unwrap_or(0);
        let turned = records.iter().all(|record| record.turns() >= LEAST_TURNS);
        let highest = if turned { shown.min(HIGHEST) } else { 0 };
        let candidates: Vec<u32> = match map {
            Some([position, current]) => of_map(position, current)
                .iter()
                .map(|order| order.order)
                .filter(|order| *order <= if turned { shown } else { 0 })
                .collect(),
            None => (1..=highest).collect(),
        };
        let late = lag(records, &base, highest);
        let both = Both::new(records, &base, &candidates, late);
        let mut search = Search {
            both: &both,
            base: base.len(),
            candidates: &candidates,
            vouched: map.is_some(),
            taken: Vec::new(),
            lost: Vec::new(),
        };
        while search.step() {}
        let Search { taken, lost, .. } = search;
        let numbers: Vec<u32> = taken.iter().map(|(order, _)| *order).collect();
        let plain = Both::new(records, &base, &[], 0.0);
        let before = plain.fit(&(0..base.len()).collect::<Vec<_>>());
        let late = match late > 0.0 {
            true => followed(records, &base, &numbers, late),
            false => [0.0; 2],
        };
        let last = Both::new(records, &base, &numbers, late[0]);
        let after = last.fit(&(0..last.columns[0].len()).collect::<Vec<_>>());
        let of_check = rms(&before.left[1]).powi(2);
        let lag = (late[0] > 0.0).then(|| {
            let without = Both::new(records, &base, &numbers, 0.0).squares()[1];
            Lag {
                value_s: late,
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
        let noise = noise(estimate);
        let position = records.map(Columns::position);
        Study {
            freed: freed(records[0], &numbers, &last, &after, base.len(), late[0]),
            explained: taken.iter().map(|(_, fall)| fall / of_check).collect(),
            remnants: remnants(
                &after,
                [&position[0], &position[1]],
                records[0].rate(),
                noise,
            ),
            orders,
            base,
            not_told_apart,
            lag,
            before,
            after,
            rate: records[0].rate(),
            noise,
            current: records.map(Columns::current),
            position,
            lost,
            tried: candidates.len(),
        }
    }

    /// Current error of a fit on the check record, of its rms, %.
    fn percent(&self, fit: &Fit) -> f64 {
        100.0 * rms(&fit.left[1]) / rms(&self.current[1])
    }

    /// Without the orders, %.
    pub fn before_percent(&self) -> f64 {
        self.percent(&self.before)
    }

    /// With them, %.
    pub fn after_percent(&self) -> f64 {
        self.percent(&self.after)
    }
}

/// Turns that a record must cover for its orders to be looked for.
const LEAST_TURNS: f64 = 0.5;

/// How far a search for orders has come.
struct Search<'a> {
    both: &'a Both,
    base: usize,
    candidates: &'a [u32],
    vouched: bool,
    /// Orders, and by how much each lowered the check record's mean square.
    taken: Vec<(u32, f64)>,
    lost: Vec<Lost>,
}

impl Search<'_> {
    fn pair(&self, order: u32) -> [usize; 2] {
        let at = self
            .candidates
            .iter()
            .position(|known| *known == order)
            .unwrap_or(0);
        [self.base + 2 * at, self.base + 2 * at + 1]
    }

    /// Takes the candidate that explains most and that the check record bears out; `false` when there is none.
    fn step(&mut self) -> bool {
        if self.taken.len() >= MOST_NAMES && !self.vouched {
            return false;
        }
        let of: Vec<usize> = (0..self.base)
            .chain(self.taken.iter().flat_map(|(order, _)| self.pair(*order)))
            .collect();
        let inverse = self.both.products.inverse(&of);
        let values = self.both.products.solve(&of);
        let before = [0, 1].map(|record| self.both.left(record, &of, &values));
        let all = dot(&before[0], &before[0]).max(1e-300);
        let known = |order: &u32| {
            self.taken.iter().any(|(taken, _)| taken == order)
                || self.lost.iter().any(|lost| lost.order == *order)
        };
        let mut falls: Vec<(f64, u32)> = self
            .candidates
            .iter()
            .filter(|order| !known(order))
            .map(|order| {
                (
                    self.both.products.fall(&of, &inverse, self.pair(*order)),
                    *order,
                )
            })
            .collect();
        falls.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (fall, order) in falls.into_iter().take(CONTENDERS) {
            match self.judged(&of, order, &before[1]) {
                Ok(on_check) => {
                    self.taken.push((order, on_check));
                    return true;
                }
                Err(reason) => self.lost.push(Lost {
                    order,
                    share: fall / all,
                    reason,
                }),
            }
        }
        false
    }

    /// By how much an order lowers the check record's mean square, or why it is not taken.
    fn judged(&self, of: &[usize], order: u32, before: &[f64]) -> Result<f64, &'static str> {
        let pair = self.pair(order);
        let with: Vec<usize> = of.iter().copied().chain(pair).collect();
        let values = self.both.products.solve(&with);
        let own = [values[values.len() - 2], values[values.len() - 1]];
        let sides = [0, 1].map(|record| self.both.left(record, &with, &values));
        let part = |record: usize| -> Vec<f64> {
            let [c, s] = pair.map(|k| &self.both.columns[record][k]);
            c.iter()
                .zip(s)
                .map(|(c, s)| own[0] * c + own[1] * s)
                .collect()
        };
        // Regression of what is left, the order's part included, on that part.
        let deviations = |record: usize| {
            let part = part(record);
            let pulls: Vec<f64> = part
                .iter()
                .zip(&sides[record])
                .map(|(p, e)| p * e)
                .collect();
            let weight = dot(&part, &part).max(1e-300);
            let coefficient = 1.0 + dot(&part, &sides[record]) / weight;
            let sigma = long_run_variance(&pulls, &sides[record]).sqrt() / weight;
            (coefficient, coefficient / sigma.max(1e-300))
        };
        if deviations(0).1 < ON_FIT {
            return Err("no more than chance makes of the fit record");
        }
        let (coefficient, sure) = deviations(1);
        if sure < ON_CHECK || !COEFFICIENT.contains(&coefficient) {
            return Err("not borne out by the check record");
        }
        let fall = rms(before).powi(2) - rms(&sides[1]).powi(2);
        let least = if self.vouched { VOUCHED } else { MATERIAL };
        match fall > least * rms(before).powi(2) {
            true => Ok(fall),
            false => Err("takes too little of what the check record has left"),
        }
    }
}

/// What the record alone says of the orders: each moves by a Gauss-Newton step, all of them and the other parameters
/// together.
fn freed(
    record: &Columns,
    orders: &[u32],
    both: &Both,
    fit: &Fit,
    base: usize,
    lag_s: f64,
) -> Vec<[f64; 2]> {
    let slopes = orders.iter().enumerate().map(|(k, order)| {
        let at = base + 2 * k;
        record.slope_by_order(*order, [fit.values[at], fit.values[at + 1]], lag_s)
    });
    let columns: Vec<Vec<f64>> = both.columns[0].iter().cloned().chain(slopes).collect();
    let first = both.columns[0].len();
    let jacobian = DMatrix::from_fn(fit.left[0].len(), columns.len(), |row, k| columns[k][row]);
    let left = DVector::from_column_slice(&fit.left[0]);
    let Some(free) = Linear::new(jacobian, &left) else {
        return vec![[f64::NAN; 2]; orders.len()];
    };
    let (step, covariance) = (free.step(), free.covariance());
    (first..)
        .zip(orders)
        .map(|(at, order)| [f64::from(*order) + step[at], covariance[(at, at)]])
        .collect()
}
