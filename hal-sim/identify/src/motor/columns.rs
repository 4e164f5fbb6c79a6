//! One record of a motor as the columns of a regression: through the same zero-phase filter on both sides, at as many rows
//! as the filter leaves.

use super::record::Record;
use crate::feed_axis::butterworth;
use crate::fourier::slope;
use std::f64::consts::TAU;

/// What is left out at a record's start, s, in which the speed is not yet reached, and at its end.
const MARGIN_S: [f64; 2] = [0.3, 0.1];
/// Bandwidth of what is compared, Hz, and in the rows' rate where that is slow.
const BAND_HZ: f64 = 100.0;
const BAND_OF_RATE: f64 = 0.4;
/// Bandwidth of the speed whose sign friction follows, Hz: the counts of a creeping encoder are no reversals.
const SLOW_HZ: f64 = 10.0;
/// Rows a second that are kept, in the bandwidth.
const ROWS_OF_BAND: f64 = 2.5;
/// Share of the median speed over which friction changes its sign.
const TURNS_ROUND: f64 = 0.2;

/// A regressor beside the orders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Base {
    /// Acceleration: its coefficient is the inertia over the torque constant, A s^2/rad.
    Inertia,
    /// A constant current, A.
    Offset,
    /// Sign of the speed, A.
    Coulomb,
    /// Speed, A s/rad.
    Viscous,
}

impl Base {
    /// For a reader, with its unit.
    pub fn name(self) -> (&'static str, &'static str) {
        match self {
            Base::Inertia => ("inertia over torque constant", "A s\u{B2}/rad"),
            Base::Offset => ("constant current", "A"),
            Base::Coulomb => ("Coulomb friction over torque constant", "A"),
            Base::Viscous => ("viscous friction over torque constant", "A s/rad"),
        }
    }
}

/// One record, filtered.
pub(super) struct Columns {
    rate: f64,
    hz: f64,
    step: usize,
    rows: std::ops::Range<usize>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
    slow: Vec<f64>,
    current: Vec<f64>,
}

/// The value that a share of the sizes is below.
fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut sizes: Vec<f64> = values.map(f64::abs).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let at = (share * (sizes.len() - 1) as f64) as usize;
    *sizes.select_nth_unstable_by(at, f64::total_cmp).1
}

impl Columns {
    pub(super) fn new(record: &Record) -> Self {
        let rate = record.rate;
        let hz = BAND_HZ.min(BAND_OF_RATE * rate);
        let position = butterworth(&record.position, rate, hz);
        let velocity = slope(&position, rate);
        let slow = butterworth(&record.position, rate, SLOW_HZ.min(hz));
        let [from, to] = MARGIN_S.map(|s| (s * rate) as usize);
        let rows = record.position.len();
        Columns {
            rate,
            hz,
            step: ((rate / (ROWS_OF_BAND * hz)) as usize).max(1),
            rows: from.min(rows)..rows.saturating_sub(to).max(from.min(rows)),
            acceleration: slope(&velocity, rate),
            slow: slope(&slow, rate),
            velocity,
            position,
            current: butterworth(&record.current, rate, hz),
        }
    }

    /// Rows a second that are kept.
    pub(super) fn rate(&self) -> f64 {
        self.rate / self.step as f64
    }

    /// Rows that count, of a signal of the record's length.
    fn cut(&self, values: &[f64]) -> Vec<f64> {
        let rows = self.rows.clone().step_by(self.step);
        rows.map(|row| values[row]).collect()
    }

    /// The current, A.
    pub(super) fn current(&self) -> Vec<f64> {
        self.cut(&self.current)
    }

    /// The angle, rad.
    pub(super) fn position(&self) -> Vec<f64> {
        self.cut(&self.position)
    }

