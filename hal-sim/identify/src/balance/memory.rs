//! What hypotheses add to one record, kept.

use super::Contribution;
use crate::effects::family::Family;
use plant::effects::Place;
use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

/// A family, a place and the bits of a shape.
pub(crate) type Key = (Family, Place, u64);

/// What hypotheses that are asked for again and again add to one record's residuals.
#[derive(Default)]
pub(crate) struct Memory(RefCell<HashMap<Key, Rc<Vec<Contribution>>>>);

impl Memory {
    pub(crate) fn recall(
        &self,
        key: Key,
        compute: impl FnOnce() -> Vec<Contribution>,
    ) -> Rc<Vec<Contribution>> {
        if let Some(known) = self.0.borrow().get(&key) {
            return known.clone();
        }
        let new = Rc::new(compute());
        self.0.borrow_mut().insert(key, new.clone());
        new
    }
}
