//! What of the project's one door others use too: result folders, recordings from a drive's telemetry, the wiring page.
#![forbid(unsafe_code)]

pub mod hold;
pub mod output;
#[cfg(feature = "record")]
pub mod record;
pub mod wiring;
