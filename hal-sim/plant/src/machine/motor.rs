//! One motor: windings, torque, and what its sensors read.

use super::clarke::{clarke, inverse_clarke};
use super::friction::Kick;
use super::harmonics::{Harmonics, Phasor};
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
    /// Inertia and viscous friction over a step.
    pub(super) kick: Kick,
    inertia: f64,
    viscous: f64,
    coulomb: f64,
    pub(super) load_torque: f64,
    pub(super) disturbance_torque: f64,
    /// Relative changes of resistance and flux from outside.
    pub(super) change: [f64; 2],
    pub(super) pole_pairs: f64,
    resistance: f64,
    inductance: f64,
    flux: f64,
    bridge: Bridge,
    /// The direction in which current can flow where a phase is open, alpha and beta.
    open_phase: Option<[f64; 2]>,
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
    timed_torque: Vec<Law>,
    timed_flux: Vec<Law>,
    timed_resistance: Vec<Law>,
    friction: Vec<Law>,
    lost_voltage: f64,
    encoder: Vec<Law>,
    reading: [Vec<Law>; 2],
}

impl MotorTerms {
    fn new(mut terms: Vec<Term>) -> Self {
        let mut laws = |site, coordinate| -> Vec<Law> {
            let here = terms.extract_if(.., |term| {
                (term.site, term.coordinate) == (site, coordinate)
            });
            here.map(|term| term.law).collect()
        };
        let sorted = MotorTerms {
            electrical_torque: Harmonics::new(laws(Site::ShaftTorque, Coordinate::ElectricalAngle)),
            electrical_flux: Harmonics::new(laws(Site::Flux, Coordinate::ElectricalAngle)),
            mechanical_torque: Harmonics::new(laws(Site::ShaftTorque, Coordinate::MechanicalAngle)),
            timed_torque: laws(Site::ShaftTorque, Coordinate::Time),
            timed_flux: laws(Site::Flux, Coordinate::Time),
            timed_resistance: laws(Site::Resistance, Coordinate::Time),
            friction: laws(Site::Friction, Coordinate::Speed),
            // What a positive current loses.
            lost_voltage: -sum(&laws(Site::PhaseVoltage, Coordinate::PhaseCurrent), 1.0),
            encoder: laws(Site::EncoderReading, Coordinate::MechanicalAngle),
            reading: [Site::CurrentReadingA, Site::CurrentReadingB].map(|site| {
                [
                    laws(site, Coordinate::None),
                    laws(site, Coordinate::PhaseCurrent),
                ]
                .concat()
            }),
        };
        debug_assert!(terms.is_empty(), "no motor takes {terms:?}");
        sorted
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
        let declared = motor.torque_harmonics.iter().map(|harmonic| {
            let (order, amplitude, phase) =
                (harmonic.order, harmonic.amplitude_nm, harmonic.phase_rad);
            Term::periodic(
                Site::ShaftTorque,
                Coordinate::ElectricalAngle,
                order,
                amplitude,
                phase,
            )
        });
        let effects = model
            .effects
            .iter()
            .filter(|effect| effect.place().has(axis));
        let terms: Vec<Term> = declared
            .chain(effects.flat_map(|effect| effect.effect().terms()))
            .collect();
        Motor {
            state: MotorState::default(),
            acceleration: 0.0,
            kick: Kick::default(),
            inertia: motor.inertia_kg_m2,
            viscous: motor.viscous_nm_s,
            coulomb: motor.coulomb_nm,
            load_torque: 0.0,
            disturbance_torque: 0.0,
            change: [0.0; 2],
            pole_pairs: f64::from(motor.pole_pairs),
            resistance: motor.resistance_ohm,
            inductance: motor.inductance_h,
            flux: motor.flux_wb,
            bridge: Bridge::Open,
            open_phase: None,
            voltage: [0.0; 2],
            response: Response::default(),
            terms: MotorTerms::new(terms),
        }
    }

