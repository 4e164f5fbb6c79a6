//! Commissioning of drawn machines, and how right it is.

pub(crate) mod draw;
pub mod report;
mod rivals;
mod run;

pub use draw::any_size;
pub use rivals::{Rivals, rivals};
pub use run::{Outcome, USUAL, commission};
