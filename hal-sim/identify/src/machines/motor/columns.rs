//! One record of a motor as the columns of a regression: through the same zero-phase filter on both sides, at as many rows
//! as the filter leaves.

use super::record::Record;
use crate::effects::limits::SHOWN;
use crate::predict::basis::At;
use crate::regression::column::Column;
use crate::regression::inverse::of_gram;
use crate::regression::normal::{Normal, Prior};
use crate::signal::filter::{ZeroPhase, butterworth, butterworth_gain, second_derivative};
use crate::signal::fourier::slope;
use crate::signal::noise::white_noise;
use crate::signal::quantile::quantile_of_sizes;
use crate::signal::recount::{PHASES, count_of, saw_tooth};
use fft::Complex64;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// The part that is left out at a record's start, s, in which the speed is not yet reached, and at its end.
const MARGIN_S: [f64; 2] = [0.3, 0.1];
/// Bandwidth of the angle by which the orders turn, in that of what is compared: within that it is as it was read.
const ANGLE_OF_BAND: f64 = 2.0;
/// Bandwidth of the speed that tells how fast a record is, Hz: the counts of a creeping encoder are no speed.
const SLOW_HZ: f64 = 10.0;
/// Standard deviations of the speed's noise over which friction changes its sign: the counts of an encoder are no
/// reversals.
const TURNS_ROUND_IN_NOISE: f64 = 3.0;
/// Share of an acceleration's power that may be noise of the angle: by so much it biases the inertia towards 0 (errors in
/// variables, Söderström, *Automatica* 43, 2007).
const MOST_NOISE: f64 = 0.05;
/// Lowest bandwidth of an acceleration, Hz, and by which factor it is lowered.
pub(super) const LEAST_HZ: f64 = 2.0;
pub(super) const NARROWER: f64 = 0.8;
/// Rows a second that are kept, in the bandwidth.
const ROWS_OF_BAND: f64 = 2.5;
/// Share of the median speed below which a motor all but rests.
const RESTS: f64 = 0.2;
/// Share of a regressor's own weight that must be left beside the others: a variance inflation of 10 (Marquardt,
/// *Technometrics* 12, 1970).
const LEAST_OWN: f64 = 0.1;
/// Rows that a stretch must have for filters and noise.
const LEAST_ROWS: usize = 16;
/// Widths of friction that are tried: by which factor the next one is wider, up to which share of the top speed, how many.
const WIDER: f64 = 1.6;
const WIDEST: f64 = 0.2;
const MOST_WIDTHS: usize = 16;
/// Orders whose waves are made one from the other, on one thread.
const SUCCESSIVE: usize = 8;
/// Gain of the filter down to which an order shows.
const LEAST_GAIN: f64 = 0.1;

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
    /// What every motor has.
    pub(super) const ALWAYS: [Base; 2] = [Base::Inertia, Base::Offset];

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

/// One stretch without a gap, filtered.
struct Stretch {
    rate: f64,
    hz: f64,
    step: usize,
    rows: std::ops::Range<usize>,
    /// The filter of both sides, at the rows that are kept.
    filter: ZeroPhase,
    /// Rows that count.
    open: Vec<bool>,
    position: Vec<f64>,
    /// Cosine and sine of the angle.
    turned: Vec<Complex64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
    /// Bandwidth of the acceleration, Hz.
    acceleration_hz: f64,
    /// Power density of the angle's white noise, rad^2/Hz.
    angle_density: f64,
    /// Accelerations that an encoder's rounding shows of the motion without it, rad/s^2; empty where the angle has no counts.
    rounded: Vec<Vec<f64>>,
    slow: Vec<f64>,
    current: Vec<f64>,
}

