//! The axis as a model: mass, friction, what repeats with the screw, the amplifier's lag; and its closed loop.

use super::record::{RATE, Record};
use std::f64::consts::TAU;

/// Travel per turn of the motor, m.
pub(super) const LEAD_M: f64 = 2.5e-3;
/// Integration steps per row.
const SUBSTEPS: usize = 5;
/// Limit of the controller's output, V.
const LIMIT_V: f64 = 10.0;

/// A part of the model that can be added.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Term {
    /// Lag of the force behind the controller's output, s: sampling, amplifier.
    Lag,
    /// Friction above Coulomb at rest (Stribeck), N, with the speed of its decay, m/s.
    Stribeck,
    /// Viscous friction that grows less than the speed, N s^2/m^2.
    Saturation,
    /// Viscous friction that differs by direction, N s/m.
    Asymmetry,
    /// Friction's spring before sliding: its stiffness, N/m, in place of a jump.
    Presliding,
    /// Force that repeats with the screw, periods per turn: cosine and sine, N.
    Periodic(f64),
    /// Friction that grows with position: N/m.
    PositionFriction,
    /// Load that grows with position: N/m.
    PositionLoad,
}

impl Term {
    /// Starting values of its parameters.
    pub fn start(self) -> Vec<f64> {
        match self {
            Term::Lag => vec![1e-3],
            Term::Stribeck => vec![3.0, 0.02],
            Term::Presliding => vec![4e6],
            Term::Periodic(_) => vec![0.1, 0.1],
            _ => vec![0.0],
        }
    }

    /// Sizes in which its parameters are counted, so that a fit sees numbers of the same order.
    pub fn scale(self) -> Vec<f64> {
        match self {
            Term::Lag => vec![1e-3],
            Term::Stribeck => vec![5.0, 0.02],
            Term::Saturation => vec![300.0],
            Term::Asymmetry => vec![10.0],
            Term::Presliding => vec![2e6],
            Term::Periodic(_) => vec![1.0, 1.0],
            Term::PositionFriction | Term::PositionLoad => vec![5.0],
        }
    }

    /// In a table.
    pub fn name(self) -> String {
        match self {
            Term::Lag => "lag of the force".into(),
            Term::Stribeck => "Stribeck friction".into(),
            Term::Saturation => "viscous friction that saturates".into(),
            Term::Asymmetry => "viscous friction by direction".into(),
            Term::Presliding => "presliding".into(),
            Term::Periodic(order) => format!("{order} per turn"),
            Term::PositionFriction => "friction over position".into(),
            Term::PositionLoad => "load over position".into(),
        }
    }
}

/// The model: four base parameters and those of the terms.
#[derive(Debug, Clone)]
pub struct Axis {
    /// Moving mass, kg; viscous friction, N s/m; Coulomb friction, N; offset, N.
    pub base: [f64; 4],
    /// Added parts with their parameters.
    pub terms: Vec<(Term, Vec<f64>)>,
    /// Angle of the screw at position 0, rad: the homing, which belongs to a record.
    pub homing: f64,
}

/// What a simulation gives, at every row.
pub struct Run {
    /// Position, m.
    pub position: Vec<f64>,
    /// Velocity, m/s.
    pub velocity: Vec<f64>,
    /// Motor force as the controller asks for it, N.
    pub force: Vec<f64>,
}

impl Axis {
    /// The published parameters.
    pub fn published() -> Self {
        Axis {
            base: [95.1089, 203.5034, 20.3935, -3.1648],
            terms: Vec::new(),
            homing: 0.0,
        }
    }

    /// Parameters in units of their scales.
    pub fn parameters(&self) -> Vec<f64> {
        let own = self.base.iter().zip(BASE_SCALE).map(|(v, s)| v / s);
        own.chain(self.terms.iter().flat_map(|(term, values)| {
            values
                .iter()
                .zip(term.scale())
                .map(|(v, s)| v / s)
                .collect::<Vec<_>>()
        }))
        .collect()
    }