    #[inline]
    pub(super) fn set_bridge(&mut self, bridge: Bridge) {
        self.bridge = bridge;
        match bridge {
            Bridge::Driven(phases) => self.voltage = clarke(phases),
            Bridge::Shorted => self.voltage = [0.0; 2],
            Bridge::Open => {}
        }
    }

    /// Opens the lead of one phase, or closes all. Current then flows through the other two only.
    pub(super) fn set_open_phase(&mut self, phase: Option<usize>) {
        self.open_phase = phase.map(|phase| {
            let mut other_two = [1.0, -1.0, 0.0];
            other_two.rotate_right((phase + 1) % 3);
            let [alpha, beta] = clarke(other_two);
            let length = alpha.hypot(beta);
            [alpha / length, beta / length]
        });
    }

    /// Computes what depends on the length of the step.
    pub(super) fn prepare(&mut self, dt: f64) {
        self.response = Response::new(self.resistance, self.inductance, dt);
        self.kick = Kick::new(self.inertia, self.viscous, dt);
    }

    /// Steps the currents around the angle at the middle of the step, `theta`, and returns the mean torque on the
    /// shaft, N m, without friction.
    #[inline]
    pub(super) fn step_currents(
        &mut self,
        dt: f64,
        time: f64,
        theta: f64,
        electrical: Phasor,
        half_bus: f64,
    ) -> f64 {
        let omega = self.state.omega + 0.5 * dt * self.acceleration;
        let terms = &self.terms;
        let flux = self.flux
            * (1.0
                + terms.electrical_flux.value(electrical)
                + sum(&terms.timed_flux, time)
                + self.change[1]);
        if !terms.timed_resistance.is_empty() || self.change[0] != 0.0 {
            let resistance =
                self.resistance * (1.0 + sum(&terms.timed_resistance, time) + self.change[0]);
            self.response = Response::new(resistance, self.inductance, dt);
        }
        let torque_per_ampere = self.pole_pairs * flux;
        let emf = [
            -torque_per_ampere * omega * electrical.sin,
            torque_per_ampere * omega * electrical.cos,
        ];
        let current = [self.state.i_alpha, self.state.i_beta];
        let net = [self.voltage[0] - emf[0], self.voltage[1] - emf[1]];
        let (current, net) = (self.flowing(current), self.flowing(net));
        let Stepped { current, mean } = match self.bridge {
            Bridge::Open => winding::open(current, emf, half_bus, &self.response),
            Bridge::Driven(_) if terms.lost_voltage > 0.0 => {
                winding::driven_with_loss(current, net, terms.lost_voltage, &self.response)
            }
            Bridge::Driven(_) | Bridge::Shorted => winding::driven(current, net, &self.response),
        };
        let (current, mean) = (self.flowing(current), self.flowing(mean));
        [self.state.i_alpha, self.state.i_beta] = current;
        let mut torque = torque_per_ampere * (electrical.cos * mean[1] - electrical.sin * mean[0]);
        torque +=
            terms.electrical_torque.value(electrical) + self.disturbance_torque - self.load_torque;
        if !terms.mechanical_torque.is_empty() {
            torque += terms.mechanical_torque.value(Phasor::new(theta));
        }
        torque + sum(&terms.timed_torque, time)
    }

    /// The part of a vector in which current can flow.
    #[inline]
    fn flowing(&self, vector: [f64; 2]) -> [f64; 2] {
        let Some([alpha, beta]) = self.open_phase else {
            return vector;
        };
        let along = alpha * vector[0] + beta * vector[1];
        [along * alpha, along * beta]
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

    #[inline]
    pub(super) fn phase_currents(&self) -> [f64; 3] {
        inverse_clarke([self.state.i_alpha, self.state.i_beta])
    }

    #[inline]
    pub(super) fn current_readings(&self) -> [f64; 3] {
        let [a, b, c] = self.phase_currents();
        [
            a + sum(&self.terms.reading[0], a),
            b + sum(&self.terms.reading[1], b),
            c,
        ]
    }

    #[inline]
    pub(super) fn encoder_angle(&self) -> f64 {
        self.state.theta + sum(&self.terms.encoder, self.state.theta)
    }
}