    /// Behind a first-order filter with the time constant `lag_s`, and through the common filter.
    fn reported(&self, values: &[f64], lag_s: f64) -> Vec<f64> {
        if lag_s <= 0.0 {
            return self.cut(&butterworth(values, self.rate, self.hz));
        }
        let keep = (-1.0 / (self.rate * lag_s)).exp();
        let mut last = values[0];
        let late: Vec<f64> = values
            .iter()
            .map(|x| {
                last = keep * last + (1.0 - keep) * x;
                last
            })
            .collect();
        self.cut(&butterworth(&late, self.rate, self.hz))
    }

    /// The median speed, rad/s.
    fn median_speed(&self) -> f64 {
        quantile(self.slow[self.rows.clone()].iter().copied(), 0.5)
    }

    /// Which regressors the record tells apart, and which not, with the reason.
    pub(super) fn told_apart(&self) -> (Vec<Base>, Vec<(Base, &'static str)>) {
        let speeds = || self.slow[self.rows.clone()].iter().copied();
        let round = TURNS_ROUND * self.median_speed();
        let rows = speeds().count().max(1) as f64;
        let share = |way: f64| speeds().filter(|w| way * w > round).count() as f64 / rows;
        let mut base = vec![Base::Inertia, Base::Offset];
        let mut not = Vec::new();
        match share(1.0).min(share(-1.0)) > 0.05 {
            true => base.push(Base::Coulomb),
            false => not.push((
                Base::Coulomb,
                "the motor turns one way: it is not told from a constant current; a record both ways would tell",
            )),
        }
        match quantile(speeds(), 0.9) > 2.0 * quantile(speeds(), 0.1) {
            true => base.push(Base::Viscous),
            false => not.push((
                Base::Viscous,
                "the speed hardly changes: it is not told from a constant current; two speeds a factor of 2 apart would tell",
            )),
        }
        (base, not)
    }

    /// The highest whole order that the filter leaves at the median speed.
    pub(super) fn highest_order(&self) -> u32 {
        (TAU * self.hz / self.median_speed().max(1e-9)).min(1e6) as u32
    }

    /// Turns that the record covers.
    pub(super) fn turns(&self) -> f64 {
        let inside = self.position[self.rows.clone()].iter();
        let (low, high) = inside.fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
        ((high - low) / TAU).max(0.0)
    }

    /// A regressor.
    pub(super) fn base(&self, base: Base, lag_s: f64) -> Vec<f64> {
        let round = TURNS_ROUND * self.median_speed().max(1e-9);
        match base {
            Base::Inertia => self.reported(&self.acceleration, lag_s),
            Base::Offset => self.cut(&vec![1.0; self.position.len()]),
            Base::Coulomb => {
                let sign: Vec<f64> = self.slow.iter().map(|w| (w / round).tanh()).collect();
                self.reported(&sign, lag_s)
            }
            Base::Viscous => self.reported(&self.velocity, lag_s),
        }
    }

    /// Cosine and sine of an order of the turn.
    pub(super) fn wave(&self, order: u32, lag_s: f64) -> [Vec<f64>; 2] {
        let (cos, sin): (Vec<f64>, Vec<f64>) = self
            .position
            .iter()
            .map(|p| {
                let (sin, cos) = (f64::from(order) * p).sin_cos();
                (cos, sin)
            })
            .unzip();
        [self.reported(&cos, lag_s), self.reported(&sin, lag_s)]
    }

    /// A wave's derivative by its order, about the record's middle: what is linear in the angle is then not the phase once
    /// more.
    pub(super) fn slope_by_order(&self, order: u32, [c, s]: [f64; 2], lag_s: f64) -> Vec<f64> {
        let middle = self.position.iter().sum::<f64>() / self.position.len().max(1) as f64;
        let slope: Vec<f64> = self
            .position
            .iter()
            .map(|p| {
                let (sin, cos) = (f64::from(order) * p).sin_cos();
                (p - middle) * (s * cos - c * sin)
            })
            .collect();
        self.reported(&slope, lag_s)
    }
}
