//! What became of a file's rows.

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

/// What became of a file's rows.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Account {
    /// The file.
    pub file: String,
    /// Rows read.
    pub rows: usize,
    /// Rows used, bridged ones included.
    pub used: usize,
    /// Rows left out, by rule.
    pub skipped: Vec<Skipped>,
    /// Rows put in over short gaps.
    pub bridged: usize,
    /// Rows before or after a long gap that were not used.
    pub cut: usize,
}

impl Account {
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
