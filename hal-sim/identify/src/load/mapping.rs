//! A mapping file: which column of a file is which of ours, in which unit, and how it was sampled.
//!
//! ```toml
//! machine = "double drive"      # or "feed axis" or "motor"
//! sample_hz = 4000.0            # if the file has no time, or another rate than the model declares
//! clock = "jitters"             # rows are brought onto an even grid of sample_hz
//! separator = ";"               # of a text's cells
//! map = "slow.txt"              # a motor: its current over position in a slow turn, beside the record
//!
//! [columns.screw_ia_a]
//! name = "I1"                   # its name in the file
//! scale = 1e-3                  # ours = theirs * scale + offset
//! offset = 0.0
//!
//! [constants.kp_per_s]          # a feed axis: numbers beside the columns
//! name = "kp"                   # a variable of the file, or
//! value = 160.0
//!
//! [rows]                        # only the rows in which
//! column = "Active"
//! equals = 1.0
//! ```

use super::layout::Machine;
use super::{LoadError, Table};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// See the module.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Mapping {
    /// What was recorded.
    pub machine: Machine,
    /// Rate of the rows, Hz.
    pub sample_hz: Option<f64>,
    /// How even the rows are.
    pub clock: Clock,
    /// Between the cells of a text; a comma.
    pub separator: Option<char>,
    /// File of a motor's slow turn, beside the record.
    pub map: Option<String>,
    /// By our names; what is not named has our name and unit.
    pub columns: BTreeMap<String, Source>,
    /// Numbers of the machine that are no columns.
    pub constants: BTreeMap<String, Constant>,
    /// Which rows count; all.
    pub rows: Option<Rows>,
}

/// How even the rows are.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Clock {
    /// One row an interval.
    #[default]
    Even,
    /// Rows have the times that they say, which differ from an even grid.
    Jitters,
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

/// A number: of the file, or given.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged, deny_unknown_fields)]
pub enum Constant {
    /// The first value of a variable of the file.
    Named {
        /// Its name.
        name: String,
    },
    /// The number.
    Given {
        /// It.
        value: f64,
    },
}

/// Which rows count.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rows {
    /// A column of the file.
    pub column: String,
    /// Its value in the rows that count.
    pub equals: f64,
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
        let columns = mapping.machine.columns();
        let known = || std::iter::once("t_s").chain(columns.iter().map(|column| column.name));
        if let Some(name) = mapping
            .columns
            .keys()
            .find(|name| !known().any(|k| k == *name))
        {
            return Err(fault(format!(
                "column `{name}` is unknown; expected one of {}",
                known().collect::<Vec<_>>().join(", ")
            )));
        }
        let constants = mapping.machine.constants();
        match mapping
            .constants
            .keys()
            .find(|name| !constants.contains(&name.as_str()))
        {
            Some(name) => Err(fault(format!(
                "constant `{name}` is unknown; expected one of {}",
                constants.join(", ")
            ))),
            None => Ok(mapping),
        }
    }

    /// Between the cells of a text.
    pub(super) fn separator(&self) -> u8 {
        self.separator
            .and_then(|c| u8::try_from(c).ok())
            .unwrap_or(b',')
    }

    /// Index in the file, scale and offset of our column `name`.
    pub(super) fn find(&self, table: &Table, name: &str) -> Result<(usize, f64, f64), LoadError> {
        match self.columns.get(name) {
            Some(source) => Ok((table.find(&source.name)?, source.scale, source.offset)),
            None => Ok((table.find(name)?, 1.0, 0.0)),
        }
    }

    /// A constant's value.
    pub(super) fn constant(&self, table: &Table, name: &str) -> Result<f64, LoadError> {
        let theirs = match self.constants.get(name) {
            Some(Constant::Given { value }) => return Ok(*value),
            Some(Constant::Named { name }) => name.as_str(),
            None => name,
        };
        let column = table.find(theirs)?;
        table.columns[column]
            .first()
            .copied()
            .filter(|value| value.is_finite())
            .ok_or_else(|| LoadError::Length {
                origin: table.origin.clone(),
                column: theirs.to_owned(),
                rows: 0,
                expected: 1,
            })
    }
}
