//! Dead time of the bridge.

use super::{
    Coordinate, Deserialize, Effect, Example, Law, Place, Places, Recognition, Serialize, Site,
    Term, limits,
};

/// Voltage lost per phase against the sign of its current. At zero current the loss takes the value, up to its size,
/// that keeps the current there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeadTime {
    /// Lost voltage, V; 0 or above: bus voltage times PWM frequency times dead time.
    #[serde(deserialize_with = "limits::non_negative")]
    pub value: f64,
}

impl Effect for DeadTime {
    const KIND: &'static str = "dead_time";
    const PLACES: Places = Places::Motor;
    const RECOGNITION: Recognition = Recognition::Family;
    const EXAMPLE: Example = (Place::Both, &[("value", 2.0)]);

    fn terms(&self) -> Vec<Term> {
        let law = Law::Opposing { value: self.value };
        vec![Term {
            site: Site::PhaseVoltage,
            coordinate: Coordinate::PhaseCurrent,
            law,
        }]
    }
}
