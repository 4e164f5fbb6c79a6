//! What of the project's one door others use too: result folders, recordings from a drive's telemetry, the wiring page, and
//! what a bring-up's readings mean.
#![forbid(unsafe_code)]

#[cfg(feature = "bringup")]
pub mod bringup;
pub mod hold;
pub mod output;
#[cfg(feature = "record")]
pub mod record;
#[cfg(feature = "record")]
pub mod trigger;
pub mod wiring;
