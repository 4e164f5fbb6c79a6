//! Friction that is higher at rest (Stribeck).

use super::{
    Coordinate, Deserialize, Effect, Example, Law, Place, Places, Recognition, Serialize, Site,
    Term, limits,
};

/// `amplitude * exp(-(v / speed)^2)`, added to the level of the bearing's Coulomb friction (at a motor) or the
/// guideway's (at the feed).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StribeckFriction {
    /// Level above Coulomb at rest, N m (motor) or N (feed); 0 or above.
    #[serde(deserialize_with = "limits::non_negative")]
    pub amplitude: f64,
    /// Speed of its decay to 1/e, rad/s (motor) or m/s (feed); above 0.
    #[serde(deserialize_with = "limits::positive")]
    pub speed: f64,
}

impl Effect for StribeckFriction {
    const KIND: &'static str = "stribeck_friction";
    const PLACES: Places = Places::MotorOrFeed;
    const RECOGNITION: Recognition = Recognition::Family;
    const EXAMPLE: Example = (Place::Feed, &[("amplitude", 10.0), ("speed", 0.001)]);

    fn terms(&self) -> Vec<Term> {
        let law = Law::Decay {
            amplitude: self.amplitude,
            width: self.speed,
        };
        vec![Term {
            site: Site::Friction,
            coordinate: Coordinate::Speed,
            law,
        }]
    }
}
