//! The residuals of the declared model itself.

use super::linear::linear;
use super::{Balance, Contribution, Spring, brake, shaped};
use crate::signal::channel::Channel;
use crate::signal::signals::rounded_sign;
use fft::Complex64;
use plant::Axis;

/// What is measured has content up to the record's own rate.
pub(super) const FULL: f64 = f64::INFINITY;

impl Balance<'_> {
    /// The torque residuals under the declared model.
    pub fn torque_residual(&self) -> Contribution {
        let mut residual = Contribution::default();
        let signals = self.signals;
        let table = shaped(&self.relative_acceleration, &self.declared.compliance);
        let inertia = self.model.feed.table_mass_kg * self.lead * self.lead;
        for axis in Axis::ALL {
            let (motor, s) = (self.model.motor(axis), &signals.motors[axis.index()]);
            let pole_pairs = f64::from(motor.pole_pairs);
            let torque = self.spectrum_of(FULL, |k| {
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
            residual.add(channel, -motor.inertia_kg_m2, &s.acceleration);
            residual.add(channel, -brake(axis) * inertia, &self.seen_by(axis, &table));
        }
        residual
    }

    /// The voltage residuals of both motors under the declared model.
    fn voltage_residual(&self) -> Contribution {
        let mut residual = Contribution::default();
        for axis in Axis::ALL {
            let (motor, s) = (self.model.motor(axis), &self.signals.motors[axis.index()]);
            let omega_e = |k: usize| f64::from(motor.pole_pairs) * s.omega[k];
            let d = self.spectrum_of(FULL, |k| {
                omega_e(k) * motor.inductance_h * s.i_q[k] - motor.resistance_ohm * s.i_d[k]
            });
            residual.add(Channel::VoltageD(axis), 1.0, &s.applied[0]);
            residual.add(Channel::VoltageD(axis), 1.0, &d);
            residual.add(Channel::VoltageD(axis), -motor.inductance_h, &s.i_d_rate);
            let q = self.spectrum_of(FULL, |k| {
                -motor.resistance_ohm * s.i_q[k] - omega_e(k) * motor.inductance_h * s.i_d[k]
            });
            let emf = f64::from(motor.pole_pairs) * motor.flux_wb;
            residual.add(Channel::VoltageQ(axis), 1.0, &s.applied[1]);
            residual.add(Channel::VoltageQ(axis), 1.0, &q);
            residual.add(Channel::VoltageQ(axis), -emf, &s.speed);
            residual.add(Channel::VoltageQ(axis), -motor.inductance_h, &s.i_q_rate);
        }
        residual
    }

    /// The residual of every channel under the declared model, its declared effects included.
    pub fn residual(&self) -> Contribution {
        let mut residual = self.torque_residual();
        residual.add_all(1.0, &self.voltage_residual());
        residual.add_all(
            1.0,
            &self.table(&self.declared, &self.relative_acceleration),
        );
        for effect in &self.model.effects {
            residual.add_all(-1.0, &self.effect(&linear(effect)));
        }
        residual
    }

    /// Residual of the table on a given screw that accelerates so.
    pub(super) fn table(&self, screw: &Spring, acceleration: &[Complex64]) -> Contribution {
        let mut residual = Contribution::default();
        residual.add(Channel::Table, 1.0, &self.rigid);
        let mass = self.model.feed.table_mass_kg;
        let dynamic = shaped(acceleration, &screw.compliance);
        residual.add(Channel::Table, self.lead * mass / screw.stiffness, &dynamic);
        let force = shaped(&self.table_force_spectrum, &screw.compliance);
        residual.add(Channel::Table, 1.0 / screw.stiffness, &force);
        residual
    }
}
