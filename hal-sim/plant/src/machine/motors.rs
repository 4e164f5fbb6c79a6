//! Both motors: windings, torque, and what their sensors read.

use super::clarke::{clarke, inverse_clarke};
use super::friction::Kick;
use super::harmonics::{Harmonics, Phasors};
use super::pair::{Pair, each};
use super::winding::{self, Bridge, Response, Stepped};
use crate::Axis;
use crate::effects::{Coordinate, Law, Site, Term};
use crate::model::{Model, MotorModel};

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
pub(super) struct Motors {
    /// True mechanical angles, rad, many turns.
    pub(super) theta: Pair,
    /// Mechanical speeds, rad/s.
    pub(super) omega: Pair,
    /// Mean acceleration of the last step, rad/s^2: it predicts the speed at the middle of the next.
    pub(super) acceleration: Pair,
    /// Inertia and viscous friction over a step.
    pub(super) kick: Kick<Pair>,
    pub(super) load_torque: Pair,
    pub(super) disturbance_torque: Pair,
    /// Relative changes of resistance and flux from outside.
    pub(super) change: [Pair; 2],
    pub(super) pole_pairs: Pair,
    /// Alpha and beta, A.
    current: [Pair; 2],
    /// Of driven bridges, alpha and beta, V.
    voltage: [Pair; 2],
    response: Response<Pair>,
    flux: Pair,
    plates: [MotorModel; 2],
    bridges: [Bridge; 2],
    /// The direction in which current can flow where a phase is open, alpha and beta.
    open_phase: [Option<[f64; 2]>; 2],
    /// All of the winding's current flows, and to the voltage that its bridge holds.
    follows: [bool; 2],
    torque: [Harmonics; 2],
    flux_harmonics: Harmonics,
    /// One of the terms below depends on time.
    timed: bool,
    /// One of the terms below is a measured torque.
    measured: bool,
    terms: [MotorTerms; 2],
}

/// Coordinates of the harmonics of a torque.
const ANGLES: [Coordinate; 2] = [Coordinate::ElectricalAngle, Coordinate::MechanicalAngle];

/// The terms that act on one motor beside harmonics, sorted by site and coordinate.
#[derive(Debug, Clone, Default)]
struct MotorTerms {
    /// Measured torques over angle and over speed.
    torque_by_angle: Vec<Law>,
    torque_by_speed: Vec<Law>,
    timed_torque: Vec<Law>,
    timed_flux: Vec<Law>,
    timed_resistance: Vec<Law>,
    friction: Vec<Law>,
    lost_voltage: f64,
    encoder: Vec<Law>,
    reading: [Vec<Law>; 2],
}

/// Takes out of `terms` the laws at one site of one coordinate.
fn take(terms: &mut Vec<Term>, site: Site, coordinate: Coordinate) -> Vec<Law> {
    let here = terms.extract_if(.., |term| {
        (term.site, term.coordinate) == (site, coordinate)
    });
    here.map(|term| term.law).collect()
}

