//! The machine in time.
//!
//! # Scheme
//!
//! One step of `dt` with the bridges' voltages held, second order, one evaluation of all forces, at the middle of the
//! step (drift-kick-drift, the velocity Verlet of positions):
//!
//! 1. Angles and table drift half a step with their velocities.
//! 2. At that angle each winding follows its exact R-L response to the held voltage less the back-EMF; the back-EMF's
//!    speed is predicted to the middle with the last step's acceleration. The torque is that of the exact mean current.
//! 3. Impulses of torques, axial coupling and friction act on the velocities together. Viscous terms and the axial
//!    damper take the mean of the velocities before and after; see `friction.rs` for Coulomb friction and `feed.rs` for
//!    the spring.
//! 4. Angles and table drift the other half.
//!
//! Where a friction changes between sliding and sticking within a step, and where a gap opens or closes, that step is
//! of first order. The windings' exchange with the shaft is explicit: `dt` must stay below
//! `sqrt(J L) / (p flux)` (3.7 ms for the paper's motor).

mod clarke;
mod feed;
mod friction;
mod harmonics;
mod motor;
mod winding;

pub use motor::MotorState;
pub use winding::Bridge;

use crate::Axis;
use crate::model::Model;
use feed::Feed;
use friction::{Axial, Step};
use motor::Motor;

/// Bus voltage until [`Machine::set_bus_voltage`] is called, V. It acts on open bridges only.
pub const DEFAULT_BUS_VOLTAGE: f64 = 310.0;

/// How the two motors work on the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Coupling {
    /// The paper's own simplification: all inertia in `J_M` of each motor, the load a torque on each motor, the table's
    /// velocity the kinematic difference of the motors' (Eq 7). The feed has no dynamics and no friction; of its
    /// effects only those of the travel show.
    Lumped,
    /// Screw and nut coupled through lead, axial stiffness and damping, the table's mass, friction of guideway and
    /// pair, and the load force.
    Coupled,
}

/// State and integration of the machine that a model describes.
///
/// Starts at rest at angles 0 with the axial spring relaxed, the table at 0, bridges open, the model's load on.
#[derive(Debug, Clone)]
pub struct Machine {
    motors: [Motor; 2],
    feed: Feed,
    coupling: Coupling,
    time: f64,
    dt: f64,
    half_bus: f64,
    friction_impulses: [f64; 4],
}

impl Machine {
    /// The machine of a model.
    ///
    /// Lumped, the model's load force becomes a load torque on each motor through the lead: `+r * load` on the screw,
    /// `-r * load` on the nut, as action and reaction in the pair.
    pub fn new(model: &Model, coupling: Coupling) -> Self {
        let mut machine = Machine {
            motors: Axis::ALL.map(|axis| Motor::new(model, axis)),
            feed: Feed::new(model),
            coupling,
            time: 0.0,
            dt: f64::NAN,
            half_bus: 0.5 * DEFAULT_BUS_VOLTAGE,
            friction_impulses: [0.0; 4],
        };
        machine.set_load_force(model.feed.load_n);
        machine
    }

    /// Sets what drives the windings of one motor from now on.
    pub fn set_bridge(&mut self, axis: Axis, bridge: Bridge) {
        self.motors[axis.index()].set_bridge(bridge);
    }

    /// Sets the bus voltage against which the diodes of an open bridge work, V.
    pub fn set_bus_voltage(&mut self, volts: f64) {
        self.half_bus = 0.5 * volts;
    }

    /// Puts one motor at an angle, rad; the table stays where it is and the axial spring as it is.
    pub fn set_motor_angle(&mut self, axis: Axis, theta: f64) {
        let before = self.feed.travel(self.relative_angle());
        self.motors[axis.index()].state.theta = theta;
        self.feed.origin += self.feed.travel(self.relative_angle()) - before;
    }

    /// Sets the force against positive travel, N. Lumped, it sets both load torques, as in [`Machine::new`].
    pub fn set_load_force(&mut self, newtons: f64) {
        self.feed.load = newtons;
        if self.coupling == Coupling::Lumped {
            let torque = self.feed.ratio(self.relative_angle()) * newtons;
            self.motors[0].load_torque = torque;
            self.motors[1].load_torque = -torque;
        }
    }

    /// Sets a constant torque against the positive direction of one motor, N m: `T_L` of Eq 3.
    pub fn set_load_torque(&mut self, axis: Axis, newton_metres: f64) {
        self.motors[axis.index()].load_torque = newton_metres;
    }

    /// Sets an extra torque in the positive direction of one motor, N m, held until the next call.
    pub fn set_disturbance_torque(&mut self, axis: Axis, newton_metres: f64) {
        self.motors[axis.index()].disturbance_torque = newton_metres;
    }

