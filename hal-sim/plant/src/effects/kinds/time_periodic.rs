//! Torque that repeats with time.

use super::{
    Deserialize, Effect, Example, Place, Places, Recognition, Serialize, Site, Term, limits,
};

/// `amplitude * cos(2 pi hz t + phase)` on the shaft, locked to time, not to angle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimePeriodic {
    /// Frequency, Hz; above 0.
    #[serde(deserialize_with = "limits::positive")]
    pub hz: f64,
    /// Amplitude, N m.
    #[serde(deserialize_with = "limits::finite")]
    pub amplitude: f64,
    /// Phase at the start of the run, rad.
    #[serde(default = "Default::default", deserialize_with = "limits::finite")]
    pub phase: f64,
}

impl Effect for TimePeriodic {
    const KIND: &'static str = "time_periodic";
    const PLACES: Places = Places::Motor;
    const RECOGNITION: Recognition = Recognition::Family;
    const EXAMPLE: Example = (Place::Nut, &[("hz", 50.0), ("amplitude", 0.01)]);

    fn terms(&self) -> Vec<Term> {
        vec![Term::oscillation(
            Site::ShaftTorque,
            self.hz,
            self.amplitude,
            self.phase,
        )]
    }
}
