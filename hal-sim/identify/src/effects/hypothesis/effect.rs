//! Which effect of the plant a hypothesis is.

use super::Hypothesis;
use crate::balance::of_the_current;
use crate::effects::family::Family;
use plant::effects::*;
use plant::model::Model;
use std::f64::consts::FRAC_PI_2;

/// Slots of the usual winding for a number of poles: 12 slots for 10 poles, and in general 6/5 of the poles.
fn slots(poles: u32) -> f64 {
    (f64::from(poles) * 1.2).round()
}

/// Whether `order` is a multiple of `of`, within rounding.
fn multiple(order: f64, of: f64) -> bool {
    order > 0.5 * of && (order / of).fract().abs() < 1e-9
}

impl Hypothesis {
    /// The effect with given linear parameters over a run of `run_s` seconds; `None` if it has no kind or the place makes
    /// no sense.
    pub fn effect(&self, model: &Model, run_s: f64, values: &[f64]) -> Option<EffectModel> {
        let first = values[0];
        let second = values.get(1).copied().unwrap_or(0.0);
        let (amplitude, phase) = (first.hypot(second), second.atan2(first));
        let order = self.shape;
        let effect: AnyEffect = match self.family {
            Family::CurrentOffset => CurrentOffset {
                off_a: first,
                off_b: second,
            }
            .into(),
            Family::CurrentGain => CurrentGain {
                gain_a: of_the_current(first),
                gain_b: of_the_current(second),
            }
            .into(),
            Family::DeadTime => DeadTime { value: first }.into(),
            Family::ResistanceDrift => ResistanceDrift {
                value: first,
                duration_s: run_s,
            }
            .into(),
            Family::FluxDrift => FluxDrift {
                value: first,
                duration_s: run_s,
            }
            .into(),
            Family::AngleTorque => self.angle_torque(model, order, amplitude, phase),
            Family::TimePeriodic => TimePeriodic {
                hz: order,
                amplitude,
                phase,
            }
            .into(),
            Family::FluxHarmonic => FluxHarmonic {
                order,
                amplitude,
                phase,
            }
            .into(),
            // amplitude * sin(x + phase + pi/2) = amplitude * cos(x + phase)
            Family::EncoderEccentricity => EncoderEccentricity {
                order,
                amplitude,
                phase: wrapped(phase + FRAC_PI_2),
            }
            .into(),
            Family::StribeckFriction => StribeckFriction {
                amplitude: first,
                speed: order,
            }
            .into(),
            Family::LeadError => LeadError {
                order,
                amplitude,
                phase,
            }
            .into(),
            Family::BallPassage => BallPassage {
                order,
                amplitude,
                phase,
            }
            .into(),
            Family::AxialCompliance => AxialCompliance { hz: order }.into(),
            Family::Backlash => Backlash { value: first }.into(),
            Family::Linear(kind) => linear(kind, first)?,
            Family::Unnamed(_) => return None,
        };
        EffectModel::new(self.place, effect)
    }

    /// Which kind a torque over a motor's angle is, by its order alone: a rule, not a measurement. A record shows the order; a report
    /// lists candidates for the cause. The orders that a three-phase winding's flux makes (multiples of 6
    /// per electrical turn) are torque harmonics, other multiples of the poles or slots cogging, other whole
    /// electrical orders torque harmonics, 1 and 2 per turn a coupling, the rest has no name of its own.
    fn angle_torque(&self, model: &Model, order: f64, amplitude: f64, phase: f64) -> AnyEffect {
        let pole_pairs = self.axis().map_or(1, |axis| model.motor(axis).pole_pairs);
        let electrical = f64::from(pole_pairs);
        if multiple(order, 6.0 * electrical) {
            TorqueHarmonic {
                order: order / electrical,
                amplitude,
                phase,
            }
            .into()
        } else if multiple(order, 2.0 * electrical) || multiple(order, slots(2 * pole_pairs)) {
            Cogging {
                order,
                amplitude,
                phase,
            }
            .into()
        } else if multiple(order, electrical) {
            TorqueHarmonic {
                order: order / electrical,
                amplitude,
                phase,
            }
            .into()
        } else if order == 1.0 || order == 2.0 {
            CouplingMisalignment {
                order,
                amplitude,
                phase,
            }
            .into()
        } else {
            AnglePeriodic {
                order,
                amplitude,
                phase,
            }
            .into()
        }
    }
}

/// An effect that is linear in one number.
pub(crate) fn linear(kind: &str, value: f64) -> Option<AnyEffect> {
    let number = AnyEffect::kind_named(kind)?.linear()?.number;
    AnyEffect::from_parameters(kind, [(number, value)]).ok()
}

/// An angle in -pi..=pi.
fn wrapped(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}
