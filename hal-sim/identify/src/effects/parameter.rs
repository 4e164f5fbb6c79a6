//! Declared parameters and nuisances of a record, and what is known of them before it is seen.

use crate::regression::normal::Prior;
use plant::Axis;
use plant::model::Model;

/// A declared parameter, or a nuisance of the record, that is adjusted before any effect is looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Parameter {
    /// Of one motor.
    Motor(Axis, MotorParameter),
    /// Coulomb friction of the pair.
    Pair,
    /// Coulomb friction of the guideway.
    GuidewayCoulomb,
    /// The part of the pair's friction that is the guideway's, where the model declares none there: torques show the sum alone. What the
    /// guideway has winds up the screw at a reversal, as a play does.
    GuidewayShare,
    /// Viscous friction of the guideway.
    GuidewayViscous,
    /// Load force.
    Load,
    /// The table's mass on a screw of a measured resonance, relative.
    TableMass {
        /// Half of the interval of its measurement, relative.
        within: f64,
    },
    /// How much of a measured curve, by its number, the record has: 1 as it was learnt.
    Curve(usize),
    /// Rounding of an encoder in the speed at an end of a record, as a share of a count a row. A record's second derivative ends there, so
    /// the rounding of its last rows is a step of the speed. At low frequencies that is far more than the rounding of the rows between.
    /// A transient of a record's ends is a polynomial of the frequency (Pintelon and Schoukens, *System Identification: A Frequency Domain
    /// Approach*, 2012, section 6.3.2).
    EndSpeed {
        /// Of which motor.
        axis: Axis,
        /// First or last row.
        row: usize,
    },
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
        /// One count of its encoder, m of the table.
        count_m: f64,
    },
    /// The shaft moves within the count that is read: by so much from the first to the last of those rows, m.
    RestDrift {
        /// First row.
        from: usize,
        /// Row after the last.
        to: usize,
        /// One count of its encoder, m of the table.
        count_m: f64,
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
    /// What a voltage has beyond the mean, over a step of the current's reference, in the inductance's voltage over that
    /// step: a nuisance. The loop answers a step within the control periods until the next, and a record with one row a step
    /// reads always the same of them.
    ReferenceStep,
    /// Friction that is not there yet after a reversal, as a share of what grows over [`REACH_RAD`]: a nuisance. Bristles bend first. A
    /// reversal is short, and is not compared itself. But a coarse encoder has a filter that carries its area far.
    Reversal,
    /// A constant load torque, N m: that of a motor of which nobody says what it drives.
    Load,
    /// Time by which the angle is read before or after the table, s: a nuisance. Drives whose two current loops are
    /// half a period apart read the angles so.
    ReadingLag,
    /// Time by which the commanded voltages are younger than those of the control period that ends at their row, control periods: a
    /// nuisance.
    VoltageLag,
    /// Time by which the frame of the commanded voltages is off, control periods: a nuisance.
    AngleLag,
    /// Electrical angle by which the zero of the encoder is off, rad: a nuisance. Alignment leaves a degree, a plate of another make more.
    AngleZero,
}

/// Angle over which friction grows after a reversal, rad: that of bearings is less (Armstrong-Helouvry, Dupont and Canudas de Wit,
/// *Automatica* 30, 1994: some um of sliding), and at a coarse encoder's rows it would be within one.
pub(crate) const REACH_RAD: f64 = 0.02;

