//! The end of a screw that turns freely beyond the nut: the first torsional mode of a shaft that its root drives.

use hal_sim::seam::Seam;
use plant::Axis;
use plant::machine::Machine;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Shear modulus, Pa, and density, kg/m3, of steel.
const SHEAR_PA: f64 = 79.3e9;
const DENSITY: f64 = 7850.0;

/// A round steel shaft.
#[derive(Clone, Copy, Debug)]
pub struct Shaft {
    /// Its diameter, m.
    pub diameter_m: f64,
    /// Its free length, m.
    pub length_m: f64,
    /// Damping of its mode, relative to critical.
    pub damping_ratio: f64,
}

impl Shaft {
    /// Frequency of its first mode with the root held, Hz: a quarter of a wave along it, `sqrt(G / rho) / (4 L)`.
    pub fn held_hz(&self) -> f64 {
        (SHEAR_PA / DENSITY).sqrt() / (4.0 * self.length_m)
    }

    /// Inertia of that mode on the root, kg m2: `8 / pi^2` of the shaft's.
    pub fn mode_inertia(&self) -> f64 {
        let polar = PI / 32.0 * self.diameter_m.powi(4);
        DENSITY * polar * self.length_m * 2.0 / (FRAC_PI_2 * FRAC_PI_2)
    }

    /// The same with the root on an inertia, kg m2, that turns freely, Hz.
    pub fn free_hz(&self, root_inertia: f64) -> f64 {
        self.held_hz() * (1.0 + self.mode_inertia() / root_inertia).sqrt()
    }
}

/// That mode in time, on the screw of a machine.
#[derive(Clone, Copy, Debug)]
pub struct FreeEnd {
    inertia: f64,
    /// N m/rad, N m s/rad.
    stiffness: f64,
    damping: f64,
    /// Of the root: angle, rad, and speed, rad/s.
    twist: Option<[f64; 2]>,
}

impl FreeEnd {
    /// At rest on its root.
    pub fn new(shaft: &Shaft) -> Self {
        let (inertia, omega) = (shaft.mode_inertia(), TAU * shaft.held_hz());
        Self {
            inertia,
            stiffness: inertia * omega * omega,
            damping: 2.0 * shaft.damping_ratio * inertia * omega,
            twist: None,
        }
    }

    /// The torque on the screw, N m, for the next `dt` seconds: drift, kick, drift, as the machine itself goes.
    pub fn step(&mut self, machine: &Machine, dt: f64) -> f64 {
        let root = machine.motor(Axis::Screw);
        let [angle, speed] = self.twist.unwrap_or([root.theta, root.omega]);
        let middle = angle + 0.5 * dt * speed;
        let lag = root.theta + 0.5 * dt * root.omega - middle;
        let torque = self.stiffness * lag + self.damping * (root.omega - speed);
        let speed = speed + dt * torque / self.inertia;
        self.twist = Some([middle + 0.5 * dt * speed, speed]);
        -torque
    }
}

/// A machine whose screw has a free end.
pub struct Twisting {
    /// The end.
    pub end: FreeEnd,
    /// Half a PWM period, s.
    pub half_s: f64,
}

impl Seam for Twisting {
    fn machine(&mut self, machine: &mut Machine, _: u32) {
        let torque = self.end.step(machine, self.half_s);
        machine.set_disturbance_torque(Axis::Screw, torque);
    }
}
