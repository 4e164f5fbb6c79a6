//! The declared model's balances on a record: the residual of each channel, what each declared parameter adds to it,
//! and what an effect of the plant would add.
//!
//! Everything is linear in the amplitude of what is added and lives in the frequency domain, where differentiation and
//! the table's resonance are multiplications.

use crate::channel::Channel;
use crate::fourier::{Fourier, Spectrum};
use crate::signals::{Signals, clarke, park};
use plant::Axis;
use plant::effects::{Coordinate, EffectModel, Place, Site, Term};
use plant::model::Model;
use realfft::num_complex::Complex64;
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

/// `tanh(speed / rounding)`, or the sign.
pub fn rounded_sign(speed: f64, rounding: f64) -> f64 {
    if rounding > 0.0 {
        (speed / rounding).tanh()
    } else if speed == 0.0 {
        0.0
    } else {
        speed.signum()
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
    /// Compliance of table on screw over frequency, relative to its static value.
    resonance: Spectrum,
    /// Force on the table's guideway side in time (friction, viscous, load), N.
    table_force: Vec<f64>,
    /// Second derivative of the relative angle.
    relative_acceleration: Spectrum,
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

impl<'a> Balance<'a> {
    /// Balances of a record.
    pub fn new(
        model: &'a Model,
        signals: &'a Signals,
        fourier: &'a Fourier,
        rounding: Rounding,
    ) -> Self {
        let feed = &model.feed;
        let lead = feed.travel_per_radian();
        let sign = |w: f64| rounded_sign(w, rounding.guideway);
        let table_force = signals
            .relative_speed
            .iter()
            .map(|&w| {
                feed.guideway_coulomb_n * sign(w)
                    + feed.guideway_viscous_n_s_per_m * lead * w
                    + feed.load_n
            })
            .collect();
        let resonance_hz = (feed.axial_stiffness_n_per_m / feed.table_mass_kg).sqrt() / TAU;
        Balance {
            model,
            signals,
            fourier,
            rounding,
            lead,
            table_force,
            resonance: compliance(fourier, resonance_hz, feed.axial_damping_ratio),
            relative_acceleration: fourier.curvature(&signals.relative),
        }
    }

    fn shaped(spectrum: &[Complex64], by: &[Complex64]) -> Spectrum {
        spectrum.iter().zip(by).map(|(a, b)| a * b).collect()
    }

    fn spectrum_of(&self, value: impl Fn(usize) -> f64) -> Spectrum {
        let signal: Vec<f64> = (0..self.signals.len()).map(value).collect();
        self.fourier.spectrum(&signal)
    }

    /// The torque residuals under the declared model.
    pub fn torque_residual(&self) -> Contribution {
        let mut residual = Contribution::default();
        let signals = self.signals;
        let table = Self::shaped(&self.relative_acceleration, &self.resonance);
        let inertia = self.model.feed.table_mass_kg * self.lead * self.lead;
        for axis in Axis::ALL {
            let (motor, s) = (self.model.motor(axis), &signals.motors[axis.index()]);
            let pole_pairs = f64::from(motor.pole_pairs);
            let torque = self.spectrum_of(|k| {
                let harmonics: f64 = motor
                    .torque_harmonics
                    .iter()
                    .map(|h| {
                        h.amplitude_nm * (h.order * pole_pairs * s.theta[k] + h.phase_rad).cos()
                    })
                    .sum();
                pole_pairs * motor.flux_wb * s.i_q[k] + harmonics
                    - motor.viscous_nm_s * s.omega[k]
                    - motor.coulomb_nm * rounded_sign(s.omega[k], self.rounding.bearing)
                    - brake(axis) * self.lead * self.table_force[k]
                    - brake(axis)
                        * self.model.feed.pair_coulomb_nm
                        * rounded_sign(signals.relative_speed[k], self.rounding.pair)
            });
            let channel = Channel::Torque(axis);
            residual.add(channel, 1.0, &torque);
            residual.add(
                channel,
                -motor.inertia_kg_m2,
                &self.fourier.curvature(&s.travel),
            );
            residual.add(channel, -brake(axis) * inertia, &table);
        }
        residual
    }

    /// The voltage residuals of both motors under the declared model.
    fn voltage_residual(&self) -> Contribution {
        let mut residual = Contribution::default();
        for axis in Axis::ALL {
            let (motor, s) = (self.model.motor(axis), &self.signals.motors[axis.index()]);
            let omega_e = |k: usize| f64::from(motor.pole_pairs) * s.omega[k];
            let d = self.spectrum_of(|k| {
                s.u_d[k] - motor.resistance_ohm * s.i_d[k]
                    + omega_e(k) * motor.inductance_h * s.i_q[k]
            });
            residual.add(Channel::VoltageD(axis), 1.0, &d);
            residual.add(
                Channel::VoltageD(axis),
                -motor.inductance_h,
                &self.fourier.slope(&s.i_d),
            );
            let q = self.spectrum_of(|k| {
                s.u_q[k]
                    - motor.resistance_ohm * s.i_q[k]
                    - omega_e(k) * (motor.inductance_h * s.i_d[k] + motor.flux_wb)
            });
            residual.add(Channel::VoltageQ(axis), 1.0, &q);
            residual.add(
                Channel::VoltageQ(axis),
                -motor.inductance_h,
                &self.fourier.slope(&s.i_q),
            );
        }
        residual
    }

    /// The residual of every channel under the declared model, its declared effects included.
    pub fn residual(&self) -> Contribution {
        let mut residual = self.torque_residual();
        residual.add_all(1.0, &self.voltage_residual());
        residual.add_all(
            1.0,
            &self.table(self.model.feed.axial_stiffness_n_per_m, &self.resonance),
        );
        for effect in &self.model.effects {
            residual.add_all(-1.0, &self.effect(effect));
        }
        residual
    }

    /// Residual of the table on a screw of a given stiffness.
    fn table(&self, stiffness: f64, resonance: &[Complex64]) -> Contribution {
        let signals = self.signals;
        let mut residual = Contribution::default();
        let rigid = self
            .spectrum_of(|k| signals.table[k] - signals.table[0] - self.lead * signals.relative[k]);
        residual.add(Channel::Table, 1.0, &rigid);
        let mass = self.model.feed.table_mass_kg;
        let dynamic = Self::shaped(&self.relative_acceleration, resonance);
        residual.add(Channel::Table, self.lead * mass / stiffness, &dynamic);
        let force = Self::shaped(&self.fourier.spectrum(&self.table_force), resonance);
        residual.add(Channel::Table, 1.0 / stiffness, &force);
        residual
    }

    /// What a change of the bearing's, pair's or guideway's friction level of `level(k)` at row `k` adds.
    fn guideway(&self, force: &[f64]) -> Contribution {
        let mut sum = Contribution::default();
        let spectrum = self.fourier.spectrum(force);
        for axis in Axis::ALL {
            sum.add(Channel::Torque(axis), brake(axis) * self.lead, &spectrum);
        }
        let stiffness = self.model.feed.axial_stiffness_n_per_m;
        sum.add(
            Channel::Table,
            -1.0 / stiffness,
            &Self::shaped(&spectrum, &self.resonance),
        );
        sum
    }

    /// What relative changes of the declared parameters, and nuisances of the record, add to the residuals.
    pub fn parameter(&self, parameter: Parameter) -> Contribution {
        let mut sum = Contribution::default();
        let signals = self.signals;
        let feed = &self.model.feed;
        match parameter {
            Parameter::Motor(axis, which) => {
                let (motor, s) = (self.model.motor(axis), &signals.motors[axis.index()]);
                let pole_pairs = f64::from(motor.pole_pairs);
                let (torque, d, q) = (
                    Channel::Torque(axis),
                    Channel::VoltageD(axis),
                    Channel::VoltageQ(axis),
                );
                let omega_e = |k: usize| pole_pairs * s.omega[k];
                match which {
                    MotorParameter::Inertia => {
                        sum.add(
                            torque,
                            motor.inertia_kg_m2,
                            &self.fourier.curvature(&s.travel),
                        );
                    }
                    MotorParameter::Viscous => {
                        sum.add(torque, motor.viscous_nm_s, &self.fourier.spectrum(&s.omega));
                    }
                    MotorParameter::Coulomb => {
                        let sign = |k: usize| rounded_sign(s.omega[k], self.rounding.bearing);
                        sum.add(torque, motor.coulomb_nm, &self.spectrum_of(sign));
                    }
                    MotorParameter::Flux => {
                        sum.add(
                            torque,
                            -pole_pairs * motor.flux_wb,
                            &self.fourier.spectrum(&s.i_q),
                        );
                        sum.add(q, motor.flux_wb, &self.spectrum_of(omega_e));
                    }
                    MotorParameter::Resistance => {
                        sum.add(
                            q,
                            motor.resistance_ohm,
                            &self.fourier.spectrum(&s.i_q_smooth),
                        );
                    }
                    MotorParameter::Inductance => {
                        let cross = self.spectrum_of(|k| omega_e(k) * s.i_q_smooth[k]);
                        sum.add(d, -motor.inductance_h, &cross);
                    }
                    MotorParameter::CurrentSlope => {
                        sum.add(d, motor.inductance_h, &self.fourier.slope(&s.i_d));
                        sum.add(q, motor.inductance_h, &self.fourier.slope(&s.i_q));
                    }
                    MotorParameter::ReadingLag => {
                        sum.add(
                            Channel::Table,
                            brake(axis) * self.lead,
                            &self.fourier.slope(&s.travel),
                        );
                    }
                    MotorParameter::VoltageLag => {
                        sum.add(
                            q,
                            motor.inductance_h,
                            &self.fourier.curvature(&s.i_q_smooth),
                        );
                    }
                    MotorParameter::AngleLag => {
                        sum.add(d, -1.0, &self.spectrum_of(|k| omega_e(k) * s.u_q[k]));
                        sum.add(q, 1.0, &self.spectrum_of(|k| omega_e(k) * s.u_d[k]));
                    }
                }
            }
            Parameter::Pair => {
                let spectrum = self
                    .spectrum_of(|k| rounded_sign(signals.relative_speed[k], self.rounding.pair));
                for axis in Axis::ALL {
                    sum.add(
                        Channel::Torque(axis),
                        brake(axis) * feed.pair_coulomb_nm,
                        &spectrum,
                    );
                }
            }
            Parameter::GuidewayCoulomb => {
                let force: Vec<f64> = signals
                    .relative_speed
                    .iter()
                    .map(|&w| feed.guideway_coulomb_n * rounded_sign(w, self.rounding.guideway))
                    .collect();
                sum = self.guideway(&force);
            }
            Parameter::GuidewayViscous => {
                let force: Vec<f64> = signals
                    .relative_speed
                    .iter()
                    .map(|w| feed.guideway_viscous_n_s_per_m * self.lead * w)
                    .collect();
                sum = self.guideway(&force);
            }
            Parameter::Load => sum = self.guideway(&vec![feed.load_n; signals.len()]),
            Parameter::RestOffset { from, to } => {
                let inside = |k: usize| if (from..to).contains(&k) { 1.0 } else { 0.0 };
                sum.add(Channel::Table, 1.0, &self.spectrum_of(inside));
            }
            Parameter::TableOrigin { .. } => {
                sum.add(Channel::Table, 1.0, &self.spectrum_of(|_| 1.0))
            }
        }
        sum
    }

    /// What an effect at its place would add to the residuals of a machine that has it.
    pub fn effect(&self, effect: &EffectModel) -> Contribution {
        let mut sum = Contribution::default();
        for term in effect.effect().terms() {
            match effect.place() {
                Place::Feed => self.feed_term(&term, &mut sum),
                place => {
                    for axis in Axis::ALL.into_iter().filter(|&axis| place.has(axis)) {
                        self.motor_term(axis, &term, &mut sum);
                    }
                }
            }
        }
        sum
    }

    fn motor_term(&self, axis: Axis, term: &Term, sum: &mut Contribution) {
        let (motor, s) = (self.model.motor(axis), &self.signals.motors[axis.index()]);
        let pole_pairs = f64::from(motor.pole_pairs);
        let (torque, q) = (Channel::Torque(axis), Channel::VoltageQ(axis));
        let omega_e = |k: usize| pole_pairs * s.omega[k];
        let law = &term.law;
        let value = |k: usize| match term.coordinate {
            Coordinate::None => law.value(0.0),
            Coordinate::ElectricalAngle => law.value(pole_pairs * s.theta[k]),
            Coordinate::MechanicalAngle => law.value(s.theta[k]),
            Coordinate::Time => law.value(self.signals.time[k]),
            Coordinate::Speed => law.value(s.omega[k]),
            // These belong to the feed; no motor's term has them.
            _ => 0.0,
        };
        match term.site {
            Site::ShaftTorque => sum.add(torque, -1.0, &self.spectrum_of(value)),
            Site::Flux => {
                let constant = pole_pairs * motor.flux_wb;
                sum.add(
                    torque,
                    -constant,
                    &self.spectrum_of(|k| value(k) * s.i_q_smooth[k]),
                );
                sum.add(
                    q,
                    motor.flux_wb,
                    &self.spectrum_of(|k| value(k) * omega_e(k)),
                );
            }
            Site::Resistance => {
                sum.add(
                    q,
                    motor.resistance_ohm,
                    &self.spectrum_of(|k| value(k) * s.i_q_smooth[k]),
                );
            }
            Site::CurrentReadingA | Site::CurrentReadingB => {
                let phase = usize::from(term.site == Site::CurrentReadingB);
                let error = |k: usize| match term.coordinate {
                    Coordinate::PhaseCurrent => law.value(s.phases[phase][k]),
                    _ => value(k),
                };
                self.reading(axis, phase, &error, sum);
            }
            Site::PhaseVoltage => {
                let round = self
                    .model
                    .sensing
                    .current_noise_a
                    .max(self.model.sensing.current_lsb_a);
                self.phase_voltage(axis, law.value(1.0), round, sum);
            }
            Site::EncoderReading => {
                let error: Vec<f64> = (0..self.signals.len()).map(value).collect();
                self.encoder(axis, &error, sum);
            }
            Site::Friction => {
                let friction =
                    |k: usize| value(k) * rounded_sign(s.omega[k], self.rounding.bearing);
                sum.add(torque, 1.0, &self.spectrum_of(friction));
            }
            // These belong to the feed; no motor's term has them.
            _ => {}
        }
    }

    /// A voltage of `size` that each phase loses against the sign of its current. Over the ripple and noise of a current
    /// near zero the mean of a sign is a rounded one, over `round` A.
    pub fn phase_voltage(&self, axis: Axis, size: f64, round: f64, sum: &mut Contribution) {
        let s = &self.signals.motors[axis.index()];
        let (lost_d, lost_q): (Vec<f64>, Vec<f64>) = (0..self.signals.len())
            .map(|k| {
                let (a, b) = (s.phases[0][k], s.phases[1][k]);
                let [a, b, c] = [a, b, -a - b].map(|i| size * rounded_sign(i, round));
                let mean = (a + b + c) / 3.0;
                park(clarke(a - mean, b - mean), s.rotor[k])
            })
            .unzip();
        sum.add(
            Channel::VoltageD(axis),
            -1.0,
            &self.fourier.spectrum(&lost_d),
        );
        sum.add(
            Channel::VoltageQ(axis),
            -1.0,
            &self.fourier.spectrum(&lost_q),
        );
    }

    /// An error of a phase current's reading shows as torque that is not there and in the voltages that the true
    /// current did not need.
    fn reading(
        &self,
        axis: Axis,
        phase: usize,
        error: &dyn Fn(usize) -> f64,
        sum: &mut Contribution,
    ) {
        let (motor, s) = (self.model.motor(axis), &self.signals.motors[axis.index()]);
        let n = self.signals.len();
        let value: Vec<f64> = (0..n).map(error).collect();
        let rate = crate::fourier::slope(&value, self.signals.rate);
        let two_phase = |x: f64| {
            if phase == 0 {
                clarke(x, 0.0)
            } else {
                clarke(0.0, x)
            }
        };
        let (mut torque, mut d, mut q) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        for k in 0..n {
            let (read_d, read_q) = park(two_phase(value[k]), s.rotor[k]);
            let (rate_d, rate_q) = park(two_phase(rate[k]), s.rotor[k]);
            torque[k] = read_q;
            d[k] = motor.resistance_ohm * read_d + motor.inductance_h * rate_d;
            q[k] = motor.resistance_ohm * read_q + motor.inductance_h * rate_q;
        }
        let constant = f64::from(motor.pole_pairs) * motor.flux_wb;
        sum.add(
            Channel::Torque(axis),
            constant,
            &self.fourier.spectrum(&torque),
        );
        sum.add(Channel::VoltageD(axis), -1.0, &self.fourier.spectrum(&d));
        sum.add(Channel::VoltageQ(axis), -1.0, &self.fourier.spectrum(&q));
    }

    /// An error of the angle's reading shows in every balance that uses the angle.
    fn encoder(&self, axis: Axis, error: &[f64], sum: &mut Contribution) {
        let (motor, s) = (self.model.motor(axis), &self.signals.motors[axis.index()]);
        let pole_pairs = f64::from(motor.pole_pairs);
        let torque = Channel::Torque(axis);
        let curvature = self.fourier.curvature(error);
        // The travel counts from the first row, whose reading has the error too.
        let travel: Vec<f64> = error.iter().map(|e| e - error[0]).collect();
        sum.add(torque, -motor.inertia_kg_m2, &curvature);
        let harmonics = self.spectrum_of(|k| {
            let slope: f64 = motor
                .torque_harmonics
                .iter()
                .map(|h| {
                    let order = h.order * pole_pairs;
                    -h.amplitude_nm * order * (order * s.theta[k] + h.phase_rad).sin()
                })
                .sum();
            slope * error[k]
        });
        sum.add(torque, 1.0, &harmonics);
        let rate = crate::fourier::slope(error, self.signals.rate);
        let emf = pole_pairs * motor.flux_wb;
        sum.add(
            Channel::VoltageD(axis),
            emf,
            &self.spectrum_of(|k| pole_pairs * s.omega[k] * error[k]),
        );
        sum.add(Channel::VoltageQ(axis), -emf, &self.fourier.spectrum(&rate));
        let side = brake(axis);
        sum.add(
            Channel::Table,
            -side * self.lead,
            &self.fourier.spectrum(&travel),
        );
        let feed = &self.model.feed;
        let dynamic = Self::shaped(&curvature, &self.resonance);
        let scale = self.lead * feed.table_mass_kg / feed.axial_stiffness_n_per_m;
        sum.add(Channel::Table, side * scale, &dynamic);
    }

    fn feed_term(&self, term: &Term, sum: &mut Contribution) {
        let signals = self.signals;
        let law = &term.law;
        let value = |k: usize| match term.coordinate {
            Coordinate::RelativeAngle => {
                law.value(signals.motors[0].theta[k] - signals.motors[1].theta[k])
            }
            Coordinate::NominalTravel => law.value(self.lead * signals.relative[k]),
            Coordinate::TablePosition => law.value(signals.table[k]),
            Coordinate::Speed => law.value(self.lead * signals.relative_speed[k]),
            Coordinate::Time => law.value(signals.time[k]),
            _ => law.value(0.0),
        };
        match term.site {
            Site::Travel => {
                let origin = value(0);
                sum.add(
                    Channel::Table,
                    1.0,
                    &self.spectrum_of(|k| value(k) - origin),
                );
            }
            Site::PairTorque => {
                let spectrum = self.spectrum_of(value);
                for axis in Axis::ALL {
                    sum.add(Channel::Torque(axis), brake(axis), &spectrum);
                }
            }
            Site::TableForce => {
                let force: Vec<f64> = (0..signals.len()).map(value).collect();
                sum.add_all(1.0, &self.guideway(&force));
            }
            Site::Friction => {
                let force: Vec<f64> = (0..signals.len())
                    .map(|k| {
                        value(k) * rounded_sign(signals.relative_speed[k], self.rounding.guideway)
                    })
                    .collect();
                sum.add_all(1.0, &self.guideway(&force));
            }
            Site::AxialResonance => sum.add_all(1.0, &self.softer(law.value(0.0))),
            Site::AxialGap => sum.add_all(1.0, &self.gap(law.value(0.0))),
            // These belong to a motor; no term of the feed has them.
            _ => {}
        }
    }

    /// The declared screw's residual of the table less that of one with another resonance.
    fn softer(&self, hz: f64) -> Contribution {
        let feed = &self.model.feed;
        let resonance = compliance(self.fourier, hz, feed.axial_damping_ratio);
        let stiffness = feed.table_mass_kg * (TAU * hz).powi(2);
        let mut difference = self.table(feed.axial_stiffness_n_per_m, &self.resonance);
        difference.add_all(-1.0, &self.table(stiffness, &resonance));
        let inertia = feed.table_mass_kg * self.lead * self.lead;
        let change: Spectrum = resonance
            .iter()
            .zip(&self.resonance)
            .map(|(new, old)| new - old)
            .collect();
        let table = Self::shaped(&self.relative_acceleration, &change);
        for axis in Axis::ALL {
            difference.add(Channel::Torque(axis), brake(axis) * inertia, &table);
        }
        difference
    }

    /// Play that shows where the table turns: it follows the thread half the gap behind.
    pub fn play(&self, width: f64) -> Contribution {
        let mut sum = Contribution::default();
        let lag = |k: usize| {
            -0.5 * width * rounded_sign(self.signals.relative_speed[k], self.rounding.guideway)
        };
        sum.add(Channel::Table, 1.0, &self.spectrum_of(lag));
        sum
    }

    /// Play under a load: the table lies on the flank that the force on it chooses, half the gap from the middle where
    /// it started.
    fn gap(&self, width: f64) -> Contribution {
        let mut sum = Contribution::default();
        let rest = 0.02 * self.model.feed.guideway_coulomb_n;
        let flank = |k: usize| -0.5 * width * rounded_sign(self.table_force[k], rest.max(1e-9));
        sum.add(Channel::Table, 1.0, &self.spectrum_of(flank));
        sum
    }
}

/// A declared parameter, or a nuisance of the record, that is adjusted before any effect is looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Parameter {
    /// Of one motor.
    Motor(Axis, MotorParameter),
    /// Coulomb friction of the pair.
    Pair,
    /// Coulomb friction of the guideway.
    GuidewayCoulomb,
    /// Viscous friction of the guideway.
    GuidewayViscous,
    /// Load force.
    Load,
    /// Where the table's scale has its zero, m. `relaxed` if the record starts with the axial spring relaxed, so that
    /// the first row tells it.
    TableOrigin {
        /// See above.
        relaxed: bool,
    },
    /// While a motor rests its encoder's rounding does not average out: an offset of the table over those rows, m.
    RestOffset {
        /// First row.
        from: usize,
        /// Row after the last.
        to: usize,
    },
}

/// See [`Parameter`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MotorParameter {
    /// `inertia_kg_m2`, relative.
    Inertia,
    /// `viscous_nm_s`, relative.
    Viscous,
    /// `coulomb_nm`, relative.
    Coulomb,
    /// `flux_wb`, relative.
    Flux,
    /// `resistance_ohm`, relative.
    Resistance,
    /// `inductance_h`, relative, by the cross-coupling that it makes at speed.
    Inductance,
    /// The inductance's part in front of the current's derivative, relative. The sensors' noise, which the loop answers
    /// with voltage, biases it: a nuisance.
    CurrentSlope,
    /// Time by which the angle is read before or after the table, s: a nuisance. Drives whose two current loops are
    /// half a period apart read the angles so.
    ReadingLag,
    /// Time by which the commanded voltages are later than the currents, s: a nuisance.
    VoltageLag,
    /// Time by which the frame of the commanded voltages is off, s: a nuisance.
    AngleLag,
}

