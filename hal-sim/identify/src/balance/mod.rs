//! The declared model's balances on a record: the residual of each channel, what each declared parameter adds to it,
//! and what an effect of the plant would add.
//!
//! Everything is linear in the amplitude of what is added and lives in the frequency domain, where differentiation and
//! the table's resonance are multiplications. What has no fast content is evaluated at the decimated rate only.

mod declared;
mod feed;
mod linear;
mod memory;
mod motor;
mod parameter;

pub(crate) use linear::of_the_current;
pub(crate) use memory::{Key, Memory};

use crate::effects::refusals::Refusals;
use crate::signal::channel::Channel;
use crate::signal::fourier::{CLEAR, Fourier, Spectrum};
use crate::signal::noise::declared_resonance_hz;
use crate::signal::signals::{Signals, rounded_sign};
use fft::Complex64;
use plant::Axis;
use plant::effects::{EffectModel, Place, Term};
use plant::model::Model;
use std::f64::consts::TAU;

/// What one quantity adds to the residuals: a spectrum for each channel that it reaches.
#[derive(Clone, Default)]
pub struct Contribution(pub Vec<(Channel, Spectrum)>);

impl Contribution {
    /// Adds `scale * spectrum` to a channel.
    pub fn add(&mut self, channel: Channel, scale: f64, spectrum: &[Complex64]) {
        match self.0.iter_mut().find(|(known, _)| *known == channel) {
            Some((_, sum)) => sum
                .iter_mut()
                .zip(spectrum)
                .for_each(|(a, b)| *a += b * scale),
            None => self
                .0
                .push((channel, spectrum.iter().map(|c| c * scale).collect())),
        }
    }

    /// Adds `scale *` another contribution.
    pub fn add_all(&mut self, scale: f64, other: &Contribution) {
        for (channel, spectrum) in &other.0 {
            self.add(*channel, scale, spectrum);
        }
    }
}

/// Speeds over which the sign of a speed turns round in Coulomb friction; 0 is a hard sign.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rounding {
    /// Of the bearings, rad/s.
    pub bearing: f64,
    /// Of screw against nut, rad/s.
    pub pair: f64,
    /// Of the table in radians of screw against nut, rad/s.
    pub guideway: f64,
}

/// What the balances rest on that no parameter says and the record must tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Assumed {
    /// How the signs of friction are rounded.
    pub rounding: Rounding,
    /// Resonance of the table that forces bend the screw with, if another than the declared one, Hz: what two effects
    /// make together is a product, and this is its other factor.
    pub resonance_hz: Option<f64>,
    /// Damping ratio of a screw with another resonance.
    pub damping: f64,
    /// How much later than the angles of screw and nut the table's scale is read, s.
    pub lags: [f64; 2],
}

#[cfg(test)]
impl Assumed {
    /// Hard signs, the declared screw, and a scale that is read with the angles.
    pub(crate) const PLAIN: Assumed = Assumed {
        rounding: Rounding {
            bearing: 0.0,
            pair: 0.0,
            guideway: 0.0,
        },
        resonance_hz: None,
        damping: 0.02,
        lags: [0.0; 2],
    };
}

/// The screw as a spring under the table.
struct Spring {
    /// Static stiffness, N/m.
    stiffness: f64,
    /// Compliance over frequency, relative to its static value.
    compliance: Spectrum,
}

impl Spring {
    /// The declared one.
    fn declared(model: &Model, fourier: &Fourier) -> Self {
        let feed = &model.feed;
        Spring {
            stiffness: feed.axial_stiffness_n_per_m,
            compliance: compliance(
                fourier,
                declared_resonance_hz(model),
                feed.axial_damping_ratio,
            ),
        }
    }

    /// Of a table that swings at `hz`.
    fn swinging(model: &Model, fourier: &Fourier, hz: f64, damping: f64) -> Self {
        Spring {
            stiffness: model.feed.table_mass_kg * (TAU * hz).powi(2),
            compliance: compliance(fourier, hz, damping),
        }
    }
}

/// The balances of one record under one model.
pub struct Balance<'a> {
    /// The declared model.
    pub model: &'a Model,
    /// The record.
    pub signals: &'a Signals,
    /// Its transforms.
    pub fourier: &'a Fourier,
    /// How the signs of friction are rounded.
    pub rounding: Rounding,
    /// Travel per radian, m.
    pub lead: f64,
    /// Damping ratio of a softer screw.
    pub(crate) damping: f64,
    /// The declared screw.
    declared: Spring,
    /// The screw that forces bend which are not declared.
    screw: Spring,
    /// Force on the table's guideway side in time (friction, viscous, load), N, and its spectrum.
    table_force: Vec<f64>,
    table_force_spectrum: Spectrum,
    /// The table's scale less the travel of a rigid screw, m.
    rigid: Spectrum,
    /// Second derivative of the relative angle when the table's scale is read.
    relative_acceleration: Spectrum,
    /// What of it is above the encoders' resolution.
    relative_acceleration_told: Spectrum,
    /// How much later than the angles that is, s.
    pub(crate) lags: [f64; 2],
    pub(crate) memory: Memory,
    /// What is not tried or not taken.
    pub(crate) refusals: Refusals,
}

