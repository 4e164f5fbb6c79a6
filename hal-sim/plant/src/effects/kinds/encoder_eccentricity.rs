//! An encoder's error: its disc is eccentric, or its magnet's field is not round.

use super::{
    Coordinate, Deserialize, Effect, Example, Place, Places, Recognition, Serialize, Site, Term,
    limits,
};
use std::f64::consts::FRAC_PI_2;

/// Measured angle = true + `amplitude * sin(order * true + phase)`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EncoderEccentricity {
    /// 1, 2 or 4 per mechanical turn.
    #[serde(deserialize_with = "limits::of_encoder")]
    pub order: f64,
    /// Amplitude, rad.
    #[serde(deserialize_with = "limits::finite")]
    pub amplitude: f64,
    /// Phase, rad.
    #[serde(default, deserialize_with = "limits::finite")]
    pub phase: f64,
}

impl Effect for EncoderEccentricity {
    const KIND: &'static str = "encoder_eccentricity";
    const PLACES: Places = Places::Motor;
    const RECOGNITION: Recognition = Recognition::Family;
    const EXAMPLE: Example = (Place::Screw, &[("order", 2.0), ("amplitude", 0.001)]);

    fn terms(&self) -> Vec<Term> {
        let phase = self.phase - FRAC_PI_2; // a sine as the cosine of the common law
        vec![Term::periodic(
            Site::EncoderReading,
            Coordinate::MechanicalAngle,
            self.order,
            self.amplitude,
            phase,
        )]
    }
}
