//! A mapping file: which column of a file is which of ours, in which unit.
//!
//! ```toml
//! sample_hz = 4000.0            # if the file has no time
//! [columns.screw_ia_a]
//! name = "I1"                   # its name in the file
//! scale = 1e-3                  # ours = theirs * scale + offset
//! offset = 0.0
//! ```

use super::{LoadError, Table};
use plant::recording::COLUMNS;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// See the module.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mapping {
    /// Rate of the rows where the file has no time.
    pub sample_hz: Option<f64>,
    /// By the names of [`COLUMNS`]; what is not named has our name and unit.
    #[serde(default)]
    pub columns: BTreeMap<String, Source>,
}

/// Where one of our columns comes from.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// Its name in the file.
    pub name: String,
    /// Ours = theirs * scale + offset.
    #[serde(default = "one")]
    pub scale: f64,
    /// See `scale`.
    #[serde(default)]
    pub offset: f64,
}

fn one() -> f64 {
    1.0
}

impl Mapping {
    /// Reads a mapping file.
    ///
    /// # Errors
    /// A file that cannot be read or has an unknown key or column.
    pub fn load(path: &Path) -> Result<Self, LoadError> {
        let origin = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|error| LoadError::Mapping {
            origin: origin.clone(),
            reason: error.to_string(),
        })?;
        Self::parse(&text, &origin)
    }

    /// Reads a mapping from its text.
    ///
    /// # Errors
    /// As [`Mapping::load`].
    pub fn parse(text: &str, origin: &str) -> Result<Self, LoadError> {
        let fault = |reason: String| LoadError::Mapping {
            origin: origin.to_owned(),
            reason,
        };
        let mapping: Mapping = toml::from_str(text).map_err(|error| fault(error.to_string()))?;
        match mapping
            .columns
            .keys()
            .find(|name| !COLUMNS.contains(&name.as_str()))
        {
            Some(name) => Err(fault(format!(
                "column `{name}` is unknown; expected one of {}",
                COLUMNS.join(", ")
            ))),
            None => Ok(mapping),
        }
    }

    /// Our columns, in their order.
    pub(super) fn apply(&self, table: &Table, sample_hz: f64) -> Result<Vec<Vec<f64>>, LoadError> {
        COLUMNS
            .iter()
            .map(|name| {
                let (theirs, scale, offset) = self
                    .columns
                    .get(*name)
                    .map_or((*name, 1.0, 0.0), |s| (s.name.as_str(), s.scale, s.offset));
                if *name == "t_s" && table.column(theirs).is_err() {
                    let rate = self.sample_hz.unwrap_or(sample_hz);
                    return Ok((0..table.rows()).map(|row| row as f64 / rate).collect());
                }
                Ok(table
                    .column(theirs)?
                    .iter()
                    .map(|value| value * scale + offset)
                    .collect())
            })
            .collect()
    }
}
