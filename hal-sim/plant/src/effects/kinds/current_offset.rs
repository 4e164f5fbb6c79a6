//! Offset of the current measurement (the cause of Eq 13).

use super::{
    Deserialize, Effect, Example, Place, Places, Recognition, Serialize, Site, Term, limits,
};

/// Added to the measured phase currents. The machine's own currents stay as they are; the torque ripple of Eq 13 comes
/// from the control that trusts the reading.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurrentOffset {
    /// Offset of phase a, A.
    #[serde(deserialize_with = "limits::finite")]
    pub off_a: f64,
    /// Offset of phase b, A.
    #[serde(deserialize_with = "limits::finite")]
    pub off_b: f64,
}

impl Effect for CurrentOffset {
    const KIND: &'static str = "current_offset";
    const PLACES: Places = Places::Motor;
    const RECOGNITION: Recognition = Recognition::Family;
    const EXAMPLE: Example = (Place::Nut, &[("off_a", 0.01), ("off_b", -0.01)]);

    fn terms(&self) -> Vec<Term> {
        vec![
            Term::constant(Site::CurrentReadingA, self.off_a),
            Term::constant(Site::CurrentReadingB, self.off_b),
        ]
    }
}
