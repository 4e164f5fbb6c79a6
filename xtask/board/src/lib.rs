//! What a bring-up's readings mean; and, with the feature `probe`, what is done to a board at a debug probe.
#![forbid(unsafe_code)]

pub mod bringup;
#[cfg(feature = "probe")]
pub mod flash;
