//! One stretch of a motor's record: through the same zero-phase filter on both sides, at as many rows as the filter leaves.

use super::base::Base;
use super::record::Record;
use crate::predict::basis::At;
use crate::signal::filter::{ZeroPhase, butterworth, butterworth_gain, second_derivative};
use crate::signal::fourier::slope;
use crate::signal::recount::{PHASES, count_of, saw_tooth};
use crate::signal::white::white_noise;
use fft::Complex64;
use std::f64::consts::TAU;

/// The part that is left out at a record's start, s, in which the speed is not yet reached, and at its end.
const MARGIN_S: [f64; 2] = [0.3, 0.1];
/// Bandwidth of the angle by which the orders turn, in that of what is compared: within that it is as it was read.
const ANGLE_OF_BAND: f64 = 2.0;
/// Bandwidth of the speed that tells how fast a record is, Hz: the counts of a creeping encoder are no speed.
const SLOW_HZ: f64 = 10.0;
/// Standard deviations of the speed's noise over which friction changes its sign: the counts of an encoder are no
/// reversals.
pub(super) const TURNS_ROUND_IN_NOISE: f64 = 3.0;
/// Share of an acceleration's power that may be noise of the angle: by so much it biases the inertia towards 0 (errors in
/// variables, Söderström, *Automatica* 43, 2007).
const MOST_NOISE: f64 = 0.05;
/// Lowest bandwidth of an acceleration, Hz, and by which factor it is lowered.
pub(super) const LEAST_HZ: f64 = 2.0;
pub(super) const NARROWER: f64 = 0.8;
/// Rows a second that are kept, in the bandwidth.
const ROWS_OF_BAND: f64 = 2.5;

/// One stretch without a gap, filtered.
pub(super) struct Stretch {
    pub(super) rate: f64,
    pub(super) hz: f64,
    pub(super) step: usize,
    pub(super) rows: std::ops::Range<usize>,
    /// The filter of both sides, at the rows that are kept.
    filter: ZeroPhase,
    /// Rows that count.
    pub(super) open: Vec<bool>,
    pub(super) position: Vec<f64>,
    /// Cosine and sine of the angle.
    turned: Vec<Complex64>,
    pub(super) velocity: Vec<f64>,
    acceleration: Vec<f64>,
    /// Bandwidth of the acceleration, Hz.
    pub(super) acceleration_hz: f64,
    /// Power density of the angle's white noise, rad^2/Hz.
    angle_density: f64,
    /// Accelerations that an encoder's rounding shows of the motion without it, rad/s^2; empty where the angle has no counts.
    rounded: Vec<Vec<f64>>,
    pub(super) slow: Vec<f64>,
    pub(super) current: Vec<f64>,
}

/// Accelerations that rounding to counts shows of an angle's smooth motion, each with another part of a count at its start,
/// rad/s^2.
fn rounded(angle: &[f64], rate: f64, hz: f64) -> Vec<Vec<f64>> {
    let Some(count) = count_of(angle) else {
        return Vec::new();
    };
    let smooth = butterworth(angle, rate, hz);
    let again = |phase: f64| {
        let error = smooth.iter().map(|x| count * saw_tooth(x / count + phase));
        second_derivative(&error.collect::<Vec<f64>>(), rate)
    };
    PHASES.map(again).into()
}

/// A signal behind a first-order filter with a time constant of `rows`, at rest at its first value before.
fn lagged(values: &[f64], rows: f64) -> Vec<f64> {
    let keep = (-1.0 / rows).exp();
    let mut last = values[0];
    let step = |x: &f64| {
        last = keep * last + (1.0 - keep) * x;
        last
    };
    values.iter().map(step).collect()
}

/// A signal later by `rows`, by straight lines; its first value is held before it.
fn delayed(values: &[f64], rows: f64) -> Vec<f64> {
    let at = |row: usize| {
        let from = (row as f64 - rows).max(0.0);
        let (k, share) = (from as usize, from.fract());
        let next = values[(k + 1).min(values.len() - 1)];
        values[k] + share * (next - values[k])
    };
    (0..values.len()).map(at).collect()
}

/// Cosine and sine of an order of an angle.
fn phasors(angle: &[f64], order: u32) -> Vec<Complex64> {
    let phasor = |x: &f64| Complex64::cis(f64::from(order) * x);
    angle.iter().map(phasor).collect()
}

impl Stretch {
    pub(super) fn new(record: &Record, hz: f64) -> Self {
        let rate = record.rate;
        let position = match ANGLE_OF_BAND * hz < 0.5 * rate {
            true => butterworth(&record.position, rate, ANGLE_OF_BAND * hz),
            false => record.position.clone(),
        };
        let velocity = slope(&butterworth(&record.position, rate, hz), rate);
        let slow = butterworth(&record.position, rate, SLOW_HZ.min(hz));
        let [from, to] = MARGIN_S.map(|s| (s * rate) as usize);
        let length = record.position.len();
        let rows = from.min(length)..length.saturating_sub(to).max(from.min(length));
        let step = ((rate / (ROWS_OF_BAND * hz)) as usize).max(1);
        Stretch {
            rate,
            hz,
            step,
            filter: ZeroPhase::new(length, rows.clone(), step, butterworth_gain(hz / rate)),
            rows,
            open: vec![true; length],
            acceleration: second_derivative(&record.position, rate),
            acceleration_hz: hz,
            angle_density: white_noise(&record.position).powi(2) * 2.0 / rate,
            rounded: rounded(&record.position, rate, hz),
            slow: slope(&slow, rate),
            velocity,
            turned: phasors(&position, 1),
            position,
            current: butterworth(&record.current, rate, hz),
        }
    }