/// A record of one or more stretches, filtered.
pub(super) struct Columns {
    stretches: Vec<Stretch>,
    /// Speed over which friction changes its sign, rad/s.
    width: f64,
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
    fn new(record: &Record, hz: f64) -> Self {
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
    fn speed_noise(&self) -> f64 {
        self.noise(1.0, self.hz)
    }

    /// Standard deviation of the acceleration's noise up to a frequency, rad/s^2: white, or the lines of an encoder's rounding.
    fn acceleration_noise(&self, hz: f64) -> f64 {
        let seen = self.rounded.iter().map(|a| butterworth(a, self.rate, hz));
        let squares: f64 = seen.flatten().map(|a| a * a).sum();
        let rows = self.rounded.iter().map(Vec::len).sum::<usize>().max(1);
        self.noise(2.0, hz).max((squares / rows as f64).sqrt())
    }

    /// Takes away what of the acceleration is the angle's noise. It passes the filter of both sides later, as the current
    /// does: only where it must be narrower is it filtered here.
    fn quieten(&mut self) {
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
    fn kept<T: Copy>(&self, values: &[T]) -> Vec<T> {
        let rows = self.rows.clone().step_by(self.step);
        rows.map(|row| values[row]).collect()
    }

    /// Rows that are kept; 0 where they do not count.
    fn cut(&self, values: &[f64]) -> Vec<f64> {
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
    fn reported(&self, values: &[f64], lag_s: f64) -> Vec<f64> {
        let shown = match lag_s {
            0.0 => self.filter.of(values),
            late if late < 0.0 => self.filter.of(&delayed(values, -late * self.rate)),
            late => self.filter.of(&lagged(values, late * self.rate)),
        };
        self.counting(shown)
    }

    /// Cosine and sine of each of some orders of the turn.
    fn waves(&self, orders: &[u32], lag_s: f64) -> Vec<[Vec<f64>; 2]> {
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
    fn base(&self, base: Base, lag_s: f64, width: f64) -> Vec<f64> {
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
    fn at(&self, width: f64) -> Vec<At> {
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

impl Columns {
    /// Of the stretches of a record, all at one rate, below a frequency.
    pub(super) fn new(records: &[Record], hz: f64) -> Self {
        let stretches: Vec<Stretch> = records
            .iter()
            .filter(|record| record.position.len() > LEAST_ROWS)
            .map(|record| Stretch::new(record, hz))
            .collect();
        let noises = stretches.iter().map(Stretch::speed_noise);
        Columns {
            width: (TURNS_ROUND_IN_NOISE * noises.fold(0.0, f64::max)).max(1e-9),
            stretches,
        }
    }

    /// Signals of all stretches, one behind the other.
    fn all<T>(&self, of: impl FnMut(&Stretch) -> Vec<T>) -> Vec<T> {
        self.stretches.iter().flat_map(of).collect()
    }

    /// Rows a second that are kept.
    pub(super) fn rate(&self) -> f64 {
        self.stretches
            .first()
            .map_or(1.0, |own| own.rate / own.step as f64)
    }

    /// Rows a second of the record.
    pub(super) fn sample_hz(&self) -> f64 {
        self.stretches.first().map_or(1.0, |own| own.rate)
    }

    /// Bandwidth of what is compared, Hz.
    pub(super) fn band_hz(&self) -> f64 {
        self.stretches.first().map_or(0.0, |own| own.hz)
    }

    /// The same with an acceleration that is not the angle's noise.
    pub(super) fn quiet(mut self) -> Self {
        self.stretches.iter_mut().for_each(Stretch::quieten);
        self
    }

    /// Lowest bandwidth of an acceleration, Hz.
    pub(super) fn acceleration_hz(&self) -> f64 {
        let own = self.stretches.iter().map(|own| own.acceleration_hz);
        own.fold(f64::INFINITY, f64::min)
    }

    /// Standard deviation of the acceleration's noise in the quietest stretch, rad/s^2.
    pub(super) fn acceleration_noise(&self) -> f64 {
        let own = self.stretches.iter();
        let own = own.map(|own| own.acceleration_noise(own.acceleration_hz));
        own.fold(f64::INFINITY, f64::min)
    }

    /// Which of the rows that are kept count.
    pub(super) fn open(&self) -> Vec<bool> {
        self.all(|own| own.kept(&own.open))
    }

    /// Rows that are kept, stretch by stretch.
    pub(super) fn stretches(&self) -> Vec<std::ops::Range<usize>> {
        let mut first = 0;
        let of = |own: &Stretch| {
            let rows = own.rows.clone().step_by(own.step).len();
            first += rows;
            first - rows..first
        };
        self.stretches.iter().map(of).collect()
    }

    /// Where the motor is in the rows that are kept.
    pub(super) fn at(&self) -> Vec<At> {
        self.all(|own| own.kept(&own.at(self.width)))
    }

    /// Where the motor is in all rows, stretch by stretch.
    pub(super) fn everywhere(&self) -> Vec<Vec<At>> {
        let of = |own: &Stretch| own.at(self.width);
        self.stretches.iter().map(of).collect()
    }

    /// A function of where the motor is in all rows, as the current shows it.
    pub(super) fn shown(
        &self,
        everywhere: &[Vec<At>],
        lag_s: f64,
        of: impl Fn(&At) -> f64,
    ) -> Vec<f64> {
        let pairs = self.stretches.iter().zip(everywhere);
        let shown = pairs.flat_map(|(own, at)| {
            let values: Vec<f64> = at.iter().map(&of).collect();
            own.reported(&values, lag_s)
        });
        shown.collect()
    }

    /// Speeds over which friction may change its sign: from the speed's noise to a fifth of the top speed.
    pub(super) fn widths(&self) -> Vec<f64> {
        let top = quantile_of_sizes(self.moving(), 0.95);
        let widths = std::iter::successors(Some(self.width), |width| Some(WIDER * width));
        widths
            .take_while(|width| *width < WIDEST * top)
            .take(MOST_WIDTHS)
            .collect()
    }

    /// With another width of the friction.
    pub(super) fn set_width(&mut self, width: f64) {
        self.width = width;
    }

    /// Slow speeds of the rows that are used.
    fn moving(&self) -> impl Iterator<Item = f64> {
        self.all(|own| own.slow[own.rows.clone()].to_vec())
            .into_iter()
    }

    /// Closes the rows at which regressors are outside of what a record that is fitted has, by their leverage, whatever
    /// the lag: of a model that was not fitted there an error says nothing (hidden extrapolation, Montgomery, Peck and
    /// Vining, *Introduction to Linear Regression Analysis*, 3.8).
    pub(super) fn close_beyond(&mut self, fitted: &Columns, base: &[Base], lags_s: &[f64]) {
        let design = |columns: &Columns, lag_s: f64| {
            let of: Vec<Vec<f64>> = base.iter().map(|b| columns.base(*b, lag_s)).collect();
            DMatrix::from_fn(of[0].len(), of.len(), |row, k| of[k][row])
        };
        for lag_s in lags_s {
            let [of_fit, own] = [fitted, &*self].map(|columns| design(columns, *lag_s));
            let gram = of_fit.tr_mul(&of_fit);
            let scale =
                DMatrix::from_diagonal(&gram.diagonal().map(|x| x.max(1e-300).sqrt().recip()));
            let Some(inverse) = of_gram(&(&scale * gram * &scale)) else {
                continue;
            };
            let weight = &scale * inverse * &scale;
            let leverages = |design: &DMatrix<f64>| -> Vec<f64> {
                let shaped = design * &weight;
                (0..design.nrows())
                    .map(|row| shaped.row(row).dot(&design.row(row)))
                    .collect()
            };
            let most = leverages(&of_fit).into_iter().fold(0.0, f64::max);
            let mut leverages = leverages(&own).into_iter();
            for stretch in &mut self.stretches {
                let kept = stretch.rows.clone().step_by(stretch.step);
                for (row, leverage) in kept.zip(leverages.by_ref()) {
                    if leverage > most {
                        stretch.open[row] = false;
                    }
                }
            }
        }
    }

    /// The current, A.
    pub(super) fn current(&self) -> Vec<f64> {
        self.all(|own| own.cut(&own.current))
    }

    /// The angle, rad.
    pub(super) fn position(&self) -> Vec<f64> {
        self.all(|own| own.kept(&own.position))
    }

    /// The speed, rad/s.
    pub(super) fn velocity(&self) -> Vec<f64> {
        self.all(|own| own.kept(&own.velocity))
    }

    /// The median speed, rad/s.
    fn median_speed(&self) -> f64 {
        quantile_of_sizes(self.moving(), 0.5)
    }

    /// Which kinds of friction the record tells from inertia and a constant current, and which not, with the reason.
    pub(super) fn told_apart(&self) -> (Vec<Base>, Vec<(Base, &'static str)>) {
        let column = |base: Base| Column::alone(self.base(base, 0.0));
        let mut base = Base::ALWAYS.to_vec();
        let mut not = Vec::new();
        for (further, reason) in [
            (
                Base::Coulomb,
                "the motor hardly turns both ways: it is not told from a constant current; a record both ways would tell",
            ),
            (
                Base::Viscous,
                "the speed hardly changes: it is not told from a constant current; two speeds a factor of 2 apart would tell",
            ),
        ] {
            let own = column(further);
            let whole = std::iter::once(0..own.only().len()).collect();
            let mut normal = Normal::new(own, &whole);
            base.iter()
                .for_each(|known| normal.push(column(*known), Prior::FREE));
            let left = normal.cost(&normal.solve(None).values);
            match left > LEAST_OWN * normal.cost(&DVector::zeros(base.len())) {
                true => base.push(further),
                false => not.push((further, reason)),
            }
        }
        (base.split_off(Base::ALWAYS.len()), not)
    }

    /// The highest whole order that the filter leaves where the motor turns slowest, on enough of the rows.
    pub(super) fn highest_order(&self) -> u32 {
        let rests = RESTS * self.median_speed();
        let slowest = quantile_of_sizes(self.moving().filter(|w| w.abs() > rests), SHOWN);
        let hz = self.stretches.first().map_or(0.0, |own| own.hz)
            * (LEAST_GAIN.recip() - 1.0).powf(0.125);
        (TAU * hz / slowest.max(1e-9)).min(1e6) as u32
    }

    /// Turns that the record covers.
    pub(super) fn turns(&self) -> f64 {
        let inside = self.all(|own| own.position[own.rows.clone()].to_vec());
        let (low, high) = inside
            .iter()
            .fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
        ((high - low) / TAU).max(0.0)
    }

    /// A regressor.
    pub(super) fn base(&self, base: Base, lag_s: f64) -> Vec<f64> {
        self.all(|own| own.base(base, lag_s, self.width))
    }

    /// Cosine and sine of each of some orders of the turn.
    pub(super) fn waves(&self, orders: &[u32], lag_s: f64) -> Vec<[Vec<f64>; 2]> {
        let of = |orders: &[u32]| {
            let mut all = vec![[const { Vec::new() }; 2]; orders.len()];
            for own in &self.stretches {
                let waves = own.waves(orders, lag_s);
                for (all, wave) in all.iter_mut().flatten().zip(waves.into_iter().flatten()) {
                    all.extend(wave);
                }
            }
            all
        };
        orders.par_chunks(SUCCESSIVE).flat_map_iter(of).collect()
    }

    /// A wave's derivative by its order, about the record's middle: what is linear in the angle is then not the phase once
    /// more.
    pub(super) fn slope_by_order(&self, order: u32, [c, s]: [f64; 2], lag_s: f64) -> Vec<f64> {
        let all = self.all(|own| own.position.clone());
        let middle = all.iter().sum::<f64>() / all.len().max(1) as f64;
        self.all(|own| {
            let slope: Vec<f64> = own
                .position
                .iter()
                .map(|p| {
                    let (sin, cos) = (f64::from(order) * p).sin_cos();
                    (p - middle) * (s * cos - c * sin)
                })
                .collect();
            own.reported(&slope, lag_s)
        })
    }
}
