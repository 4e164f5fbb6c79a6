//! One motor: windings, torque, and what its sensors read.

use super::clarke::{clarke, inverse_clarke};
use super::harmonics::{Harmonics, Powers};
use super::winding::{self, Bridge, Response, Stepped};
use crate::Axis;
use crate::effects::{Coordinate, Law, Site, Term};
use crate::model::Model;

/// The state of one motor.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MotorState {
    /// True mechanical angle, rad, many turns.
    pub theta: f64,
    /// Mechanical speed, rad/s.
    pub omega: f64,
    /// Current, power-invariant, A.
    pub i_alpha: f64,
    /// Current, power-invariant, A.
    pub i_beta: f64,
}

#[derive(Debug, Clone)]
pub(super) struct Motor {
    pub(super) state: MotorState,
    /// Mean acceleration of the last step, rad/s^2: it predicts the speed at the middle of the next.
    pub(super) acceleration: f64,
    pub(super) inertia: f64,
    pub(super) viscous: f64,
    pub(super) coulomb: f64,
    pub(super) load_torque: f64,
    pub(super) disturbance_torque: f64,
    pole_pairs: f64,
    resistance: f64,
    inductance: f64,
    flux: f64,
    bridge: Bridge,
    /// Voltage of a driven bridge, alpha and beta.
    voltage: [f64; 2],
    response: Response,
    terms: MotorTerms,
}

/// The terms that act on one motor, sorted by site and coordinate.
#[derive(Debug, Clone, Default)]
struct MotorTerms {
    electrical_torque: Harmonics,
    electrical_flux: Harmonics,
    mechanical_torque: Harmonics,
    electrical_bits: usize,
    mechanical_bits: usize,
    timed_torque: Vec<Law>,
    timed_flux: Vec<Law>,
    timed_resistance: Vec<Law>,
    friction: Vec<Law>,
    lost_voltage: f64,
    encoder: Vec<Law>,
    reading: [Vec<Law>; 2],
}

impl MotorTerms {
    fn add(&mut self, term: Term) {
        match (term.site, term.coordinate) {
            (Site::ShaftTorque, Coordinate::ElectricalAngle) => {
                self.electrical_torque.push(term.law)
            }
            (Site::ShaftTorque, Coordinate::MechanicalAngle) => {
                self.mechanical_torque.push(term.law)
            }
            (Site::ShaftTorque, Coordinate::Time) => self.timed_torque.push(term.law),
            (Site::Flux, Coordinate::ElectricalAngle) => self.electrical_flux.push(term.law),
            (Site::Flux, Coordinate::Time) => self.timed_flux.push(term.law),
            (Site::Resistance, Coordinate::Time) => self.timed_resistance.push(term.law),
            (Site::Friction, Coordinate::Speed) => self.friction.push(term.law),
            (Site::PhaseVoltage, Coordinate::PhaseCurrent) => {
                // The law's value at a positive current is what that current loses.
                self.lost_voltage -= term.law.value(1.0);
            }
            (Site::EncoderReading, Coordinate::MechanicalAngle) => self.encoder.push(term.law),
            (Site::CurrentReadingA, _) => self.reading[0].push(term.law),
            (Site::CurrentReadingB, _) => self.reading[1].push(term.law),
            (site, coordinate) => {
                debug_assert!(
                    false,
                    "no motor takes a term at {site:?} over {coordinate:?}"
                );
            }
        }
    }
}

/// Sum of laws at one coordinate.
#[inline]
pub(super) fn sum(laws: &[Law], x: f64) -> f64 {
    laws.iter().map(|law| law.value(x)).sum()
}

