//! `report.html` for a person.

use crate::analysis::Outcome;

/// The page.
pub fn page(outcome: &Outcome) -> String {
    format!("<!doctype html><title>Identify</title><p>{}</p>", outcome.verdict())
}
