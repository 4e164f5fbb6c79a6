//! What was not tried or not taken.

use plant::effects::Place;
use serde::Serialize;
use std::cell::RefCell;
use std::collections::BTreeMap;

/// A hypothesis that was not tried or not taken, how often, and why.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Refusal {
    /// Its name.
    pub hypothesis: String,
    /// Place.
    #[serde(rename = "where")]
    pub place: String,
    /// Why.
    pub reason: &'static str,
    /// Trials that it was so in.
    pub trials: usize,
}

/// Counts refusals.
#[derive(Debug, Default)]
pub(crate) struct Refusals(RefCell<BTreeMap<(&'static str, &'static str, &'static str), usize>>);

impl Refusals {
    /// Counts one.
    pub(crate) fn count(&self, hypothesis: &'static str, place: Place, reason: &'static str) {
        let key = (hypothesis, place.name(), reason);
        *self.0.borrow_mut().entry(key).or_default() += 1;
    }

    /// All of them.
    pub(crate) fn list(&self) -> Vec<Refusal> {
        let entries = self.0.borrow();
        let of = |(key, trials): (&(&str, &str, &'static str), &usize)| Refusal {
            hypothesis: key.0.into(),
            place: key.1.into(),
            reason: key.2,
            trials: *trials,
        };
        entries.iter().map(of).collect()
    }
}
