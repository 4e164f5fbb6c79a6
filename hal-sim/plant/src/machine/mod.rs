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
//!    damper take the mean of the velocities before and after; see `friction.rs` for Coulomb friction, `bristles.rs` for friction that is
//!    elastic, and `feed.rs` for the spring.
//! 4. Angles and table drift the other half.
//!
//! Where a friction changes between sliding and sticking within a step, and where a gap opens or closes, that step is
//! of first order. The windings' exchange with the shaft is explicit: `dt` must stay below
//! `sqrt(J L) / (p flux)` (3.7 ms for the paper's motor).

mod bristles;
mod clarke;
mod feed;
mod friction;
mod harmonics;
mod motors;
mod pair;
mod winding;

pub use bristles::Bristles;
pub use motors::MotorState;
pub use winding::Bridge;

use crate::Axis;
use crate::model::Model;
use bristles::Surfaces;
use feed::Feed;
use friction::{Step, rubbing};
use harmonics::Phasors;
use motors::Motors;
use pair::Pair;

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
    motors: Motors,
    feed: Feed,
    coupling: Coupling,
    time: f64,
    /// Length of the last step, for which the parts are prepared, and its reciprocal.
    dt: f64,
    rate: f64,
    half_bus: f64,
    friction_impulses: [f64; 4],
    /// Coulomb friction where there are none.
    bristles: Option<Surfaces>,
}

impl Machine {
    /// The machine of a model.
    ///
    /// Lumped, the model's load force becomes a load torque on each motor through the lead: `+r * load` on the screw,
    /// `-r * load` on the nut, as action and reaction in the pair.
    pub fn new(model: &Model, coupling: Coupling) -> Self {
        let mut machine = Machine {
            motors: Motors::new(model),
            feed: Feed::new(model),
            coupling,
            time: 0.0,
            dt: f64::NAN,
            rate: f64::NAN,
            half_bus: 0.5 * DEFAULT_BUS_VOLTAGE,
            friction_impulses: [0.0; 4],
            bristles: (model.feed.presliding_m > 0.0).then(|| Surfaces::new(model)),
        };
        machine.set_load_force(model.feed.load_n);
        machine
    }

    /// Sets what drives the windings of one motor from now on.
    #[inline]
    pub fn set_bridge(&mut self, axis: Axis, bridge: Bridge) {
        self.motors.set_bridge(axis.index(), bridge);
    }

    /// Opens the lead of one phase (0 to 2 for a to c) of one motor, or closes all.
    pub fn set_open_phase(&mut self, axis: Axis, phase: Option<usize>) {
        self.motors.set_open_phase(axis.index(), phase);
    }

    /// Unplugs one motor from its bridge, or plugs it in: no current flows in an unplugged winding.
    pub fn set_disconnected(&mut self, axis: Axis, disconnected: bool) {
        self.motors.set_disconnected(axis.index(), disconnected);
    }

    /// Sets the bus voltage against which the diodes of an open bridge work, V.
    #[inline]
    pub fn set_bus_voltage(&mut self, volts: f64) {
        self.half_bus = 0.5 * volts;
    }

    /// Puts one motor at an angle, rad; the table stays where it is and the axial spring as it is.
    pub fn set_motor_angle(&mut self, axis: Axis, theta: f64) {
        let before = self.feed.travel(self.relative_angle());
        self.motors.theta.as_mut_array()[axis.index()] = theta;
        self.feed.origin += self.feed.travel(self.relative_angle()) - before;
    }

    /// Sets the force against positive travel, N. Lumped, it sets both load torques, as in [`Machine::new`].
    pub fn set_load_force(&mut self, newtons: f64) {
        self.feed.load = newtons;
        if self.coupling == Coupling::Lumped {
            let torque = self.feed.ratio(self.relative_angle()) * newtons;
            self.motors.load_torque = Pair::new([torque, -torque]);
        }
    }

    /// Sets a constant torque against the positive direction of one motor, N m: `T_L` of Eq 3.
    pub fn set_load_torque(&mut self, axis: Axis, newton_metres: f64) {
        self.motors.load_torque.as_mut_array()[axis.index()] = newton_metres;
    }

    /// Sets an extra torque in the positive direction of one motor, N m, held until the next call.
    pub fn set_disturbance_torque(&mut self, axis: Axis, newton_metres: f64) {
        self.motors.disturbance_torque.as_mut_array()[axis.index()] = newton_metres;
    }