    /// One step of integration over `dt` seconds (above 0) with the bridges held.
    pub fn advance(&mut self, dt: f64) {
        if dt != self.dt {
            self.dt = dt;
            self.motors.iter_mut().for_each(|motor| motor.prepare(dt));
        }
        let half = 0.5 * dt;
        let middle = self.time + half;
        let theta =
            [0, 1].map(|k: usize| self.motors[k].state.theta + half * self.motors[k].state.omega);
        let mut torque = [0, 1]
            .map(|k: usize| self.motors[k].step_currents(dt, middle, theta[k], self.half_bus));

        let before = [
            self.motors[0].state.omega,
            self.motors[1].state.omega,
            self.feed.velocity,
        ];
        let relative = theta[0] - theta[1];
        let position = self.feed.position + half * self.feed.velocity;
        let (axial, table, limits) = match self.coupling {
            Coupling::Lumped => (
                Axial {
                    ratio: [0.0; 3],
                    offset: 0.0,
                    slope: 0.0,
                },
                [0.0; 3],
                [0.0; 2],
            ),
            Coupling::Coupled => {
                let pair = self.feed.pair_torque(relative);
                torque[0] -= pair;
                torque[1] += pair;
                (
                    self.feed.axial(dt, relative, position, before),
                    [
                        self.feed.mass,
                        self.feed.viscous,
                        -self.feed.table_load(position),
                    ],
                    [
                        self.feed.friction_level(half) * dt,
                        self.feed.pair_coulomb * dt,
                    ],
                )
            }
        };
        let [screw, nut] = &self.motors;
        let (screw_free, screw_mobility) =
            kick(before[0], screw.inertia, screw.viscous, torque[0], dt);
        let (nut_free, nut_mobility) = kick(before[1], nut.inertia, nut.viscous, torque[1], dt);
        let (table_free, table_mobility) = match self.coupling {
            Coupling::Lumped => (0.0, 0.0),
            Coupling::Coupled => kick(before[2], table[0], table[1], table[2], dt),
        };
        let step = Step {
            before,
            free: [screw_free, nut_free, table_free],
            mobility: [screw_mobility, nut_mobility, table_mobility],
            limit: [
                screw.friction_level(half) * dt,
                nut.friction_level(half) * dt,
                limits[0],
                limits[1],
            ],
            axial,
        };
        let after = step.solve(&mut self.friction_impulses);

        for k in 0..2 {
            let motor = &mut self.motors[k];
            motor.acceleration = (after[k] - before[k]) / dt;
            motor.state.omega = after[k];
            motor.state.theta = theta[k] + half * after[k];
        }
        self.feed.acceleration = (after[2] - before[2]) / dt;
        self.feed.velocity = after[2];
        self.feed.position = position + half * after[2];
        self.time += dt;
    }

    /// Time since the start, s.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The state of one motor.
    pub fn motor(&self, axis: Axis) -> &MotorState {
        &self.motors[axis.index()].state
    }

    /// True currents of the phases a, b, c, A; positive into the motor.
    pub fn phase_currents(&self, axis: Axis) -> [f64; 3] {
        self.motors[axis.index()].phase_currents()
    }

    /// Currents of the phases a, b, c as an otherwise ideal sensor with the model's offset and gain errors reads them, A.
    pub fn current_readings(&self, axis: Axis) -> [f64; 3] {
        self.motors[axis.index()].current_readings()
    }

    /// Angle as an otherwise ideal encoder with the model's eccentricity reads it, rad, many turns.
    pub fn encoder_angle(&self, axis: Axis) -> f64 {
        self.motors[axis.index()].encoder_angle()
    }

    /// Position of the table, m, from where it started.
    pub fn table_position(&self) -> f64 {
        match self.coupling {
            Coupling::Lumped => self.feed.travel(self.relative_angle()) - self.feed.origin,
            Coupling::Coupled => self.feed.position,
        }
    }

    /// Velocity of the table, m/s.
    pub fn table_velocity(&self) -> f64 {
        match self.coupling {
            Coupling::Lumped => self.feed.ratio(self.relative_angle()) * self.relative_speed(),
            Coupling::Coupled => self.feed.velocity,
        }
    }

    /// Axial force between thread and table, N; positive pushes the table in the direction of positive travel. Lumped,
    /// the load force.
    pub fn axial_force(&self) -> f64 {
        match self.coupling {
            Coupling::Lumped => self.feed.load,
            Coupling::Coupled => self
                .feed
                .force(self.relative_angle(), self.relative_speed()),
        }
    }

    fn relative_angle(&self) -> f64 {
        self.motors[0].state.theta - self.motors[1].state.theta
    }

    fn relative_speed(&self) -> f64 {
        self.motors[0].state.omega - self.motors[1].state.omega
    }
}

/// Velocity after a step under a held force and viscous friction on the mean velocity, and its change per impulse.
#[inline]
fn kick(velocity: f64, inertia: f64, viscous: f64, force: f64, dt: f64) -> (f64, f64) {
    let loss = 0.5 * dt * viscous;
    let mobility = 1.0 / (inertia + loss);
    (
        mobility * ((inertia - loss) * velocity + dt * force),
        mobility,
    )
}
