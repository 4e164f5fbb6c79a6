//! From a recording to the missing effect.
#![forbid(unsafe_code)]

pub mod balance;
pub mod channel;
pub mod design;
pub mod fourier;
pub mod hypothesis;
pub mod noise;
pub mod record;
pub mod scan;
pub mod select;
pub mod signals;
