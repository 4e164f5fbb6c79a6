//! A mapping file: which column of a file is which channel, in which unit, and how it was sampled.
//!
//! `REFERENCE.md` has all its keys; it is made from this file.

use super::layout::{Machine, unit};
use super::table::TextLayout;
use super::units::{self, Context};
use super::{LoadError, Table};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// See the module.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Mapping {
    /// What was recorded: `double drive` (default), `feed axis`, `motor` or `pmsm`.
    pub machine: Machine,
    /// Rate of the rows, Hz. Without it the model's `sample_hz`, else the median of the file's times.
    pub sample_hz: Option<f64>,
    /// `even`: one row an interval, a time may be rounded. `jitters`: rows have the times that they say; they are brought
    /// onto an even grid. Without it the times tell.
    pub clock: Option<Clock>,
    /// Between the cells of a text: `,`, `;`, `|`, `\t` or a space (any number of them). Without it guessed, and said.
    pub separator: Option<char>,
    /// Between whole and fraction in a text: `.` or `,`. Without it guessed, and said.
    pub decimal: Option<char>,
    /// Lines of a text that are left out before its header is looked for.
    pub skip_lines: Option<usize>,
    /// A motor: file of its current over position in a slow turn, beside the record.
    pub map: Option<String>,
    /// Encoder counts per mechanical turn; the unit `count` needs it.
    pub counts_per_turn: Option<f64>,
    /// Pole pairs; the units `erpm` and `electrical rad/s` and an electrical angle need it.
    pub pole_pairs: Option<f64>,
    /// Whether currents and voltages are scaled so that a d-q vector has the amplitude of a phase, as most drives have
    /// it; without it, power-invariant. Times `sqrt(3/2)` makes one the other.
    pub amplitude_invariant: bool,
    /// By our names; a channel that is not named has our name and unit.
    pub columns: BTreeMap<String, Source>,
    /// Numbers of the machine that are no columns.
    pub constants: BTreeMap<String, Constant>,
    /// Which rows count; all.
    pub rows: Option<Rows>,
    /// Of files of a name (`*` stands for any text): what differs in them.
    pub files: BTreeMap<String, Differs>,
}

/// What differs in some of the files.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Differs {
    /// As above.
    pub sample_hz: Option<f64>,
    /// Which rows count in them.
    pub rows: Option<Rows>,
    /// Channels that come from elsewhere in them.
    pub columns: BTreeMap<String, Source>,
    /// Numbers that differ in them.
    pub constants: BTreeMap<String, Constant>,
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

/// Where a channel comes from.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Source {
    /// Its name or path in the file: `Iq`, `data.0.iq` (a field of an array of structs), `data.2` (the third channel of
    /// a matrix, whose channels lie along its shorter side).
    pub name: Option<String>,
    /// Its number in the file, counted from 0, in place of a name.
    pub number: Option<usize>,
    /// `true`: it is no column, but the number of the row, counted from 0.
    pub row_number: bool,
    /// Its unit: `deg`, `turn`, `count`, `rpm`, `erpm`, `mA`, `mm`, `us` and others. Without it the one that the file
    /// says, else ours.
    pub unit: Option<String>,
    /// Ours = (theirs, unwrapped) * unit * scale + offset.
    pub scale: Option<f64>,
    /// See `scale`; in our unit.
    pub offset: f64,
    /// Where a value starts again from, in the file's unit: 360 for degrees of one turn. It is unwrapped.
    pub period: Option<f64>,
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

/// Which rows count: those that meet all of these.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Rows {
    /// A column of the file.
    pub column: Option<String>,
    /// Its value in the rows that count.
    pub equals: Option<f64>,
    /// A value that it has not in them.
    pub not: Option<f64>,
    /// Its smallest value in them.
    pub at_least: Option<f64>,
    /// Its greatest value in them.
    pub at_most: Option<f64>,
    /// Time of the first, s after the file's first row.
    pub from_s: Option<f64>,
    /// Time of the last, s after the file's first row.
    pub to_s: Option<f64>,
}

