//! What may be missing: every kind of effect of the plant, as columns of a regression.

mod effect;
mod linear;
mod unnamed;

use crate::balance::{Balance, Contribution};
use crate::effects::family::Family;
use crate::machines::Machine;
use crate::regression::normal::Prior;
use crate::signal::along::{LEAST_ORDER, LEAST_RELATIVE_ORDER};
use plant::Axis;
use plant::effects::*;
use plant::model::Model;
use std::rc::Rc;

/// A family at a place, with the one number in which it is not linear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hypothesis {
    /// What.
    pub family: Family,
    /// Where.
    pub place: Place,
    /// Order, frequency (Hz) or speed (rad/s, m/s); without meaning for families that have none.
    pub shape: f64,
}

/// Relative tolerance of a damping ratio on a plate, 20 % and a tenth more, and the even spread over it.
const DAMPING_BOUND: f64 = 0.22;
const DAMPING_SPREAD: f64 = 0.127;

impl Hypothesis {
    /// A hypothesis.
    pub fn new(family: Family, place: Place, shape: f64) -> Self {
        Hypothesis {
            family,
            place,
            shape,
        }
    }

    /// Whether a kind of machine can have it there.
    pub(crate) fn is_on(&self, machine: &dyn Machine) -> bool {
        let there = match self.place {
            Place::Feed => machine.has_feed(),
            Place::Both => machine.axes().len() == 2,
            place => machine.axes().iter().any(|axis| place.has(*axis)),
        };
        there && machine.can_have(self.family)
    }