    /// Standard deviation of the angle's white noise through a derivative of this order, up to a frequency.
    fn noise(&self, order: f64, hz: f64) -> f64 {
        let power = 2.0 * order + 1.0;
        (self.angle_density * TAU.powf(2.0 * order) * hz.powf(power) / power).sqrt()
    }

    /// Standard deviation of the speed's noise, rad/s.
    pub(super) fn speed_noise(&self) -> f64 {
        self.noise(1.0, self.hz)
    }

    /// Standard deviation of the acceleration's noise up to a frequency, rad/s^2: white, or the lines of an encoder's rounding.
    pub(super) fn acceleration_noise(&self, hz: f64) -> f64 {
        let seen = self.rounded.iter().map(|a| butterworth(a, self.rate, hz));
        let squares: f64 = seen.flatten().map(|a| a * a).sum();
        let rows = self.rounded.iter().map(Vec::len).sum::<usize>().max(1);
        self.noise(2.0, hz).max((squares / rows as f64).sqrt())
    }

    /// Takes away what of the acceleration is the angle's noise. It passes the filter of both sides later, as the current
    /// does: only where it must be narrower is it filtered here.
    pub(super) fn quieten(&mut self) {
        let mut hz = self.hz;
        let shown = loop {
            let shown = butterworth(&self.acceleration, self.rate, hz);
            let square: f64 = shown.iter().map(|a| a * a).sum();
            let power = square / shown.len().max(1) as f64;
            let is_quiet = self.acceleration_noise(hz).powi(2) <= MOST_NOISE * power;
            if is_quiet || hz * NARROWER < LEAST_HZ {
                break shown;
            }
            hz *= NARROWER;
        };
        if hz < self.hz {
            (self.acceleration, self.acceleration_hz) = (shown, hz);
        }
    }

    /// Rows that are kept, of a signal of the stretch's length.
    pub(super) fn kept<T: Copy>(&self, values: &[T]) -> Vec<T> {
        let rows = self.rows.clone().step_by(self.step);
        rows.map(|row| values[row]).collect()
    }

    /// Rows that are kept; 0 where they do not count.
    pub(super) fn cut(&self, values: &[f64]) -> Vec<f64> {
        self.counting(self.kept(values))
    }

    /// Of the rows that are kept: 0 where they do not count.
    fn counting(&self, mut kept: Vec<f64>) -> Vec<f64> {
        let closed = kept.iter_mut().zip(self.kept(&self.open));
        let closed = closed.filter(|(_, open)| !open);
        closed.for_each(|(value, _)| *value = 0.0);
        kept
    }

    /// Behind a first-order filter with the time constant `lag_s`, or, where that is below 0, later by as much; and through the
    /// common filter.
    pub(super) fn reported(&self, values: &[f64], lag_s: f64) -> Vec<f64> {
        let shown = match lag_s {
            0.0 => self.filter.of(values),
            late if late < 0.0 => self.filter.of(&delayed(values, -late * self.rate)),
            late => self.filter.of(&lagged(values, late * self.rate)),
        };
        self.counting(shown)
    }

    /// Cosine and sine of each of some orders of the turn.
    pub(super) fn waves(&self, orders: &[u32], lag_s: f64) -> Vec<[Vec<f64>; 2]> {
        let mut turned = vec![Complex64::ONE; self.turned.len()];
        let mut last = 0;
        let wave = |order: &u32| {
            match order.checked_sub(last) {
                Some(1) => turned
                    .iter_mut()
                    .zip(&self.turned)
                    .for_each(|(x, once)| *x *= once),
                _ => turned = phasors(&self.position, *order),
            }
            last = *order;
            [|x: &Complex64| x.re, |x: &Complex64| x.im].map(|part| {
                let values: Vec<f64> = turned.iter().map(part).collect();
                self.reported(&values, lag_s)
            })
        };
        orders.iter().map(wave).collect()
    }

    /// A regressor, with friction that changes its sign over `width`, rad/s.
    pub(super) fn base(&self, base: Base, lag_s: f64, width: f64) -> Vec<f64> {
        match base {
            Base::Inertia => self.reported(&self.acceleration, lag_s),
            Base::Offset => self.cut(&vec![1.0; self.position.len()]),
            Base::Coulomb => self.reported(&self.way(width), lag_s),
            Base::Viscous => self.reported(&slope(&self.position, self.rate), lag_s),
        }
    }

    /// Smooth sign of the speed.
    fn way(&self, width: f64) -> Vec<f64> {
        self.velocity.iter().map(|w| (w / width).tanh()).collect()
    }

    /// Where the motor is, in each row of the stretch.
    pub(super) fn at(&self, width: f64) -> Vec<At> {
        let way = self.way(width);
        let least = (TURNS_ROUND_IN_NOISE * self.speed_noise()).max(1e-9);
        let (mut from, mut last) = (self.position.first().copied().unwrap_or(0.0), 0.0);
        let rows = self.position.iter().zip(&self.velocity).zip(way);
        rows.map(|((angle, speed), way)| {
            if speed.abs() > least && speed.signum() != last {
                if last != 0.0 {
                    from = *angle;
                }
                last = speed.signum();
            }
            At {
                angle: *angle,
                position: *angle,
                speed: *speed,
                way,
                since: (angle - from).abs(),
            }
        })
        .collect()
    }
}
