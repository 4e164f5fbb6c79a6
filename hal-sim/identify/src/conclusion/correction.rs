//! A declared plate value that is wrong: what it would be, and the verdict with it.

use crate::conclusion::recalibrated::Released;
use crate::digits::three;
use serde::Serialize;

/// A plate value in a model file, and what the fit record has in its place.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlateValue {
    /// Its name, as in `motor.flux_wb`.
    pub parameter: String,
    /// What the fit record has, over what is declared.
    pub factor: f64,
}

/// Plate values with which the check record has a better verdict.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Correction {
    /// The values, the one that brings most first.
    pub values: Vec<PlateValue>,
    /// The verdict with them: `nothing missing` or `explained`.
    pub verdict: &'static str,
}

impl Correction {
    /// Of what the fit record has; `refined` is how the plate values changed once more under these.
    pub(crate) fn new(
        released: &[Released],
        refined: &[(String, f64, f64)],
        verdict: &'static str,
    ) -> Self {
        let value = |own: &Released| {
            let change = refined.iter().find(|(name, ..)| *name == own.name);
            PlateValue {
                parameter: own.name.clone(),
                factor: own.factor * (1.0 + change.map_or(0.0, |(_, change, _)| *change)),
            }
        };
        Correction {
            values: released.iter().map(value).collect(),
            verdict,
        }
    }

    /// What a person should look at.
    pub(crate) fn sentence(&self) -> String {
        let values = self.values.iter().map(|own| {
            let percent = 100.0 * (own.factor - 1.0);
            let way = if percent < 0.0 { "less" } else { "more" };
            format!("`{}` {} % {way}", own.parameter, three(percent.abs()))
        });
        let values: Vec<String> = values.collect();
        format!(
            " With {} than declared the verdict is `{}`. Is what is declared right? If not, correct it and identify again.",
            values.join(" and "),
            self.verdict
        )
    }
}