    /// Changes the winding of one motor from its model, relative, until the next call: its resistance, and its flux in
    /// back-EMF and torque alike.
    pub fn set_winding_change(&mut self, axis: Axis, resistance: f64, flux: f64) {
        let [of_resistance, of_flux] = &mut self.motors.change;
        of_resistance.as_mut_array()[axis.index()] = resistance;
        of_flux.as_mut_array()[axis.index()] = flux;
    }

    /// One step of integration over `dt` seconds with the bridges held.
    ///
    /// # Panics
    /// If `dt` is no finite number above 0.
    pub fn advance(&mut self, dt: f64) {
        if dt != self.dt {
            assert!(
                dt > 0.0 && dt.is_finite(),
                "a step of {dt} s; it must be finite and above 0"
            );
            self.dt = dt;
            self.rate = dt.recip();
            self.motors.prepare(dt);
            self.feed.prepare(dt);
        }
        let (half, motors) = (0.5 * dt, &mut self.motors);
        let theta = motors.theta + motors.omega * half;
        let electrical = Phasors::new(motors.pole_pairs * theta);
        let mut torque =
            motors.step_currents(dt, self.time + half, theta, &electrical, self.half_bus);

        let [screw, nut] = motors.omega.to_array();
        let before = [screw, nut, self.feed.velocity];
        let position = self.feed.position + half * self.feed.velocity;
        let [screw, nut] = motors.kick.mobility.to_array();
        let bearings = [0, 1].map(|k| motors.friction_level(k, half) * dt);
        let mut step = Step {
            before,
            free: [0.0; 3],
            mobility: [screw, nut, 0.0],
            limit: [bearings[0], bearings[1], 0.0, 0.0],
            axial: None,
        };
        if self.coupling == Coupling::Coupled {
            let [screw, nut] = theta.to_array();
            let relative = screw - nut;
            let pair = self.feed.pair_torque(relative);
            torque += Pair::new([-pair, pair]);
            step.free[2] = self
                .feed
                .kick
                .apply(before[2], -dt * self.feed.table_load(relative, position));
            step.mobility[2] = self.feed.kick.mobility;
            step.limit[2] = self.feed.friction_level(half) * dt;
            step.limit[3] = self.feed.pair_coulomb * dt;
            step.axial = self.feed.axial(relative, position, before);
        }
        if let Some(bristles) = &mut self.bristles {
            let levels = step.limit.map(|limit| limit * self.rate);
            let [screw, nut, table, pair] = bristles.step(rubbing(&before), levels, dt);
            torque += Pair::new([-screw - pair, pair - nut]);
            step.free[2] -= step.mobility[2] * dt * table;
            step.limit = [0.0; 4];
        }
        [step.free[0], step.free[1]] = motors.kick.apply(motors.omega, torque * dt).to_array();
        let [screw, nut, table] = step.solve(&mut self.friction_impulses);

        let after = Pair::new([screw, nut]);
        motors.acceleration = (after - motors.omega) * self.rate;
        motors.omega = after;
        motors.theta = theta + after * half;
        self.feed.acceleration = (table - before[2]) * self.rate;
        self.feed.velocity = table;
        self.feed.position = position + half * table;
        self.time += dt;
    }

    /// Time since the start, s.
    #[inline]
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The state of one motor.
    #[inline]
    pub fn motor(&self, axis: Axis) -> MotorState {
        self.motors.state(axis.index())
    }

    /// True currents of the phases a, b, c, A; positive into the motor.
    #[inline(always)]
    pub fn phase_currents(&self, axis: Axis) -> [f64; 3] {
        self.motors.phase_currents(axis.index())
    }

    /// Currents of the phases a, b, c as an otherwise ideal sensor with the model's offset and gain errors reads them, A.
    #[inline(always)]
    pub fn current_readings(&self, axis: Axis) -> [f64; 3] {
        self.motors.current_readings(axis.index())
    }

    /// Angle as an otherwise ideal encoder with the model's eccentricity reads it, rad, many turns.
    #[inline(always)]
    pub fn encoder_angle(&self, axis: Axis) -> f64 {
        self.motors.encoder_angle(axis.index())
    }

    /// Position of the table, m, from where it started.
    #[inline]
    pub fn table_position(&self) -> f64 {
        match self.coupling {
            Coupling::Lumped => self.feed.travel(self.relative_angle()) - self.feed.origin,
            Coupling::Coupled => self.feed.position,
        }
    }

    /// Velocity of the table, m/s.
    #[inline]
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
        let [screw, nut] = self.motors.theta.to_array();
        screw - nut
    }

    fn relative_speed(&self) -> f64 {
        let [screw, nut] = self.motors.omega.to_array();
        screw - nut
    }
}
