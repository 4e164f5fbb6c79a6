//! Torque that repeats with the motor's angle.

use super::{
    Coordinate, Deserialize, Effect, Example, Place, Places, Recognition, Serialize, Site, Term,
    limits,
};

/// `amplitude * cos(order * theta + phase)` on the shaft: a belt tooth, a bearing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AnglePeriodic {
    /// Periods per mechanical turn, not always whole; above 0.
    #[serde(deserialize_with = "limits::order")]
    pub order: f64,
    /// Amplitude, N m.
    #[serde(deserialize_with = "limits::finite")]
    pub amplitude: f64,
    /// Phase, rad.
    #[serde(default, deserialize_with = "limits::finite")]
    pub phase: f64,
}

impl Effect for AnglePeriodic {
    const KIND: &'static str = "angle_periodic";
    const PLACES: Places = Places::Motor;
    const RECOGNITION: Recognition = Recognition::Family;
    const EXAMPLE: Example = (Place::Screw, &[("order", 2.0), ("amplitude", 0.001)]);

    fn terms(&self) -> Vec<Term> {
        vec![Term::periodic(
            Site::ShaftTorque,
            Coordinate::MechanicalAngle,
            self.order,
            self.amplitude,
            self.phase,
        )]
    }
}
