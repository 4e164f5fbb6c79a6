//! Torque harmonic beyond the declared ones (Eq 15).

use super::{
    Coordinate, Deserialize, Effect, Example, Place, Places, Recognition, Serialize, Site, Term,
    limits,
};

/// `amplitude * cos(order * theta_e + phase)` on the shaft, beside the declared `torque_harmonics`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TorqueHarmonic {
    /// Periods per electrical turn; above 0.
    #[serde(deserialize_with = "limits::order")]
    pub order: f64,
    /// Amplitude, N m.
    #[serde(deserialize_with = "limits::finite")]
    pub amplitude: f64,
    /// Phase, rad.
    #[serde(default, deserialize_with = "limits::finite")]
    pub phase: f64,
}

impl Effect for TorqueHarmonic {
    const KIND: &'static str = "torque_harmonic";
    const PLACES: Places = Places::Motor;
    const RECOGNITION: Recognition = Recognition::Family;
    const EXAMPLE: Example = (Place::Screw, &[("order", 2.0), ("amplitude", 0.001)]);

    fn terms(&self) -> Vec<Term> {
        vec![Term::periodic(
            Site::ShaftTorque,
            Coordinate::ElectricalAngle,
            self.order,
            self.amplitude,
            self.phase,
        )]
    }
}