/// A column that was found: values of a channel are `(column, unwrapped by period) * scale + offset`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Found {
    /// Its number; of a row's number `None`.
    pub(super) column: Option<usize>,
    pub(super) scale: f64,
    pub(super) offset: f64,
    pub(super) period: Option<f64>,
    /// Whether the unit is the file's own word.
    pub(super) unit_of_file: bool,
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
        mapping.check().map_err(fault)?;
        Ok(mapping)
    }

    /// What of it cannot be meant.
    fn check(&self) -> Result<(), String> {
        let channels = self.machine.channels();
        let known = || std::iter::once("t_s").chain(channels.iter().map(|c| c.name));
        let constants = self.machine.constants();
        let all_columns =
            std::iter::once(&self.columns).chain(self.files.values().map(|f| &f.columns));
        for columns in all_columns {
            for (name, source) in columns {
                if !known().any(|k| k == name) {
                    return Err(format!(
                        "column `{name}` is unknown; expected one of {}",
                        known().collect::<Vec<_>>().join(", ")
                    ));
                }
                source.check(name, self.context())?;
            }
            one_column_twice(columns)?;
        }
        let all_constants =
            std::iter::once(&self.constants).chain(self.files.values().map(|f| &f.constants));
        for name in all_constants.flat_map(|constants| constants.keys()) {
            if !constants.iter().any(|(known, _)| known == name) {
                let names: Vec<_> = constants.iter().map(|(name, _)| *name).collect();
                return Err(format!(
                    "constant `{name}` is unknown; expected one of {}",
                    names.join(", ")
                ));
            }
        }
        let rates = std::iter::once(self.sample_hz).chain(self.files.values().map(|f| f.sample_hz));
        let numbers = rates.map(|hz| ("sample_hz", hz)).chain([
            ("counts_per_turn", self.counts_per_turn),
            ("pole_pairs", self.pole_pairs),
        ]);
        for (name, value) in numbers {
            if value.is_some_and(|value| !(value.is_finite() && value > 0.0)) {
                return Err(format!(
                    "{name} is {}, expected a number above 0",
                    value.unwrap_or(0.0)
                ));
            }
        }
        for (name, sign, allowed) in [
            ("separator", self.separator, ",;|\t "),
            ("decimal", self.decimal, ".,"),
        ] {
            if sign.is_some_and(|sign| !allowed.contains(sign)) {
                return Err(format!(
                    "{name} is {:?}, expected one of {allowed:?}",
                    sign.unwrap_or(' ')
                ));
            }
        }
        if self.separator == Some(',') && self.decimal == Some(',') {
            return Err("separator and decimal are both `,`; expected two signs".into());
        }
        Ok(())
    }

    /// What units may need.
    pub(super) fn context(&self) -> Context {
        Context {
            counts_per_turn: self.counts_per_turn,
            pole_pairs: self.pole_pairs,
        }
    }

    /// What is known of a text's layout.
    pub(super) fn text_layout(&self) -> TextLayout {
        let byte = |sign: Option<char>| sign.and_then(|c| u8::try_from(c).ok());
        TextLayout {
            separator: byte(self.separator),
            decimal: byte(self.decimal),
            skip: self.skip_lines,
        }
    }

    /// As it is for one file: with what differs in files of its name.
    pub(super) fn of_file(&self, path: &Path) -> Mapping {
        let mut own = self.clone();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        for (pattern, differs) in &self.files {
            if !matches(pattern, &name) {
                continue;
            }
            own.sample_hz = differs.sample_hz.or(own.sample_hz);
            own.rows = differs.rows.clone().or(own.rows);
            own.columns.extend(differs.columns.clone());
            own.constants.extend(differs.constants.clone());
        }
        own
    }

    /// Where the channel `name` stands in a file.
    pub(super) fn find(&self, table: &Table, name: &str) -> Result<Found, LoadError> {
        let plain = Source::default();
        let source = self.columns.get(name).unwrap_or(&plain);
        let column = match (&source.name, source.number) {
            _ if source.row_number => None,
            (Some(path), _) => Some(table.find(path)?),
            (None, Some(number)) => Some(table.find(&number.to_string())?),
            (None, None) => Some(table.find(name)?),
        };
        let fault = |reason: String| LoadError::Mapping {
            origin: table.origin.clone(),
            reason: format!("column `{name}`: {reason}"),
        };
        let own = column.and_then(|column| table.columns[column].unit.as_deref());
        let unit_of_file = source.unit.is_none() && source.scale.is_none() && own.is_some();
        let named = match unit_of_file {
            true => own,
            false => source.unit.as_deref(),
        };
        let scale = match named {
            Some(named) => units::factor(named, unit(name), self.context()).map_err(fault)?,
            None => 1.0,
        };
        Ok(Found {
            column,
            scale: scale * source.scale.unwrap_or(1.0),
            offset: source.offset,
            period: source.period,
            unit_of_file: unit_of_file && scale != 1.0,
        })
    }

    /// A constant's value, if the file or the mapping has it.
    pub(super) fn constant(&self, table: &Table, name: &str) -> Result<Option<f64>, LoadError> {
        let theirs = match self.constants.get(name) {
            Some(Constant::Given { value }) => return Ok(Some(*value)),
            Some(Constant::Named { name }) => name.as_str(),
            None => match table.find(name) {
                Ok(_) => name,
                Err(_) => return Ok(None),
            },
        };
        let column = table.find(theirs)?;
        let first = table.columns[column].values.first().copied();
        match first.filter(|value| value.is_finite()) {
            Some(value) => Ok(Some(value)),
            None => Err(LoadError::Length {
                origin: table.origin.clone(),
                column: theirs.to_owned(),
                rows: 0,
                expected: 1,
            }),
        }
    }
}

