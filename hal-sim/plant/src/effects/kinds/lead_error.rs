//! Periodic error of the screw's lead.

use super::{
    Coordinate, Deserialize, Effect, Example, Place, Places, Recognition, Serialize, Site, Term,
    limits,
};

/// `amplitude * cos(order * (theta_screw - theta_nut) + phase)`, added to the travel; the axial force works back on
/// the shafts through the same slope.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeadError {
    /// Periods per turn of screw against nut; above 0.
    #[serde(deserialize_with = "limits::order")]
    pub order: f64,
    /// Amplitude, m.
    #[serde(deserialize_with = "limits::finite")]
    pub amplitude: f64,
    /// Phase, rad.
    #[serde(default, deserialize_with = "limits::finite")]
    pub phase: f64,
}

impl Effect for LeadError {
    const KIND: &'static str = "lead_error";
    const PLACES: Places = Places::Feed;
    const RECOGNITION: Recognition = Recognition::Family;
    const EXAMPLE: Example = (
        Place::Feed,
        &[("order", 1.0), ("amplitude", 1e-6), ("phase", 1.0)],
    );

    fn terms(&self) -> Vec<Term> {
        vec![Term::periodic(
            Site::Travel,
            Coordinate::RelativeAngle,
            self.order,
            self.amplitude,
            self.phase,
        )]
    }
}
