//! What became of a file's rows, and what was guessed about it.

use serde::Serialize;

/// A rule that left rows out, with how many and where first.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Skipped {
    /// `no number`, `too large`, `time twice or back`.
    pub rule: &'static str,
    /// Rows.
    pub rows: usize,
    /// The first of them, counted from 1.
    pub first_row: usize,
    /// Its column.
    pub column: String,
}

/// What became of a file's rows, and what was guessed about it.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct DataQuality {
    /// The file.
    pub file: String,
    /// Rows read.
    pub rows: usize,
    /// Rows used, bridged ones included.
    pub used: usize,
    /// Rows left out, by rule.
    pub skipped: Vec<Skipped>,
    /// Rows injected over short gaps.
    pub bridged: usize,
    /// Rows in stretches too short to be used.
    pub cut: usize,
    /// Stretches without a gap.
    pub segments: usize,
    /// What was guessed or derived, in sentences.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

impl DataQuality {
    /// Counts a row that a rule left out.
    pub(super) fn skip(&mut self, rule: &'static str, row: usize, column: &str) {
        match self
            .skipped
            .iter_mut()
            .find(|s| s.rule == rule && s.column == column)
        {
            Some(skipped) => skipped.rows += 1,
            None => self.skipped.push(Skipped {
                rule,
                rows: 1,
                first_row: row,
                column: column.to_owned(),
            }),
        }
    }
}
