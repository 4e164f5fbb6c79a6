//! Commissioning of drawn machines, and how right it is.

mod draw;
mod rivals;
mod run;

pub use rivals::{Rivals, rivals};
pub use run::{Outcome, USUAL, commission};
