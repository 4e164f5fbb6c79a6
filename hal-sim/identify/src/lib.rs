//! From a recording to the missing effect.
#![forbid(unsafe_code)]

pub mod analysis;
pub mod balance;
pub mod conclusion;
pub(crate) mod digits;
pub mod effects;
pub mod html;
pub mod machines;
pub mod paper;
pub(crate) mod predict;
pub mod record;
pub mod records;
pub mod reference;
pub mod regression;
pub mod report;
pub mod run;
pub mod search;
pub mod signal;
