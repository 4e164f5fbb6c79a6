//! Winding that warms during the run.

use super::{
    Coordinate, Deserialize, Effect, Example, Law, Place, Places, Recognition, Serialize, Site,
    Term, limits,
};

/// Resistance times `1 + value * t / duration_s`, constant after `duration_s`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResistanceDrift {
    /// Relative change over the run; above -1.
    #[serde(deserialize_with = "limits::above_minus_one")]
    pub value: f64,
    /// Length of the run, s; above 0; 10 if not given.
    #[serde(
        default = "super::default_run_s",
        deserialize_with = "limits::positive"
    )]
    pub duration_s: f64,
}

impl Effect for ResistanceDrift {
    const KIND: &'static str = "resistance_drift";
    const PLACES: Places = Places::Motor;
    const RECOGNITION: Recognition = Recognition::Family;
    const EXAMPLE: Example = (Place::Screw, &[("value", 0.1)]);

    fn terms(&self) -> Vec<Term> {
        let law = Law::Ramp {
            value: self.value,
            duration: self.duration_s,
        };
        vec![Term {
            site: Site::Resistance,
            coordinate: Coordinate::Time,
            law,
        }]
    }
}
