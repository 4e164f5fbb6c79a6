//! Commissioning of drawn machines, and how right it is.

mod draw;
mod run;

pub use run::{Outcome, USUAL, commission};