/// +1 for the screw, -1 for the nut: the sign with which the axial force brakes a motor.
fn brake(axis: Axis) -> f64 {
    match axis {
        Axis::Screw => 1.0,
        Axis::Nut => -1.0,
    }
}

/// `1 / (1 - u^2 + 2 i zeta u)`, `u = hz / resonance`.
fn compliance(fourier: &Fourier, resonance_hz: f64, damping: f64) -> Spectrum {
    (0..fourier.bins())
        .map(|bin| {
            let u = fourier.hz(bin) / resonance_hz;
            Complex64::new(1.0 - u * u, 2.0 * damping * u).inv()
        })
        .collect()
}

fn shaped(spectrum: &[Complex64], by: &[Complex64]) -> Spectrum {
    spectrum.iter().zip(by).map(|(a, b)| a * b).collect()
}

fn difference(a: &[Complex64], b: &[Complex64], scale: f64) -> Spectrum {
    a.iter().zip(b).map(|(a, b)| a - b * scale).collect()
}

impl<'a> Balance<'a> {
    /// Balances of a record.
    pub fn new(
        model: &'a Model,
        signals: &'a Signals,
        fourier: &'a Fourier,
        assumed: Assumed,
    ) -> Self {
        let feed = &model.feed;
        let rounding = assumed.rounding;
        let declared = || Spring::declared(model, fourier);
        let lead = feed.travel_per_radian();
        let sign = |w: f64| rounded_sign(w, rounding.guideway);
        let table_force: Vec<f64> = signals
            .relative_speed
            .iter()
            .map(|&w| {
                feed.guideway_coulomb_n * sign(w)
                    + feed.guideway_viscous_n_s_per_m * lead * w
                    + feed.load_n
            })
            .collect();
        // The angle at the reading of the scale: as it is read, and what it turns until then.
        let relative: Spectrum = (0..fourier.bins())
            .map(|bin| {
                let turned = |axis: Axis| {
                    let (motor, lag) = (&signals.motors[axis.index()], assumed.lags[axis.index()]);
                    motor.speed[bin] * lag + motor.acceleration[bin] * (0.5 * lag * lag)
                };
                signals.relative_spectrum[bin] + turned(Axis::Screw) - turned(Axis::Nut)
            })
            .collect();
        let later = |axis: Axis| {
            let acceleration = &signals.motors[axis.index()].acceleration;
            fourier.delayed(acceleration, -assumed.lags[axis.index()])
        };
        let relative_acceleration = difference(&later(Axis::Screw), &later(Axis::Nut), 1.0);
        Balance {
            model,
            signals,
            fourier,
            rounding,
            lead,
            damping: assumed.damping,
            declared: declared(),
            screw: match assumed.resonance_hz {
                Some(hz) => Spring::swinging(model, fourier, hz, assumed.damping),
                None => declared(),
            },
            table_force_spectrum: fourier.spectrum(&table_force),
            table_force,
            rigid: difference(&signals.table_spectrum, &relative, lead),
            lags: assumed.lags,
            memory: Memory::default(),
            refusals: Refusals::default(),
            relative_acceleration_told: fourier.above_noise(&relative_acceleration, CLEAR, |bin| {
                signals.relative_rounding(bin) * (TAU * fourier.hz(bin)).powi(4)
            }),
            relative_acceleration,
        }
    }

    /// What they rest on.
    pub(crate) fn assumed(&self) -> Assumed {
        Assumed {
            rounding: self.rounding,
            resonance_hz: None,
            damping: self.damping,
            lags: self.lags,
        }
    }

    /// What moves with the table, as it was when an angle was read.
    fn seen_by(&self, axis: Axis, of_the_table: &[Complex64]) -> Spectrum {
        self.fourier.delayed(of_the_table, self.lags[axis.index()])
    }

    /// Angle of screw against nut when the scale is read, rad.
    fn relative_angle(&self, row: usize) -> f64 {
        let angle = |axis: Axis| {
            let motor = &self.signals.motors[axis.index()];
            motor.theta[row] + self.lags[axis.index()] * motor.omega[row]
        };
        angle(Axis::Screw) - angle(Axis::Nut)
    }

    /// Spectrum of what has the given value at a row, for a value without content above `hz`.
    pub(crate) fn spectrum_of(&self, hz: f64, value: impl Fn(usize) -> f64) -> Spectrum {
        let stride = self.fourier.stride(hz);
        let signal = self.sampled(stride, value);
        self.fourier.spectrum_at(stride, &signal)
    }

    /// Every `stride`-th row of a value.
    fn sampled(&self, stride: usize, value: impl Fn(usize) -> f64) -> Vec<f64> {
        (0..self.signals.len()).step_by(stride).map(value).collect()
    }

    /// What an effect at its place would add to the residuals of a machine that has it.
    pub fn effect(&self, effect: &EffectModel) -> Contribution {
        self.terms(effect.place(), &effect.effect().terms())
    }

    /// The same of terms at a place.
    pub(crate) fn terms(&self, place: Place, terms: &[Term]) -> Contribution {
        let mut sum = Contribution::default();
        for term in terms {
            match place {
                Place::Feed => self.feed_term(term, &mut sum),
                place => {
                    for axis in Axis::ALL.into_iter().filter(|&axis| place.has(axis)) {
                        self.motor_term(axis, term, &mut sum);
                    }
                }
            }
        }
        sum
    }
}