impl MotorTerms {
    fn new(mut terms: Vec<Term>, torque_by_angle: Vec<Law>) -> Self {
        let mut laws = |site, coordinate| take(&mut terms, site, coordinate);
        let sorted = MotorTerms {
            torque_by_angle,
            torque_by_speed: laws(Site::ShaftTorque, Coordinate::Speed),
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

    fn is_measured(&self) -> bool {
        !(self.torque_by_angle.is_empty() && self.torque_by_speed.is_empty())
    }

    fn is_timed(&self) -> bool {
        let timed = [&self.timed_torque, &self.timed_flux, &self.timed_resistance];
        timed.into_iter().any(|laws| !laws.is_empty())
    }
}

/// Sum of laws at one coordinate.
#[inline]
pub(super) fn sum(laws: &[Law], x: f64) -> f64 {
    laws.iter().map(|law| law.value(x)).sum()
}

/// All terms that act on the motor of `axis`.
fn terms(model: &Model, axis: Axis) -> Vec<Term> {
    let declared = model.motor(axis).torque_harmonics.iter().map(|harmonic| {
        let (order, amplitude, phase) = (harmonic.order, harmonic.amplitude_nm, harmonic.phase_rad);
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
    declared
        .chain(effects.flat_map(|effect| effect.effect().terms()))
        .collect()
}

impl Motors {
    pub(super) fn new(model: &Model) -> Self {
        let plates = Axis::ALL.map(|axis| model.motor(axis).clone());
        let mut terms = Axis::ALL.map(|axis| terms(model, axis));
        let mut by_angle = terms.each_mut().map(|terms| {
            let is_measured = |term: &mut Term| {
                term.coordinate == Coordinate::MechanicalAngle
                    && term.site == Site::ShaftTorque
                    && matches!(term.law, Law::Table { .. })
            };
            let here = terms.extract_if(.., is_measured);
            here.map(|term| term.law).collect::<Vec<_>>()
        });
        let mut harmonics = |site, coordinate| {
            Harmonics::new(terms.each_mut().map(|terms| take(terms, site, coordinate)))
        };
        let torque = ANGLES.map(|coordinate| harmonics(Site::ShaftTorque, coordinate));
        let flux_harmonics = harmonics(Site::Flux, Coordinate::ElectricalAngle);
        let terms = [0, 1].map(|k: usize| {
            let (own, by_angle) = (&mut terms[k], &mut by_angle[k]);
            MotorTerms::new(std::mem::take(own), std::mem::take(by_angle))
        });
        Motors {
            theta: Pair::ZERO,
            omega: Pair::ZERO,
            acceleration: Pair::ZERO,
            kick: Kick::default(),
            load_torque: Pair::ZERO,
            disturbance_torque: Pair::ZERO,
            change: [Pair::ZERO; 2],
            pole_pairs: each(|k| f64::from(plates[k].pole_pairs)),
            current: [Pair::ZERO; 2],
            voltage: [Pair::ZERO; 2],
            response: Response::default(),
            flux: each(|k| plates[k].flux_wb),
            plates,
            bridges: [Bridge::Open; 2],
            open_phase: [None; 2],
            follows: [false; 2],
            torque,
            flux_harmonics,
            timed: terms.iter().any(MotorTerms::is_timed),
            measured: terms.iter().any(MotorTerms::is_measured),
            terms,
        }
    }

    #[inline]
    pub(super) fn set_bridge(&mut self, k: usize, bridge: Bridge) {
        let [alpha, beta] = match bridge {
            Bridge::Driven(phases) => clarke(phases),
            Bridge::Shorted | Bridge::Open => [0.0; 2],
        };
        self.voltage[0].as_mut_array()[k] = alpha;
        self.voltage[1].as_mut_array()[k] = beta;
        self.bridges[k] = bridge;
        self.follows[k] = self.open_phase[k].is_none()
            && match bridge {
                Bridge::Driven(_) => self.terms[k].lost_voltage <= 0.0,
                Bridge::Shorted => true,
                Bridge::Open => false,
            };
    }

    /// Opens the lead of one phase, or closes all. Current then flows through the other two only.
    pub(super) fn set_open_phase(&mut self, k: usize, phase: Option<usize>) {
        self.open_phase[k] = phase.map(|phase| {
            let mut other_two = [1.0, -1.0, 0.0];
            other_two.rotate_right((phase + 1) % 3);
            let [alpha, beta] = clarke(other_two);
            let length = alpha.hypot(beta);
            [alpha / length, beta / length]
        });
        self.set_bridge(k, self.bridges[k]);
    }

    /// Computes what depends on the length of the step.
    #[cold]
    pub(super) fn prepare(&mut self, dt: f64) {
        self.set_resistance([0.0; 2], dt);
        self.kick = Kick::side_by_side(
            self.plates
                .each_ref()
                .map(|plate| Kick::new(plate.inertia_kg_m2, plate.viscous_nm_s, dt)),
        );
    }

    /// Takes relative changes of the resistances.
    #[inline(never)]
    fn set_resistance(&mut self, change: [f64; 2], dt: f64) {
        self.response = Response::side_by_side([0, 1].map(|k| {
            let plate = &self.plates[k];
            Response::new(
                plate.resistance_ohm * (1.0 + change[k]),
                plate.inductance_h,
                dt,
            )
        }));
    }

    /// Steps the currents around the angles at the middle of the step, `theta`, and returns the mean torques on the
    /// shafts, N m, without friction.
    #[inline]
    pub(super) fn step_currents(
        &mut self,
        dt: f64,
        time: f64,
        theta: Pair,
        electrical: &Phasors,
        half_bus: f64,
    ) -> Pair {
        let omega = self.omega + self.acceleration * (0.5 * dt);
        let mut change = self.flux_harmonics.value(electrical) + 1.0;
        if self.timed {
            change += each(|k| sum(&self.terms[k].timed_flux, time));
        }
        let flux = self.flux * (change + self.change[1]);
        if self.timed || self.change[0] != Pair::ZERO {
            let outside = self.change[0].to_array();
            let resistance =
                [0, 1].map(|k| sum(&self.terms[k].timed_resistance, time) + outside[k]);
            self.set_resistance(resistance, dt);
        }
        let torque_per_ampere = self.pole_pairs * flux;
        let of_speed = torque_per_ampere * omega;
        let emf = [-(of_speed * electrical.sin), of_speed * electrical.cos];
        let net = [self.voltage[0] - emf[0], self.voltage[1] - emf[1]];
        let Stepped { current, mean } = if self.follows == [true; 2] {
            winding::driven(self.current, net, &self.response)
        } else {
            self.step_one_by_one(net, emf, half_bus)
        };
        self.current = current;
        let mut torque = torque_per_ampere * (electrical.cos * mean[1] - electrical.sin * mean[0]);
        let [electrical_torque, mechanical_torque] = &self.torque;
        torque += electrical_torque.value(electrical) + self.disturbance_torque - self.load_torque;
        if !mechanical_torque.is_empty() {
            torque += mechanical_torque.value(&Phasors::new(theta));
        }
        if self.measured {
            let (theta, omega) = (theta.to_array(), omega.to_array());
            torque += each(|k| {
                let terms = &self.terms[k];
                sum(&terms.torque_by_angle, theta[k]) + sum(&terms.torque_by_speed, omega[k])
            });
        }
        if self.timed {
            torque += each(|k| sum(&self.terms[k].timed_torque, time));
        }
        torque
    }

    /// Steps the currents of motors of which one does not simply follow the voltage that its bridge holds.
    #[inline(never)]
    fn step_one_by_one(&self, net: [Pair; 2], emf: [Pair; 2], half_bus: f64) -> Stepped<Pair> {
        let stepped = [0, 1].map(|k| {
            let of = |pair: [Pair; 2]| pair.map(|part| part.to_array()[k]);
            let (response, lost) = (self.response.of(k), self.terms[k].lost_voltage);
            let (current, net) = (self.flowing(k, of(self.current)), self.flowing(k, of(net)));
            let Stepped { current, mean } = match self.bridges[k] {
                Bridge::Open => winding::open(current, of(emf), half_bus, &response),
                Bridge::Driven(_) if lost > 0.0 => {
                    winding::driven_with_loss(current, net, lost, &response)
                }
                Bridge::Driven(_) | Bridge::Shorted => winding::driven(current, net, &response),
            };
            [self.flowing(k, current), self.flowing(k, mean)]
        });
        let both = |which: usize| [0, 1].map(|part: usize| each(|k| stepped[k][which][part]));
        Stepped {
            current: both(0),
            mean: both(1),
        }
    }

    /// Opens the leads of all phases, or closes all.
    pub(super) fn set_disconnected(&mut self, k: usize, disconnected: bool) {
        self.open_phase[k] = disconnected.then_some([0.0; 2]);
        self.set_bridge(k, self.bridges[k]);
    }

    /// The part of a vector in which current can flow.
    #[inline]
    fn flowing(&self, k: usize, vector: [f64; 2]) -> [f64; 2] {
        let Some([alpha, beta]) = self.open_phase[k] else {
            return vector;
        };
        let along = alpha * vector[0] + beta * vector[1];
        [along * alpha, along * beta]
    }

    /// Level of the bearing's friction at the middle of the step, N m.
    #[inline]
    pub(super) fn friction_level(&self, k: usize, half: f64) -> f64 {
        let (coulomb, friction) = (self.plates[k].coulomb_nm, &self.terms[k].friction);
        if friction.is_empty() {
            return coulomb;
        }
        let omega = self.omega.to_array()[k] + half * self.acceleration.to_array()[k];
        (coulomb + sum(friction, omega)).max(0.0)
    }

    #[inline]
    pub(super) fn state(&self, k: usize) -> MotorState {
        let [i_alpha, i_beta] = self.current.map(|part| part.to_array()[k]);
        MotorState {
            theta: self.theta.to_array()[k],
            omega: self.omega.to_array()[k],
            i_alpha,
            i_beta,
        }
    }

    #[inline(always)]
    pub(super) fn phase_currents(&self, k: usize) -> [f64; 3] {
        inverse_clarke(self.current.map(|part| part.to_array()[k]))
    }

    #[inline(always)]
    pub(super) fn current_readings(&self, k: usize) -> [f64; 3] {
        let [a, b, c] = self.phase_currents(k);
        let [of_a, of_b] = &self.terms[k].reading;
        if of_a.is_empty() && of_b.is_empty() {
            return [a, b, c];
        }
        [a + sum(of_a, a), b + sum(of_b, b), c]
    }

    #[inline]
    pub(super) fn encoder_angle(&self, k: usize) -> f64 {
        let theta = self.theta.to_array()[k];
        theta + sum(&self.terms[k].encoder, theta)
    }
}
