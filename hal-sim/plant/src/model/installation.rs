//! Where a machine stands: supply, travel, brake and scale.

use crate::limits;
use serde::{Deserialize, Serialize};

/// Supply, travel, brake and scale. A file without this section has the default values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct InstallationModel {
    /// Supply of both bridges; above 0. 310 if left out.
    #[serde(deserialize_with = "limits::positive")]
    pub bus_v: f64,
    /// Distance between both end switches; above 0. The table begins in the middle. 0.2 if left out.
    #[serde(deserialize_with = "limits::positive")]
    pub travel_m: f64,
    /// One count of the table's scale; above 0. 1e-9 if left out.
    #[serde(deserialize_with = "limits::positive")]
    pub scale_count_m: f64,
    /// What holds the table while the motors do not: `ideal`, `fitted` or `none`. `ideal` if left out.
    pub brake: Brake,
}

impl Default for InstallationModel {
    fn default() -> Self {
        Self {
            bus_v: 310.0,
            travel_m: 0.2,
            scale_count_m: 1e-9,
            brake: Brake::Ideal,
        }
    }
}

/// What holds the table while the motors do not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Brake {
    /// Something that carries the load at once, whenever the motors do not.
    #[default]
    Ideal,
    /// A brake that the drive releases and closes, with delays.
    Fitted,
    /// Nothing: a load that overcomes friction moves the table.
    None,
}