impl Motor {
    pub(super) fn new(model: &Model, axis: Axis) -> Self {
        let motor = model.motor(axis);
        let mut terms = MotorTerms::default();
        for harmonic in &motor.torque_harmonics {
            let (order, amplitude) = (harmonic.order, harmonic.amplitude_nm);
            terms.electrical_torque.push(Law::Periodic {
                order,
                amplitude,
                phase: harmonic.phase_rad,
            });
        }
        for effect in model
            .effects
            .iter()
            .filter(|effect| effect.place().has(axis))
        {
            effect
                .effect()
                .terms()
                .into_iter()
                .for_each(|term| terms.add(term));
        }
        terms.electrical_bits = terms
            .electrical_torque
            .bits()
            .max(terms.electrical_flux.bits());
        terms.mechanical_bits = terms.mechanical_torque.bits();
        Motor {
            state: MotorState::default(),
            acceleration: 0.0,
            inertia: motor.inertia_kg_m2,
            viscous: motor.viscous_nm_s,
            coulomb: motor.coulomb_nm,
            load_torque: 0.0,
            disturbance_torque: 0.0,
            pole_pairs: f64::from(motor.pole_pairs),
            resistance: motor.resistance_ohm,
            inductance: motor.inductance_h,
            flux: motor.flux_wb,
            bridge: Bridge::Open,
            voltage: [0.0; 2],
            response: Response::new(motor.resistance_ohm, motor.inductance_h, 25e-6),
            terms,
        }
    }

    pub(super) fn set_bridge(&mut self, bridge: Bridge) {
        self.bridge = bridge;
        if let Bridge::Driven(phases) = bridge {
            self.voltage = clarke(phases);
        }
    }

    /// Computes what depends on the length of the step.
    pub(super) fn prepare(&mut self, dt: f64) {
        self.response = Response::new(self.resistance, self.inductance, dt);
    }

    /// Steps the currents around the angle at the middle of the step, `theta`, and returns the mean torque on the
    /// shaft, N m, without friction.
    #[inline]
    pub(super) fn step_currents(&mut self, dt: f64, time: f64, theta: f64, half_bus: f64) -> f64 {
        let omega = self.state.omega + 0.5 * dt * self.acceleration;
        let powers = Powers::new(self.pole_pairs * theta, self.terms.electrical_bits);
        let terms = &self.terms;
        let flux =
            self.flux * (1.0 + terms.electrical_flux.sum(&powers) + sum(&terms.timed_flux, time));
        if !terms.timed_resistance.is_empty() {
            let resistance = self.resistance * (1.0 + sum(&terms.timed_resistance, time));
            self.response = Response::new(resistance, self.inductance, dt);
        }
        let torque_per_ampere = self.pole_pairs * flux;
        let emf = [
            -torque_per_ampere * omega * powers.sin,
            torque_per_ampere * omega * powers.cos,
        ];
        let current = [self.state.i_alpha, self.state.i_beta];
        let net = [self.voltage[0] - emf[0], self.voltage[1] - emf[1]];
        let Stepped { current, mean } = match self.bridge {
            Bridge::Open => winding::open(current, emf, half_bus, &self.response),
            Bridge::Driven(_) if terms.lost_voltage > 0.0 => {
                winding::driven_with_loss(current, net, terms.lost_voltage, &self.response)
            }
            Bridge::Driven(_) => winding::driven(current, net, &self.response),
        };
        [self.state.i_alpha, self.state.i_beta] = current;
        let mut torque = torque_per_ampere * (powers.cos * mean[1] - powers.sin * mean[0]);
        torque += terms.electrical_torque.sum(&powers) + self.disturbance_torque - self.load_torque;
        if !terms.mechanical_torque.is_empty() {
            torque += terms
                .mechanical_torque
                .sum(&Powers::new(theta, terms.mechanical_bits));
        }
        torque + sum(&terms.timed_torque, time)
    }

    /// Level of the bearing's friction at the middle of the step, N m.
    #[inline]
    pub(super) fn friction_level(&self, half: f64) -> f64 {
        if self.terms.friction.is_empty() {
            return self.coulomb;
        }
        (self.coulomb
            + sum(
                &self.terms.friction,
                self.state.omega + half * self.acceleration,
            ))
        .max(0.0)
    }

    pub(super) fn phase_currents(&self) -> [f64; 3] {
        inverse_clarke([self.state.i_alpha, self.state.i_beta])
    }

    pub(super) fn current_readings(&self) -> [f64; 3] {
        let [a, b, c] = self.phase_currents();
        [
            a + sum(&self.terms.reading[0], a),
            b + sum(&self.terms.reading[1], b),
            c,
        ]
    }

    pub(super) fn encoder_angle(&self) -> f64 {
        self.state.theta + sum(&self.terms.encoder, self.state.theta)
    }
}