    /// The same model with other parameters, in units of their scales.
    pub fn with(&self, parameters: &[f64]) -> Self {
        let mut changed = self.clone();
        for (k, value) in changed.base.iter_mut().enumerate() {
            *value = parameters[k] * BASE_SCALE[k];
        }
        let mut at = 4;
        for (term, values) in &mut changed.terms {
            for (value, scale) in values.iter_mut().zip(term.scale()) {
                *value = parameters[at] * scale;
                at += 1;
            }
        }
        changed
    }

    fn find(&self, wanted: Term) -> Option<&[f64]> {
        self.terms
            .iter()
            .find(|(term, _)| *term == wanted)
            .map(|(_, values)| values.as_slice())
    }

    fn one(&self, wanted: Term) -> f64 {
        self.find(wanted).map_or(0.0, |values| values[0])
    }

    /// Simulates the closed loop over a record's references and pulses, from its first position at rest.
    pub fn simulate(&self, record: &Record) -> Run {
        let [mass, viscous, coulomb, offset] = self.base;
        let mass = mass.max(1.0);
        let stribeck = self
            .find(Term::Stribeck)
            .map_or((0.0, 1.0), |v| (v[0], v[1].abs().max(1e-4)));
        let (saturation, asymmetry) = (self.one(Term::Saturation), self.one(Term::Asymmetry));
        let stiffness = self.find(Term::Presliding).map(|v| v[0].clamp(1e4, 5e7));
        let (friction_slope, load_slope) = (
            self.one(Term::PositionFriction),
            self.one(Term::PositionLoad),
        );
        let lag = self.one(Term::Lag).max(0.0);
        let periodic: Vec<(f64, f64, f64)> = self
            .terms
            .iter()
            .filter_map(|(term, v)| match term {
                Term::Periodic(order) => Some((*order, v[0], v[1])),
                _ => None,
            })
            .collect();
        let dt = 1.0 / RATE / SUBSTEPS as f64;
        let rows = record.len();
        let mut run = Run {
            position: Vec::with_capacity(rows),
            velocity: Vec::with_capacity(rows),
            force: Vec::with_capacity(rows),
        };
        let (mut x, mut v) = (record.position[0], 0.0_f64);
        let mut bristle = 0.0_f64;
        let mut applied = record.output[0] * record.force_per_volt;
        let follow = if lag > 0.0 {
            1.0 - (-dt / lag).exp()
        } else {
            1.0
        };
        for k in 0..rows {
            // The controller takes dq/dt as the difference over its last two periods: the record of the estimation
            // file follows this law to 4 mV.
            let before = run
                .position
                .len()
                .checked_sub(2)
                .map_or(x, |k| run.position[k]);
            let speed = (x - before) * 0.5 * RATE;
            let volts =
                record.kv * (record.kp * (record.reference[k] - x) - speed) + record.pulses[k];
            let force = volts.clamp(-LIMIT_V, LIMIT_V) * record.force_per_volt;
            run.position.push(x);
            run.velocity.push(v);
            run.force.push(force);
            let theta = TAU * x / LEAD_M + self.homing;
            let ripple: f64 = periodic
                .iter()
                .map(|(order, c, s)| c * (order * theta).cos() + s * (order * theta).sin())
                .sum();
            for _ in 0..SUBSTEPS {
                applied += (force - applied) * follow;
                let level =
                    (coulomb + stribeck.0 * (-(v.abs() / stribeck.1)).exp() + friction_slope * x)
                        .max(0.1);
                let dry = match stiffness {
                    Some(stiffness) => {
                        // LuGre without its own damping: the bristle follows exactly over a step of constant speed.
                        let reach = level / stiffness;
                        let rate = v.abs() / reach;
                        let target = if v == 0.0 {
                            bristle
                        } else {
                            reach * v.signum()
                        };
                        bristle = target + (bristle - target) * (-rate * dt).exp();
                        stiffness * bristle
                            + 0.6 * (stiffness * mass).sqrt() * v * (-(v.abs() / 2e-3)).exp()
                    }
                    None => level * (v / 5e-4).tanh(),
                };
                let drag = viscous * v - saturation * v * v.abs() + asymmetry * v.abs();
                v += dt / mass * (applied - drag - dry - offset - ripple - load_slope * x);
                x += dt * v;
            }
        }
        run
    }
}

const BASE_SCALE: [f64; 4] = [100.0, 200.0, 20.0, 3.0];
