//! Formats, codes and rates that all others use.

pub mod codes;
pub mod fault;
pub mod format;
pub mod rates;
pub(crate) mod sine;
pub mod tolerance;
