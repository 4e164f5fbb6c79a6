//! Declared parameters and nuisances of a record, and what they add to the residuals.

use super::declared::FULL;
use super::{Balance, Contribution, brake, rounded_sign};
use crate::channel::Channel;
use crate::machines::declared_or_unit;
use crate::normal::Prior;
use crate::signals::SMOOTH_HZ as SMOOTH;
use plant::Axis;

impl Balance<'_> {
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
                        let unit = declared_or_unit(motor.inertia_kg_m2);
                        sum.add(torque, unit, &s.acceleration);
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
                    MotorParameter::Flux => {
                        sum.add(
                            torque,
                            -pole_pairs * motor.flux_wb,
                            &self.fourier.spectrum(&s.i_q),
                        );
                        sum.add(q, motor.flux_wb, &self.spectrum_of(SMOOTH, omega_e));
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
                    MotorParameter::CurrentSlope => {
                        sum.add(d, motor.inductance_h, &s.i_d_rate);
                        sum.add(q, motor.inductance_h, &s.i_q_rate);
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
                        sum.add(d, -1.0, &self.spectrum_of(FULL, |k| omega_e(k) * s.u_q[k]));
                        sum.add(q, 1.0, &self.spectrum_of(FULL, |k| omega_e(k) * s.u_d[k]));
                    }
                }
            }
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
            Parameter::GuidewayViscous => {
                sum = self.guideway(|k| {
                    feed.guideway_viscous_n_s_per_m * self.lead * signals.relative_speed[k]
                });
            }
            Parameter::Load => sum = self.guideway(|_| feed.load_n),
            Parameter::RestOffset { from, to } => {
                let inside = |k: usize| if (from..to).contains(&k) { 1.0 } else { 0.0 };
                sum.add(Channel::Table, 1.0, &self.spectrum_of(SMOOTH, inside));
            }
            Parameter::TableOrigin { .. } => {
                sum.add(Channel::Table, 1.0, &self.spectrum_of(SMOOTH, |_| 1.0))
            }
        }
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
    /// Where the table's scale has its zero, m.
    TableOrigin {
        /// How far from where the first row has it: little if the record starts with the axial spring relaxed.
        within: f64,
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
    /// A constant load torque, N m: that of a motor of which nobody says what it drives.
    Load,
    /// Time by which the angle is read before or after the table, s: a nuisance. Drives whose two current loops are
    /// half a period apart read the angles so.
    ReadingLag,
    /// Time by which the commanded voltages are later than the currents, s: a nuisance.
    VoltageLag,
    /// Time by which the frame of the commanded voltages is off, s: a nuisance.
    AngleLag,
}

impl Parameter {
    /// All that a model file declares of a motor and its winding, and their nuisances.
    pub fn of_a_drive(axis: Axis) -> Vec<Parameter> {
        use MotorParameter::*;
        [
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
        ]
        .map(|which| Parameter::Motor(axis, which))
        .to_vec()
    }

    /// All that it declares of the feed.
    pub fn of_the_feed() -> [Parameter; 4] {
        use Parameter::*;
        [Pair, GuidewayCoulomb, GuidewayViscous, Load]
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
            Parameter::Motor(_, which) => {
                matches!(which, Inertia | Viscous | Coulomb | Flux | Load)
            }
            Parameter::TableOrigin { .. } | Parameter::RestOffset { .. } => false,
            _ => true,
        }
    }

    /// How far the parameter may lie from its declared value: the tolerance of plate values (3 % of resistance,
    /// inductance, inertia; 1 % of flux; 20 % of friction), with a tenth more for what the record adds.
    fn bound(self) -> f64 {
        match self {
            Parameter::Motor(_, which) => match which {
                MotorParameter::Inertia
                | MotorParameter::Resistance
                | MotorParameter::Inductance => 0.033,
                MotorParameter::Flux => 0.011,
                MotorParameter::Viscous | MotorParameter::Coulomb => 0.22,
                MotorParameter::Load => f64::INFINITY,
                MotorParameter::CurrentSlope => 0.4,
                MotorParameter::AngleLag => 2e-5,
                MotorParameter::VoltageLag | MotorParameter::ReadingLag => 1e-4,
            },
            Parameter::Pair | Parameter::GuidewayCoulomb | Parameter::GuidewayViscous => 0.22,
            Parameter::Load => 0.005,
            Parameter::TableOrigin { within } => within,
            Parameter::RestOffset { .. } => 1e-6,
        }
    }

    /// What is known of it before the record is seen.
    pub fn prior(self) -> Prior {
        Prior::within(self.spread(), self.bound())
    }

    /// Standard deviation of the parameter before the record is seen: that of an even spread over its bounds.
    fn spread(self) -> f64 {
        match self {
            Parameter::TableOrigin { within } => 0.2 * within,
            Parameter::RestOffset { .. } => 1.5e-8,
            _ => self.bound() / 3.0_f64.sqrt(),
        }
    }
}
