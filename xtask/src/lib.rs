//! What of the project's one door others use too: result folders, and recordings from a drive's telemetry.
#![forbid(unsafe_code)]

pub mod hold;
pub mod output;
#[cfg(feature = "record")]
pub mod record;
