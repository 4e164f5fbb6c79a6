//! What declared parameters and nuisances of a record add to the residuals.

use super::declared::FULL;
use super::{Balance, Contribution, brake, shaped};
use crate::effects::parameter::{MotorParameter, Parameter, REACH_RAD};
use crate::machines::declared_or_unit;
use crate::signal::channel::Channel;
use crate::signal::signals::{MOST_SINCE, SMOOTH_HZ as SMOOTH, STICKING_RAD_S, rounded_sign};
use plant::Axis;
use std::f64::consts::TAU;

impl Balance<'_> {
    /// What relative changes of the declared parameters, and nuisances of the record, add to the residuals.
    pub fn parameter(&self, parameter: Parameter) -> Contribution {
        let mut sum = Contribution::default();
        let signals = self.signals;
        let feed = &self.model.feed;
        match parameter {
            Parameter::Motor(axis, which) => sum = self.motor_parameter(axis, which),
            Parameter::Pair => {
                let spectrum = self.spectrum_of(SMOOTH, |k| {
                    rounded_sign(signals.relative_speed[k], self.rounding.pair)
                });
                for axis in Axis::ALL {
                    sum.add(
                        Channel::Torque(axis),
                        brake(axis) * feed.pair_coulomb_nm,
                        &spectrum,
                    );
                }
            }
            Parameter::GuidewayCoulomb => {
                sum = self.guideway(|k| {
                    feed.guideway_coulomb_n
                        * rounded_sign(signals.relative_speed[k], self.rounding.guideway)
                });
            }
            Parameter::GuidewayShare if feed.guideway_coulomb_n > 0.0 => {}
            Parameter::GuidewayShare => {
                let pair_n = feed.pair_coulomb_nm / self.lead;
                sum = self.guideway(|k| {
                    pair_n * rounded_sign(signals.relative_speed[k], self.rounding.guideway)
                });
                sum.add_all(-1.0, &self.parameter(Parameter::Pair));
            }
            Parameter::GuidewayViscous => {
                sum = self.guideway(|k| {
                    feed.guideway_viscous_n_s_per_m * self.lead * signals.relative_speed[k]
                });
            }
            // Its shape was learnt from a record: who learnt it knows what it adds.
            Parameter::Curve(_) => {}
            Parameter::Load => sum = self.guideway(|_| feed.load_n),
            Parameter::TableMass { .. } => {
                let table = shaped(&self.relative_acceleration_told, &self.declared.compliance);
                let inertia = feed.table_mass_kg * self.lead * self.lead;
                for axis in Axis::ALL {
                    let table = self.seen_by(axis, &table);
                    sum.add(Channel::Torque(axis), brake(axis) * inertia, &table);
                }
            }
            Parameter::EndSpeed { axis, row } => {
                let count = TAU / f64::from(self.model.sensing.counts_per_turn(axis));
                let step = self.model.motor(axis).inertia_kg_m2 * count * signals.rate.powi(2);
                let there = |k: usize| if k == row { 1.0 } else { 0.0 };
                sum.add(Channel::Torque(axis), step, &self.spectrum_of(FULL, there));
            }
            Parameter::RestOffset { from, to, .. } => {
                let inside = |k: usize| if (from..to).contains(&k) { 1.0 } else { 0.0 };
                sum.add(Channel::Table, 1.0, &self.spectrum_of(SMOOTH, inside));
            }
            Parameter::RestDrift { from, to, .. } => {
                let part = |k: usize| match (from..to).contains(&k) {
                    true => (k - from) as f64 / (to - from) as f64 - 0.5,
                    false => 0.0,
                };
                sum.add(Channel::Table, 1.0, &self.spectrum_of(SMOOTH, part));
            }
            Parameter::TableOrigin { .. } => {
                sum.add(Channel::Table, 1.0, &self.spectrum_of(SMOOTH, |_| 1.0))
            }
        }
        sum
    }

    /// What a relative change of a motor's declared parameter, or a nuisance of its record, adds.
    fn motor_parameter(&self, axis: Axis, which: MotorParameter) -> Contribution {
        let mut sum = Contribution::default();
        let signals = self.signals;
        let (motor, s) = (self.model.motor(axis), &signals.motors[axis.index()]);
        let pole_pairs = f64::from(motor.pole_pairs);
        let (torque, d, q) = (
            Channel::Torque(axis),
            Channel::VoltageD(axis),
            Channel::VoltageQ(axis),
        );
        let omega_e = |k: usize| pole_pairs * s.omega[k];
        let period = 1.0 / self.model.sensing.control_hz;
        match which {
            MotorParameter::Inertia => {
                let unit = declared_or_unit(motor.inertia_kg_m2);
                sum.add(torque, unit, &s.acceleration_told);
            }
            MotorParameter::Viscous => {
                let unit = declared_or_unit(motor.viscous_nm_s);
                sum.add(torque, unit, &self.spectrum_of(SMOOTH, |k| s.omega[k]));
            }
            MotorParameter::Load => {
                sum.add(torque, 1.0, &self.spectrum_of(SMOOTH, |_| 1.0));
            }
            MotorParameter::Coulomb => {
                let unit = declared_or_unit(motor.coulomb_nm);
                let sign = |k: usize| rounded_sign(s.omega[k], self.rounding.bearing);
                sum.add(torque, unit, &self.spectrum_of(SMOOTH, sign));
            }
            MotorParameter::Reversal => {
                let unit = declared_or_unit(motor.coulomb_nm);
                // From rest friction grows from nothing, after a reversal from the other way's.
                let rested = s.omega[0].abs() < STICKING_RAD_S;
                let first = s.since.iter().position(|since| *since < MOST_SINCE);
                let missing: Vec<f64> = (0..s.omega.len())
                    .map(|k| {
                        let sign = rounded_sign(s.omega[k], self.rounding.bearing);
                        match rested && first.is_none_or(|first| k < first) {
                            true => 0.5 * sign * (-s.travel[k].abs() / REACH_RAD).exp(),
                            false => sign * (-s.since[k] / REACH_RAD).exp(),
                        }
                    })
                    .collect();
                sum.add(torque, unit, &self.fourier.spectrum(&missing));
            }
            MotorParameter::Flux => {
                sum.add(
                    torque,
                    -pole_pairs * motor.flux_wb,
                    &self.fourier.spectrum(&s.i_q),
                );
                sum.add(q, pole_pairs * motor.flux_wb, &s.speed);
            }
            MotorParameter::Resistance => {
                sum.add(
                    q,
                    motor.resistance_ohm,
                    &self.spectrum_of(SMOOTH, |k| s.i_q_smooth[k]),
                );
            }
            MotorParameter::Inductance => {
                let cross = self.spectrum_of(SMOOTH, |k| omega_e(k) * s.i_q_smooth[k]);
                sum.add(d, -motor.inductance_h, &cross);
            }
            MotorParameter::ReferenceStep => {
                let per_second = motor.inductance_h * signals.rate;
                sum.add(q, per_second, &s.reference_step);
            }
            MotorParameter::ReadingLag => {
                sum.add(
                    Channel::Table,
                    brake(axis) * self.lead,
                    &self.fourier.slope(&s.travel),
                );
            }
            MotorParameter::VoltageLag => {
                sum.add(d, period, &s.voltage_rate[0]);
                sum.add(q, period, &s.voltage_rate[1]);
            }
            MotorParameter::AngleZero => {
                let flux = motor.flux_wb;
                sum.add(
                    d,
                    pole_pairs * flux,
                    &self.spectrum_of(SMOOTH, |k| s.omega[k]),
                );
                let i_d = self.spectrum_of(SMOOTH, |k| s.i_d_smooth[k]);
                sum.add(torque, -pole_pairs * flux, &i_d);
            }
            MotorParameter::AngleLag => {
                let of_d = self.spectrum_of(FULL, |k| omega_e(k) * s.u_q[k]);
                let of_q = self.spectrum_of(FULL, |k| omega_e(k) * s.u_d[k]);
                sum.add(d, -period, &of_d);
                sum.add(q, period, &of_q);
            }
        }
        sum
    }
}
