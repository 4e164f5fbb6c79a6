//! Screw softer than declared.

use super::{
    Deserialize, Effect, Example, Place, Places, Recognition, Serialize, Site, Term, limits,
};

/// The table's resonance on the axial stiffness, in place of the declared stiffness: `k = mass * (2 pi hz)^2`. The
/// declared damping ratio stays.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AxialCompliance {
    /// Resonance, Hz; above 0.
    #[serde(deserialize_with = "limits::positive")]
    pub hz: f64,
}

impl Effect for AxialCompliance {
    const KIND: &'static str = "axial_compliance";
    const PLACES: Places = Places::Feed;
    const RECOGNITION: Recognition = Recognition::Family;
    const EXAMPLE: Example = (Place::Feed, &[("hz", 90.0)]);

    fn terms(&self) -> Vec<Term> {
        vec![Term::constant(Site::AxialResonance, self.hz)]
    }
}