/// Standard deviation of a measured curve's size about that with which the judge learnt it, beside free plate values.
const CURVE_SPREAD: f64 = 0.3;

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
            ReferenceStep,
            VoltageLag,
            AngleLag,
            AngleZero,
            ReadingLag,
        ]
        .map(|which| Parameter::Motor(axis, which))
        .to_vec()
    }

    /// All that it declares of the feed.
    pub fn of_the_feed() -> [Parameter; 5] {
        use Parameter::*;
        [Pair, GuidewayCoulomb, GuidewayShare, GuidewayViscous, Load]
    }

    /// Whether it is the machine's and not the record's.
    pub fn is_of_the_machine(self) -> bool {
        !matches!(
            self,
            Parameter::EndSpeed { .. }
                | Parameter::TableOrigin { .. }
                | Parameter::RestOffset { .. }
                | Parameter::RestDrift { .. }
        )
    }

    /// Whether it is a plate value with a tolerance.
    pub fn is_of_the_plate(self) -> bool {
        use MotorParameter::*;
        match self {
            Parameter::Motor(_, which) => matches!(
                which,
                Inertia | Viscous | Coulomb | Flux | Resistance | Inductance
            ),
            _ => matches!(
                self,
                Parameter::Pair | Parameter::GuidewayCoulomb | Parameter::GuidewayViscous
            ),
        }
    }

    /// Whether it shows in a torque balance.
    pub fn is_torque(self) -> bool {
        use MotorParameter::*;
        match self {
            Parameter::Motor(_, which) => {
                matches!(which, Inertia | Viscous | Coulomb | Flux | Load)
            }
            _ => self.is_of_the_machine(),
        }
    }

    /// How far the parameter may lie from its declared value: the tolerance of plate values (3 % of resistance,
    /// inductance, inertia; 1 % of flux; 20 % of friction), with a tenth more for what the record adds. A friction that is declared
    /// 20 % too small is a quarter larger than declared.
    fn bound(self) -> f64 {
        match self {
            Parameter::Motor(_, which) => match which {
                MotorParameter::Inertia
                | MotorParameter::Resistance
                | MotorParameter::Inductance => 0.033,
                MotorParameter::Flux => 0.011,
                MotorParameter::Viscous | MotorParameter::Coulomb => 0.275,
                MotorParameter::Load => f64::INFINITY,
                // The period that is read has between none and twice the mean.
                MotorParameter::ReferenceStep => 1.0,
                MotorParameter::Reversal => 3.0,
                MotorParameter::AngleLag => 0.4,
                // Three degrees: then the motor has 0.14 % less torque, which its plate allows for.
                MotorParameter::AngleZero => 0.053,
                MotorParameter::VoltageLag => 2.0,
                MotorParameter::ReadingLag => 1e-4,
            },
            Parameter::Pair | Parameter::GuidewayCoulomb | Parameter::GuidewayViscous => 0.275,
            Parameter::GuidewayShare => 1.0,
            Parameter::Load => 0.005,
            Parameter::TableMass { within } => 3.0 * within,
            Parameter::Curve(_) => f64::INFINITY,
            // Each of two rows is rounded by half a count at most.
            Parameter::EndSpeed { .. } => 1.0,
            Parameter::TableOrigin { within } => within,
            Parameter::RestOffset { count_m, .. } | Parameter::RestDrift { count_m, .. } => count_m,
        }
    }

    /// What is known of it before the record is seen.
    pub fn prior(self) -> Prior {
        match self {
            Parameter::Curve(_) => Prior::about(1.0, CURVE_SPREAD),
            _ => Prior::within(self.spread(), self.bound()),
        }
    }

    /// A change of it that the new model takes: a value that was measured does not leave its interval. What the record has beyond that
    /// is the balances' own error.
    pub fn within_interval(self, model: &Model, change: f64) -> f64 {
        match self.interval(model) {
            Some(half) => change.clamp(-half, half),
            None => change,
        }
    }

    /// Half of the interval of a value that was measured, relative.
    fn interval(self, model: &Model) -> Option<f64> {
        let (Parameter::Motor(axis, which), Some(measured)) = (self, &model.measured) else {
            return None;
        };
        let measured = measured.motor(axis);
        let half = match which {
            MotorParameter::Resistance => measured.resistance,
            MotorParameter::Inductance => measured.inductance,
            MotorParameter::Flux => measured.flux,
            MotorParameter::Inertia => measured.inertia,
            _ => return None,
        };
        Some(half)
    }

    /// Standard deviation of the parameter before the record is seen: that of an even spread over its bounds. What a count rounds
    /// is spread evenly over it, so that its variance is a twelfth of the count's square, and the difference of two that are
    /// rounded has twice that.
    fn spread(self) -> f64 {
        match self {
            Parameter::TableOrigin { within } => 0.2 * within,
            // Twice what its interval says: commissioning had a true mass 1.7 of its intervals away.
            Parameter::TableMass { within } => within,
            Parameter::EndSpeed { .. } => 1.0 / 6.0_f64.sqrt(),
            Parameter::RestOffset { count_m, .. } => count_m / 12.0_f64.sqrt(),
            Parameter::RestDrift { count_m, .. } => count_m / 6.0_f64.sqrt(),
            _ => self.bound() / 3.0_f64.sqrt(),
        }
    }
}
