//! Torque of a misaligned coupling.

use super::{
    Coordinate, Deserialize, Effect, Example, Place, Places, Recognition, Serialize, Site, Term,
    limits,
};

/// `amplitude * cos(order * theta + phase)` on the shaft.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CouplingMisalignment {
    /// 1 or 2 per mechanical turn.
    #[serde(deserialize_with = "limits::first_or_second")]
    pub order: f64,
    /// Amplitude, N m.
    #[serde(deserialize_with = "limits::finite")]
    pub amplitude: f64,
    /// Phase, rad.
    #[serde(default, deserialize_with = "limits::finite")]
    pub phase: f64,
}

impl Effect for CouplingMisalignment {
    const KIND: &'static str = "coupling_misalignment";
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
