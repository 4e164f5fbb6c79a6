//! How well a model's values are known, where they were measured.

use crate::Axis;
use crate::limits;
use serde::{Deserialize, Serialize};

/// Halves of 95 % intervals of what was measured, relative to the values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasuredModel {
    /// Of the screw's motor.
    pub screw: MeasuredMotor,
    /// Of the nut's motor.
    pub nut: MeasuredMotor,
    /// Of the feed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feed: Option<MeasuredFeed>,
}

/// The same of the feed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasuredFeed {
    /// Of `table_mass_kg`, of which the axial resonance was measured by itself; 0 or above.
    #[serde(deserialize_with = "limits::non_negative")]
    pub table_mass: f64,
}

/// The same of a motor; each 0 or above.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasuredMotor {
    /// Of `resistance_ohm`.
    #[serde(deserialize_with = "limits::non_negative")]
    pub resistance: f64,
    /// Of `inductance_h`.
    #[serde(deserialize_with = "limits::non_negative")]
    pub inductance: f64,
    /// Of `flux_wb`.
    #[serde(deserialize_with = "limits::non_negative")]
    pub flux: f64,
    /// Of `inertia_kg_m2`.
    #[serde(deserialize_with = "limits::non_negative")]
    pub inertia: f64,
}

impl MeasuredModel {
    /// The motor of one axis.
    pub fn motor(&self, axis: Axis) -> &MeasuredMotor {
        match axis {
            Axis::Screw => &self.screw,
            Axis::Nut => &self.nut,
        }
    }
}
