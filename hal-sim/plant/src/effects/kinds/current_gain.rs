//! Gain errors of the current measurement (the cause of Eq 14).

use super::{
    Coordinate, Deserialize, Effect, Example, Law, Place, Places, Recognition, Serialize, Site,
    Term, limits,
};

/// Measured phase current = true x `1 + gain`. The machine's own currents stay as they are; the torque ripple of Eq 14
/// comes from the control that trusts the reading.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurrentGain {
    /// Relative error of phase a; above -1.
    #[serde(deserialize_with = "limits::above_minus_one")]
    pub gain_a: f64,
    /// Relative error of phase b; above -1.
    #[serde(deserialize_with = "limits::above_minus_one")]
    pub gain_b: f64,
}

impl Effect for CurrentGain {
    const KIND: &'static str = "current_gain";
    const PLACES: Places = Places::Motor;
    const RECOGNITION: Recognition = Recognition::Family;
    const EXAMPLE: Example = (Place::Nut, &[("gain_a", 0.01), ("gain_b", -0.01)]);

    fn terms(&self) -> Vec<Term> {
        [
            (Site::CurrentReadingA, self.gain_a),
            (Site::CurrentReadingB, self.gain_b),
        ]
        .map(|(site, slope)| Term {
            site,
            coordinate: Coordinate::PhaseCurrent,
            law: Law::Linear { slope },
        })
        .to_vec()
    }
}
