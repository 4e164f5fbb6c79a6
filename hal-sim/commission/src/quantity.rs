//! A measured quantity beside what the settings said.

use crate::Estimate;
use serde::{Deserialize, Serialize};
use std::fmt;

/// One result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quantity {
    /// What of what.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// The value, with half of its 95 % interval; 0: it has none.
    pub estimate: Estimate,
    /// What the settings said before.
    pub before: Option<f64>,
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Estimate { value, plus_minus } = self.estimate;
        write!(f, "{:<39} {:>12}", self.name, digits(value))?;
        if plus_minus > 0.0 {
            write!(f, " +- {:<9}", digits(plus_minus))?;
        } else {
            write!(f, "{:13}", "")?;
        }
        write!(f, " {}", self.unit)?;
        if let Some(before) = self.before {
            write!(f, "  (was {})", digits(before))?;
        }
        Ok(())
    }
}

/// Four digits.
pub(crate) fn digits(value: f64) -> String {
    if value == 0.0 || (1e-3..1e5).contains(&value.abs()) {
        let places = 3 - value.abs().max(1e-3).log10().floor() as i32;
        format!("{value:.*}", places.max(0) as usize)
    } else {
        format!("{value:.3e}")
    }
}

/// Of both motors.
pub(crate) fn both(
    quantities: &mut Vec<Quantity>,
    what: &str,
    unit: &str,
    estimates: [Estimate; 2],
    before: Option<[f64; 2]>,
) {
    for (k, name) in ["screw", "nut"].into_iter().enumerate() {
        quantities.push(Quantity {
            name: format!("{name}: {what}"),
            unit: unit.to_owned(),
            estimate: estimates[k],
            before: before.map(|before| before[k]),
        });
    }
}