impl Source {
    fn check(&self, name: &str, context: Context) -> Result<(), String> {
        let ways = [self.name.is_some(), self.number.is_some(), self.row_number];
        if ways.into_iter().filter(|given| *given).count() > 1 {
            return Err(format!(
                "column `{name}` has more than one of name, number and row_number; expected one of them"
            ));
        }
        if let Some(scale) = self
            .scale
            .filter(|scale| !scale.is_finite() || *scale == 0.0)
        {
            return Err(format!(
                "column `{name}` has the scale {scale}; expected a finite number other than 0"
            ));
        }
        if !self.offset.is_finite() {
            return Err(format!(
                "column `{name}` has the offset {}; expected a finite number",
                self.offset
            ));
        }
        if let Some(period) = self.period.filter(|p| !(p.is_finite() && *p > 0.0)) {
            return Err(format!(
                "column `{name}` has the period {period}; expected a number above 0"
            ));
        }
        match &self.unit {
            Some(named) => units::factor(named, unit(name), context)
                .map(|_| ())
                .map_err(|reason| format!("column `{name}`: {reason}")),
            None => Ok(()),
        }
    }
}

/// Refuses two channels of one column.
fn one_column_twice(columns: &BTreeMap<String, Source>) -> Result<(), String> {
    let mut seen: BTreeMap<String, &str> = BTreeMap::new();
    for (ours, source) in columns.iter().filter(|(_, source)| !source.row_number) {
        let theirs = match (&source.name, source.number) {
            (Some(name), _) => name.clone(),
            (None, Some(number)) => number.to_string(),
            (None, None) => ours.clone(),
        };
        if let Some(other) = seen.insert(theirs.clone(), ours) {
            return Err(format!(
                "`{other}` and `{ours}` are both taken from the column `{theirs}`; expected a column for each"
            ));
        }
    }
    Ok(())
}

/// Whether a name is one of a pattern's, in which `*` stands for any text.
fn matches(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let first = parts.next().unwrap_or_default();
    let Some(mut rest) = name.strip_prefix(first) else {
        return false;
    };
    let mut parts: Vec<&str> = parts.collect();
    let Some(last) = parts.pop() else {
        return rest.is_empty();
    };
    for part in parts {
        match rest.find(part) {
            Some(at) => rest = &rest[at + part.len()..],
            None => return false,
        }
    }
    rest.ends_with(last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_matches_whole_names() {
        assert!(matches("check.csv", "check.csv"));
        assert!(matches("check*", "check_2.csv"));
        assert!(matches("*.npy", "slow.npy"));
        assert!(matches("a*b*c", "axxbyyc"));
        assert!(!matches("check.csv", "check.csv.gz"));
        assert!(!matches("a*a", "a"));
    }

    #[test]
    fn what_cannot_be_meant_is_refused() {
        let refused = |text: &str, words: &[&str]| {
            let error = Mapping::parse(text, "mapping.toml")
                .unwrap_err()
                .to_string();
            for word in words {
                assert!(error.contains(word), "`{word}` is not in: {error}");
            }
        };
        refused(
            "[columns.screw_ia_a]\nname = \"I\"\nscale = 0.0\n",
            &["scale 0"],
        );
        refused(
            "[columns.screw_ia_a]\nname = \"I\"\n[columns.screw_ib_a]\nname = \"I\"\n",
            &["screw_ia_a", "screw_ib_a", "both"],
        );
        refused(
            "[columns.screw_ia_a]\nname = \"I\"\nunit = \"mm\"\n",
            &["mm", "one of A"],
        );
        refused(
            "[columns.screw_angle_rad]\nunit = \"count\"\n",
            &["counts_per_turn"],
        );
        refused("sample_hz = -4.0\n", &["sample_hz"]);
        refused("separator = \"x\"\n", &["separator"]);
        refused("machine = \"lathe\"\n", &["lathe"]);
    }
}
