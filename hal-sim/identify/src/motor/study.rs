//! The current of a motor by inertia, friction and the orders of its turn.

use super::left::remnants;
use super::orders::{Order, of_map, of_residual};
use super::record::Record;
use crate::feed_axis::butterworth_100;
use crate::fourier::slope;
use crate::rest::Remnant;
use crate::sandwich::Linear;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// What is left out at a record's start, s, in which the speed is not yet reached, and at its end.
const MARGIN_S: [f64; 2] = [0.3, 0.1];
/// Speed over which friction changes its sign, rad/s.
const STICKING: f64 = 0.3;

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

/// What the orders explain of a motor's current.
pub struct Study {
    /// Orders, the strongest first.
    pub orders: Vec<Order>,
    /// Columns ahead of the orders' in [`Fit::values`]: acceleration, velocity, its square, friction, offset.
    pub base: usize,
    /// The orders as the fit record has them where they are free, whole or not, and their variances.
    pub freed: Vec<[f64; 2]>,
    /// Share by which each order, with those ahead of it, lowers the square of what inertia and friction leave of the fit
    /// record.
    pub explained: Vec<f64>,
    /// Inertia and friction only.
    pub before: Fit,
    /// With the orders.
    pub after: Fit,
    /// Filtered current of fit and check record, A.
    pub current: [Vec<f64>; 2],
    /// Angles of the same rows, rad.
    pub position: [Vec<f64>; 2],
    /// Rate of the rows, Hz.
    pub rate: f64,
    /// What the current's sensor alone leaves after the filter, A.
    pub noise: f64,
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
    rms(&fourth) / 70f64.sqrt() * (200.0 / record.rate).sqrt()
}

/// One record's columns, with the margins cut off.
struct Prepared {
    columns: Vec<Vec<f64>>,
    current: Vec<f64>,
    position: Vec<f64>,
}

/// Rows between the margins.
fn rows(record: &Record) -> Range<usize> {
    let [from, to] = MARGIN_S.map(|s| (s * record.rate) as usize);
    from..record.position.len().saturating_sub(to).max(from)
}

fn prepared(record: &Record, orders: &[u32], filtered: bool) -> Prepared {
    let rate = record.rate;
    let smooth = |values: &[f64]| match filtered {
        true => butterworth_100(values, rate),
        false => values.to_vec(),
    };
    // Derivatives need a smooth position whatever the current is compared by.
    let position = butterworth_100(&record.position, rate);
    let velocity = slope(&position, rate);
    let acceleration = slope(&velocity, rate);
    let friction: Vec<f64> = velocity.iter().map(|v| (v / STICKING).tanh()).collect();
    let square: Vec<f64> = velocity.iter().map(|v| v * v.abs()).collect();
    let mut columns = vec![
        acceleration,
        velocity,
        square,
        smooth(&friction),
        vec![1.0; position.len()],
    ];
    for &order in orders {
        for quarter in [0.0, std::f64::consts::FRAC_PI_2] {
            let wave: Vec<f64> = position
                .iter()
                .map(|p| (f64::from(order) * p - quarter).cos())
                .collect();
            columns.push(smooth(&wave));
        }
    }
    let cut = |values: &[f64]| values[rows(record)].to_vec();
    Prepared {
        columns: columns.iter().map(|column| cut(column)).collect(),
        current: cut(&smooth(&record.current)),
        position: cut(&position),
    }
}

/// Least squares on the first record; what is left of both.
fn fit(records: [&Prepared; 2]) -> Fit {
    let matrix =
        |p: &Prepared| DMatrix::from_fn(p.current.len(), p.columns.len(), |r, c| p.columns[c][r]);
    let current = |p: &Prepared| DVector::from_column_slice(&p.current);
    let n = records[0].columns.len();
    let (design, measured) = (matrix(records[0]), current(records[0]));
    // The regression is one step from nothing.
    let Some(values) = Linear::new(design.clone(), &measured).map(|fit| fit.step()) else {
        return Fit {
            values: vec![f64::NAN; n],
            covariance: DMatrix::from_element(n, n, f64::NAN),
            left: [Vec::new(), Vec::new()],
        };
    };
    let found = DVector::from_column_slice(&values);
    let left = measured - &design * &found;
    let other = current(records[1]) - matrix(records[1]) * &found;
    let covariance = Linear::new(design.clone(), &left).map(|fit| fit.covariance());
    Fit {
        covariance: covariance.unwrap_or_else(|| DMatrix::from_element(n, n, f64::NAN)),
        values,
        left: [left.as_slice().to_vec(), other.as_slice().to_vec()],
    }
}

