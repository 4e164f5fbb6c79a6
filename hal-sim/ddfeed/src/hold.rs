//! What a drive is asked to hold while it is recorded.

use std::f64::consts::TAU;

/// A table velocity and a base speed, held for a time while recording: `MM_S,RPM,SECONDS`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hold {
    /// Table velocity, m/s.
    pub velocity: f64,
    /// Base speed, mechanical rad/s.
    pub base: f64,
    /// For how long, s.
    pub seconds: f64,
}

impl std::str::FromStr for Hold {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Vec<f64> = text
            .split(',')
            .map(|part| part.trim().parse())
            .collect::<Result<_, _>>()
            .map_err(|error| format!("`{text}`: {error}"))?;
        let [mm_s, rpm, seconds] = numbers[..] else {
            return Err(format!(
                "`{text}` has {} numbers; give three, as in 2.5,300,3: table mm/s, nut rpm, seconds",
                numbers.len()
            ));
        };
        if !(mm_s.is_finite() && rpm.is_finite() && seconds > 0.0 && seconds.is_finite()) {
            return Err(format!("`{text}`: give finite numbers, and a time above 0"));
        }
        Ok(Self {
            velocity: mm_s * 1e-3,
            base: rpm * TAU / 60.0,
            seconds,
        })
    }
}
