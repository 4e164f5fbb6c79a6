//! Torque of magnets against slots.

use super::{
    Coordinate, Deserialize, Effect, Example, Place, Places, Recognition, Serialize, Site, Term,
    limits,
};

/// `amplitude * cos(order * theta + phase)` on the shaft, whatever the current.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cogging {
    /// Periods per mechanical turn, a multiple of the pole count or slot count; whole.
    #[serde(deserialize_with = "limits::whole_order")]
    pub order: f64,
    /// Amplitude, N m.
    #[serde(deserialize_with = "limits::finite")]
    pub amplitude: f64,
    /// Phase, rad.
    #[serde(default, deserialize_with = "limits::finite")]
    pub phase: f64,
}

impl Effect for Cogging {
    const KIND: &'static str = "cogging";
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