/// See [`Study::explained`].
fn explained(prepared: &Prepared, base: usize) -> Vec<f64> {
    let measured = DVector::from_column_slice(&prepared.current);
    let left = |columns: usize| {
        let of = &prepared.columns;
        let design = DMatrix::from_fn(measured.len(), columns, |row, k| of[k][row]);
        Linear::new(design.clone(), &measured).map_or(f64::NAN, |fit| {
            (&measured - design * DVector::from_vec(fit.step())).norm_squared()
        })
    };
    let squares: Vec<f64> = (base..=prepared.columns.len())
        .step_by(2)
        .map(left)
        .collect();
    let falls = squares
        .windows(2)
        .map(|pair| (pair[0] - pair[1]) / squares[0]);
    falls.collect()
}

/// What the record alone says of the orders: each moves by a Gauss-Newton step, all of them and the other parameters
/// together.
fn freed(
    orders: &[Order],
    prepared: &Prepared,
    record: &Record,
    fit: &Fit,
    base: usize,
) -> Vec<[f64; 2]> {
    let position = butterworth_100(&record.position, record.rate);
    let middle = position.iter().sum::<f64>() / position.len().max(1) as f64;
    // By the order, about the record's middle: what is linear in the angle is then not the phase once more.
    let slope_of = |k: usize| {
        let order = f64::from(orders[k].order);
        let (c, s) = (fit.values[base + 2 * k], fit.values[base + 2 * k + 1]);
        let slope: Vec<f64> = position
            .iter()
            .map(|p| {
                let (sin, cos) = (order * p).sin_cos();
                (p - middle) * (s * cos - c * sin)
            })
            .collect();
        butterworth_100(&slope, record.rate)[rows(record)].to_vec()
    };
    let slopes = (0..orders.len()).map(slope_of);
    let columns: Vec<Vec<f64>> = prepared.columns.iter().cloned().chain(slopes).collect();
    let first = prepared.columns.len();
    let jacobian = DMatrix::from_fn(prepared.current.len(), columns.len(), |row, k| {
        columns[k][row]
    });
    let left = DVector::from_column_slice(&fit.left[0]);
    let Some(free) = Linear::new(jacobian, &left) else {
        return vec![[f64::NAN; 2]; orders.len()];
    };
    let (step, covariance) = (free.step(), free.covariance());
    (first..)
        .zip(orders)
        .map(|(at, order)| [f64::from(order.order) + step[at], covariance[(at, at)]])
        .collect()
}

impl Study {
    /// Fits on `estimate`, checks on `check`. The orders are those of the slow turn `map` (position, current) or, without
    /// one, those that inertia and friction leave of `estimate`.
    pub fn new(estimate: &Record, check: &Record, map: Option<&[Vec<f64>; 2]>) -> Self {
        let bare = [estimate, check].map(|record| prepared(record, &[], true));
        let before = fit([&bare[0], &bare[1]]);
        let orders = match map {
            Some([position, current]) => of_map(position, current),
            None => of_residual(&bare[0].position, &before.left[0]),
        };
        let numbers: Vec<u32> = orders.iter().map(|order| order.order).collect();
        let both = [estimate, check].map(|record| prepared(record, &numbers, true));
        let after = fit([&both[0], &both[1]]);
        let base = bare[0].columns.len();
        let noise = noise(estimate);
        let positions = [&both[0].position, &both[1].position];
        let remnants = remnants(&after, positions, estimate.rate, noise);
        let freed = freed(&orders, &both[0], estimate, &after, base);
        let [fit_part, check_part] = bare;
        Study {
            orders,
            base,
            freed,
            explained: explained(&both[0], base),
            before,
            after,
            rate: estimate.rate,
            remnants,
            noise,
            current: [fit_part.current, check_part.current],
            position: [fit_part.position, check_part.position],
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

    /// Both without the 100 Hz filter of the current, %: the sensor's noise is then in.
    pub fn unfiltered_percent(estimate: &Record, check: &Record, orders: &[Order]) -> [f64; 2] {
        let size = prepared(check, &[], false).current;
        [&[], orders].map(|orders| {
            let numbers: Vec<u32> = orders.iter().map(|order| order.order).collect();
            let both = [estimate, check].map(|record| prepared(record, &numbers, false));
            let fit = fit([&both[0], &both[1]]);
            100.0 * rms(&fit.left[1]) / rms(&size)
        })
    }
}
