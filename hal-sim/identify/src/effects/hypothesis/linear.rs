//! Effects whose terms are linear in one number: excitation and limits follow from where the terms act and on what they depend.

use super::Hypothesis;
use super::effect::linear;
use crate::balance::Balance;
use crate::effects::family::Family;
use crate::effects::limits::{
    LEAST_DECAY, LEAST_PERIODS, LEAST_TRAVEL, MOST_ANGLE_ERROR, MOST_DEAD_TIME, MOST_FLUX_DRIFT,
    MOST_LEAD_SCALE, MOST_OFFSET, MOST_RESISTANCE_DRIFT, NOT_TURNED, TORQUE, range,
};
use crate::signal::along::Along;
use plant::Axis;
use plant::effects::{Coordinate, Law, Site, Term};
use plant::machine::DEFAULT_BUS_VOLTAGE;
use std::f64::consts::TAU;

impl Hypothesis {
    /// The terms of a linear kind whose number is `value`.
    fn terms(&self, value: f64) -> Vec<Term> {
        match self.family {
            Family::Linear(kind) => {
                linear(kind, value).map_or_else(Vec::new, |effect| effect.terms())
            }
            _ => Vec::new(),
        }
    }

    /// What a linear kind is a shape over.
    pub(crate) fn along(&self) -> Option<Along> {
        let axis = self.axis();
        match self.terms(1.0).first()?.coordinate {
            Coordinate::NominalTravel | Coordinate::TablePosition => Some(Along::TablePosition),
            Coordinate::Speed => Some(axis.map_or(Along::RelativeSpeed, Along::Speed)),
            Coordinate::ElectricalAngle | Coordinate::MechanicalAngle => axis.map(Along::Angle),
            Coordinate::RelativeAngle => Some(Along::RelativeAngle),
            Coordinate::Time => Some(Along::Time),
            Coordinate::None | Coordinate::PhaseCurrent => None,
        }
    }

    /// A coordinate of each row.
    fn values<'b>(
        &self,
        coordinate: Coordinate,
        balance: &'b Balance,
    ) -> Box<dyn Iterator<Item = f64> + 'b> {
        let signals = balance.signals;
        let motor = &signals.motors[self.axis().map_or(0, Axis::index)];
        let of = |values: &'b [f64], unit: f64| Box::new(values.iter().map(move |x| unit * x));
        match (coordinate, self.axis()) {
            (Coordinate::NominalTravel | Coordinate::TablePosition, _) => {
                of(&signals.relative, balance.lead)
            }
            (Coordinate::RelativeAngle, _) => of(&signals.relative, 1.0),
            (Coordinate::Speed, None) => of(&signals.relative_speed, balance.lead),
            (Coordinate::Speed, Some(_)) => of(&motor.omega, 1.0),
            (Coordinate::MechanicalAngle, _) => of(&motor.travel, 1.0),
            (Coordinate::ElectricalAngle, axis) => {
                let pole_pairs = axis.map_or(1, |axis| balance.model.motor(axis).pole_pairs);
                of(&motor.travel, f64::from(pole_pairs))
            }
            (Coordinate::Time, _) => Box::new([0.0, signals.run_s()].into_iter()),
            (Coordinate::PhaseCurrent, _) => Box::new([-motor.peak_a, motor.peak_a].into_iter()),
            (Coordinate::None, _) => Box::new(std::iter::empty()),
        }
    }

    /// Whether a record can show a linear kind: each coordinate of its terms must change.
    pub(crate) fn excited(&self, balance: &Balance) -> Result<(), &'static str> {
        for term in self.terms(1.0) {
            let width = range(self.values(term.coordinate, balance));
            let (enough, reason) = match term.coordinate {
                Coordinate::NominalTravel | Coordinate::TablePosition => {
                    let turns = width / balance.lead.abs() / TAU;
                    (turns >= LEAST_TRAVEL, "the table does not move far enough")
                }
                Coordinate::Speed => {
                    let speeds = self.values(term.coordinate, balance);
                    let fastest = speeds.fold(0.0_f64, |most, w| most.max(w.abs()));
                    (
                        width > LEAST_DECAY * fastest,
                        "the record has one speed only",
                    )
                }
                Coordinate::ElectricalAngle
                | Coordinate::MechanicalAngle
                | Coordinate::RelativeAngle => {
                    let order = match term.law {
                        Law::Periodic { order, .. } => order,
                        _ => 1.0,
                    };
                    (width / TAU * order >= LEAST_PERIODS, NOT_TURNED)
                }
                Coordinate::None | Coordinate::Time | Coordinate::PhaseCurrent => (true, ""),
            };
            if !enough {
                return Err(reason);
            }
        }
        Ok(())
    }

    /// Whether what a linear kind adds over the record is within what its site can have.
    pub(crate) fn within_site(&self, value: f64, balance: &Balance) -> Result<(), &'static str> {
        let axis = self.axis().unwrap_or(Axis::Screw);
        let motor = balance.model.motor(axis);
        let pole_pairs = f64::from(motor.pole_pairs);
        let peak_a = balance.signals.motors[axis.index()].peak_a;
        let torque = pole_pairs * motor.flux_wb * peak_a;
        let lead = balance.lead.abs();
        for term in self.terms(value) {
            let over = || self.values(term.coordinate, balance);
            let width = range(over());
            // A constant is the same everywhere; of what changes the plate has the mean.
            let change = match term.coordinate {
                Coordinate::None => term.law.value(0.0).abs(),
                _ => range(over().map(|x| term.law.value(x))),
            };
            let (most, reason) = match term.site {
                Site::ShaftTorque | Site::PairTorque => (torque, TORQUE),
                Site::TableForce => (torque / lead, TORQUE),
                Site::Friction if self.axis().is_none() => (torque / lead, TORQUE),
                Site::Friction => (torque, TORQUE),
                Site::Travel => (MOST_LEAD_SCALE * width, "more than 1 % of the lead"),
                Site::Flux => (MOST_FLUX_DRIFT, "more than magnets change over 130 K"),
                Site::Resistance => (MOST_RESISTANCE_DRIFT, "more than copper changes over 130 K"),
                Site::CurrentReadingA | Site::CurrentReadingB => (
                    MOST_OFFSET * peak_a,
                    "more than a fifth of the greatest current",
                ),
                Site::PhaseVoltage => (
                    MOST_DEAD_TIME * DEFAULT_BUS_VOLTAGE,
                    "more than a tenth of the bus voltage",
                ),
                Site::EncoderReading => (
                    MOST_ANGLE_ERROR / pole_pairs,
                    "an angle error with which the motor would not run",
                ),
                Site::AxialResonance | Site::AxialGap => {
                    (0.0, "its site is not linear: a family must tell it")
                }
            };
            if change > most {
                return Err(reason);
            }
        }
        Ok(())
    }
}
