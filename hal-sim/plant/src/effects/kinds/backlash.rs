//! Play between screw and nut.

use super::{
    Deserialize, Effect, Example, Place, Places, Recognition, Serialize, Site, Term, limits,
};

/// Dead zone in the axial spring: the table moves freely by `value` between the flanks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Backlash {
    /// Width of the play, m; 0 or above.
    #[serde(deserialize_with = "limits::non_negative")]
    pub value: f64,
}

impl Effect for Backlash {
    const KIND: &'static str = "backlash";
    const PLACES: Places = Places::Feed;
    const RECOGNITION: Recognition = Recognition::Family;
    const EXAMPLE: Example = (Place::Feed, &[("value", 1e-5)]);

    fn terms(&self) -> Vec<Term> {
        vec![Term::constant(Site::AxialGap, self.value)]
    }
}
