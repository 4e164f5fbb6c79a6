//! Torque of balls that enter and leave the load zone.

use super::{
    Coordinate, Deserialize, Effect, Example, Place, Places, Recognition, Serialize, Site, Term,
    limits,
};

/// `amplitude * cos(order * (theta_screw - theta_nut) + phase)` on the pair, in addition to its Coulomb friction and
/// with the sign of its friction at positive relative speed: against the screw, with the nut.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BallPassage {
    /// Periods per turn of screw against nut, not whole; above 0.
    #[serde(deserialize_with = "limits::order")]
    pub order: f64,
    /// Amplitude, N m.
    #[serde(deserialize_with = "limits::finite")]
    pub amplitude: f64,
    /// Phase, rad.
    #[serde(default, deserialize_with = "limits::finite")]
    pub phase: f64,
}

impl Effect for BallPassage {
    const KIND: &'static str = "ball_passage";
    const PLACES: Places = Places::Feed;
    const RECOGNITION: Recognition = Recognition::Family;
    const EXAMPLE: Example = (Place::Feed, &[("order", 11.3), ("amplitude", 0.01)]);

    fn terms(&self) -> Vec<Term> {
        vec![Term::periodic(
            Site::PairTorque,
            Coordinate::RelativeAngle,
            self.order,
            self.amplitude,
            self.phase,
        )]
    }
}
