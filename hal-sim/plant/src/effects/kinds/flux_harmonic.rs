//! Harmonic of the magnet's flux.

use super::{
    Coordinate, Deserialize, Effect, Example, Place, Places, Recognition, Serialize, Site, Term,
    limits,
};

/// Flux times `1 + amplitude * cos(order * theta_e + phase)`: the same shape in the back-EMF and, times `i_q`, in the
/// torque, so that no power is lost between them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FluxHarmonic {
    /// Periods per electrical turn; above 0.
    #[serde(deserialize_with = "limits::order")]
    pub order: f64,
    /// Amplitude relative to the flux.
    #[serde(deserialize_with = "limits::finite")]
    pub amplitude: f64,
    /// Phase, rad.
    #[serde(default, deserialize_with = "limits::finite")]
    pub phase: f64,
}

impl Effect for FluxHarmonic {
    const KIND: &'static str = "flux_harmonic";
    const PLACES: Places = Places::Motor;
    const RECOGNITION: Recognition = Recognition::Family;
    const EXAMPLE: Example = (Place::Screw, &[("order", 2.0), ("amplitude", 0.001)]);

    fn terms(&self) -> Vec<Term> {
        vec![Term::periodic(
            Site::Flux,
            Coordinate::ElectricalAngle,
            self.order,
            self.amplitude,
            self.phase,
        )]
    }
}
