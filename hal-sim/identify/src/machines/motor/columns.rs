//! One record of a motor as the columns of a regression.

use super::base::Base;
use super::record::Record;
use super::stretch::{Stretch, TURNS_ROUND_IN_NOISE};
use crate::effects::limits::SHOWN;
use crate::predict::basis::At;
use crate::regression::column::Column;
use crate::regression::inverse::of_gram;
use crate::regression::normal::{Normal, Prior};
use crate::signal::quantile::quantile_of_sizes;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::f64::consts::TAU;

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

/// A record of one or more stretches, filtered.
pub(super) struct Columns {
    stretches: Vec<Stretch>,
    /// Speed over which friction changes its sign, rad/s.
    width: f64,
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

    /// Closes the rows at which regressors are outside of what the fitted record has, at any of the lags. Their leverage decides. The model
    /// was not fitted there, so its error says nothing (hidden extrapolation, Montgomery, Peck and Vining, *Introduction to Linear
    /// Regression Analysis*, 3.8).
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