    /// The family in words of a model file; torque over angle stands for the kinds that its order tells apart.
    pub fn name(&self) -> &'static str {
        match self.family {
            Family::CurrentOffset => "current_offset",
            Family::CurrentGain => "current_gain",
            Family::DeadTime => "dead_time",
            Family::ResistanceDrift => "resistance_drift",
            Family::FluxDrift => "flux_drift",
            Family::AngleTorque => "torque over angle",
            Family::TimePeriodic => "time_periodic",
            Family::FluxHarmonic => "flux_harmonic",
            Family::EncoderEccentricity => "encoder_eccentricity",
            Family::StribeckFriction => "stribeck_friction",
            Family::LeadError => "lead_error",
            Family::BallPassage => "ball_passage",
            Family::AxialCompliance => "axial_compliance",
            Family::Backlash => "backlash",
            Family::Linear(kind) => kind,
            Family::Unnamed(_) => "no kind",
        }
    }

    /// Number of linear parameters.
    pub fn columns(&self) -> usize {
        match self.family {
            Family::DeadTime
            | Family::ResistanceDrift
            | Family::FluxDrift
            | Family::StribeckFriction
            | Family::AxialCompliance
            | Family::Backlash
            | Family::Linear(_) => 1,
            Family::Unnamed(unnamed) => unnamed.columns(),
            _ => 2,
        }
    }

    /// Whether its shape is refined by the record.
    pub fn has_free_shape(&self) -> bool {
        match self.family {
            Family::AngleTorque
            | Family::TimePeriodic
            | Family::LeadError
            | Family::BallPassage
            | Family::StribeckFriction
            | Family::AxialCompliance
            | Family::DeadTime => true,
            Family::Unnamed(unnamed) => unnamed.along.repeats(),
            // Whole orders only.
            Family::FluxHarmonic | Family::EncoderEccentricity => false,
            _ => false,
        }
    }

    /// How many nuisances come with it.
    pub fn nuisances(&self) -> usize {
        match self.family {
            Family::LeadError => 2,
            Family::AxialCompliance => 1,
            _ => 0,
        }
    }

    /// What may come with it in a size that the effect does not tell: the axial force works back on the shafts through
    /// the slope of a lead error, as far as the thread's flanks let it; the damping of a soft screw shows where that of
    /// the declared one does not.
    pub fn nuisance_contributions(
        &self,
        balance: &Balance,
        run_s: f64,
    ) -> Vec<(Contribution, Prior)> {
        match self.family {
            Family::LeadError => {
                let back = Hypothesis {
                    family: Family::BallPassage,
                    ..*self
                };
                back.contributions(balance, run_s)
                    .iter()
                    .map(|contribution| (contribution.clone(), Prior::FREE))
                    .collect()
            }
            Family::AxialCompliance => {
                // Of the plate's ratio, as a change of the ratio about which it is taken.
                let plate = balance.model.feed.axial_damping_ratio / balance.damping;
                let prior = match plate == 1.0 {
                    true => Prior::within(DAMPING_SPREAD, DAMPING_BOUND),
                    false => Prior::about(plate - 1.0, DAMPING_SPREAD * plate),
                };
                vec![(balance.axial_damping(self.shape), prior)]
            }
            _ => Vec::new(),
        }
    }

    /// What is known of its linear parameters: a resonance has none.
    pub fn prior(&self) -> Prior {
        match self.family {
            Family::AxialCompliance => Prior::fixed(1.0),
            _ => Prior::FREE,
        }
    }

    /// Smallest value that its shape may take.
    pub fn least_shape(&self) -> f64 {
        match self.family {
            Family::AngleTorque => LEAST_ORDER,
            Family::LeadError | Family::BallPassage => LEAST_RELATIVE_ORDER,
            Family::TimePeriodic => 0.5,
            Family::DeadTime => 5e-4,
            _ => 1e-6,
        }
    }

    /// Whether it has a shape that is any number: an order that is a whole one is that.
    pub(crate) fn has_open_shape(&self) -> bool {
        let is_order = matches!(
            self.family,
            Family::AngleTorque | Family::LeadError | Family::BallPassage
        );
        self.has_free_shape() && !(is_order && self.shape.fract() == 0.0)
    }

    /// Whether it repeats with an angle or with time.
    pub fn is_periodic(&self) -> bool {
        matches!(
            self.family,
            Family::AngleTorque
                | Family::TimePeriodic
                | Family::FluxHarmonic
                | Family::EncoderEccentricity
                | Family::LeadError
                | Family::BallPassage
        )
    }

    /// The motor, if it is at one.
    pub fn axis(&self) -> Option<Axis> {
        Axis::ALL.into_iter().find(|&axis| self.place.has(axis))
    }

    /// One effect for each linear parameter, with that parameter 1 and the others 0.
    pub fn units(&self, model: &Model, run_s: f64) -> Vec<EffectModel> {
        let n = self.columns();
        (0..n)
            .filter_map(|k| {
                let mut values = vec![0.0; n];
                values[k] = 1.0;
                let unit = self.effect(model, run_s, &values)?;
                let AnyEffect::CurrentGain(_) = unit.effect() else {
                    return Some(unit);
                };
                let [gain_a, gain_b] = [values[0], values[1]];
                EffectModel::new(self.place, AnyEffect::from(CurrentGain { gain_a, gain_b }))
            })
            .collect()
    }

    /// What each linear parameter adds to the residuals per unit.
    pub fn contributions(&self, balance: &Balance, run_s: f64) -> Rc<Vec<Contribution>> {
        if self.has_scanned_shape() {
            // Hardly ever asked for twice.
            return Rc::new(self.computed(balance, run_s));
        }
        balance
            .memory
            .recall((self.family, self.place, self.shape.to_bits()), || {
                self.computed(balance, run_s)
            })
    }

    /// What it adds to the residuals with values of its linear parameters.
    pub(crate) fn whole(&self, balance: &Balance, values: &[f64]) -> Contribution {
        let mut whole = Contribution::default();
        let parts = self.contributions(balance, balance.signals.run_s());
        for (part, value) in parts.iter().zip(values) {
            whole.add_all(*value, part);
        }
        whole
    }

    /// Whether its shape is an order or a frequency that a scan of the residual suggests.
    pub fn has_scanned_shape(&self) -> bool {
        match self.family {
            Family::AngleTorque
            | Family::TimePeriodic
            | Family::LeadError
            | Family::BallPassage => true,
            Family::Unnamed(unnamed) => unnamed.along.repeats(),
            _ => false,
        }
    }

    fn computed(&self, balance: &Balance, run_s: f64) -> Vec<Contribution> {
        match self.family {
            // Its shape is the current over which a phase's sign turns round.
            Family::DeadTime => {
                let mut sum = Contribution::default();
                for axis in Axis::ALL.into_iter().filter(|&axis| self.place.has(axis)) {
                    balance.phase_voltage(axis, -1.0, self.shape, &mut sum);
                }
                vec![sum]
            }
            Family::Unnamed(unnamed) => unnamed.contributions(balance, self.shape),
            // 0: a load holds the table on a flank. 1: it changes flanks as it turns.
            Family::Backlash if self.shape != 0.0 => vec![balance.play(1.0)],
            _ => self
                .units(balance.model, run_s)
                .iter()
                .map(|unit| balance.effect(unit))
                .collect(),
        }
    }

    /// Share of what this effect explains in a channel that its own simplifications may leave there for others to pick
    /// up.
    pub fn remainder(&self) -> f64 {
        match self.family {
            Family::DeadTime => 2e-3,
            Family::StribeckFriction => 1e-2,
            Family::Backlash => 1e-4,
            _ => 3e-5,
        }
    }
}