impl Parameter {
    /// All that a model file declares, and the motors' nuisances.
    pub fn all() -> Vec<Parameter> {
        use MotorParameter::*;
        let mut all = Vec::new();
        for axis in Axis::ALL {
            for which in [
                Inertia,
                Viscous,
                Coulomb,
                Flux,
                Resistance,
                Inductance,
                CurrentSlope,
                VoltageLag,
                AngleLag,
                ReadingLag,
            ] {
                all.push(Parameter::Motor(axis, which));
            }
        }
        use Parameter::*;
        all.extend([Pair, GuidewayCoulomb, GuidewayViscous, Load]);
        all
    }

    /// Whether it is the machine's and not the record's.
    pub fn is_of_the_machine(self) -> bool {
        !matches!(
            self,
            Parameter::TableOrigin { .. } | Parameter::RestOffset { .. }
        )
    }

    /// Whether it shows in a torque balance.
    pub fn is_torque(self) -> bool {
        use MotorParameter::*;
        match self {
            Parameter::Motor(_, which) => matches!(which, Inertia | Viscous | Coulomb | Flux),
            Parameter::TableOrigin { .. } | Parameter::RestOffset { .. } => false,
            _ => true,
        }
    }

    /// How far the parameter may lie from its declared value: the tolerance of plate values (3 % of resistance,
    /// inductance, inertia; 1 % of flux; 20 % of friction), with a tenth more for what the record adds.
    pub fn bound(self) -> f64 {
        match self {
            Parameter::Motor(_, which) => match which {
                MotorParameter::Inertia
                | MotorParameter::Resistance
                | MotorParameter::Inductance => 0.033,
                MotorParameter::Flux => 0.011,
                MotorParameter::Viscous | MotorParameter::Coulomb => 0.22,
                MotorParameter::CurrentSlope => 0.4,
                MotorParameter::AngleLag => 2e-5,
                MotorParameter::VoltageLag | MotorParameter::ReadingLag => 1e-4,
            },
            Parameter::Pair | Parameter::GuidewayCoulomb | Parameter::GuidewayViscous => 0.22,
            Parameter::Load => 0.005,
            Parameter::TableOrigin { relaxed } => {
                if relaxed {
                    2e-7
                } else {
                    1e-2
                }
            }
            Parameter::RestOffset { .. } => 1e-6,
        }
    }

    /// Standard deviation of the parameter before the record is seen: that of an even spread over its bounds.
    pub fn spread(self) -> f64 {
        match self {
            Parameter::TableOrigin { relaxed: true } => 4e-8,
            Parameter::TableOrigin { relaxed: false } => 1e-2,
            Parameter::RestOffset { .. } => 1.5e-8,
            _ => self.bound() / 3.0_f64.sqrt(),
        }
    }
}
