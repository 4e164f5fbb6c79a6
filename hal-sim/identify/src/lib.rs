//! From a recording to the missing effect.
#![forbid(unsafe_code)]

pub mod analysis;
pub mod balance;
pub mod bench;
pub mod channel;
mod conclusion;
pub mod design;
pub mod feed_axis;
pub mod fourier;
pub mod html;
pub mod hypothesis;
pub mod interval;
mod judge;
pub mod load;
pub mod motor;
pub mod noise;
pub mod paper;
pub mod record;
pub mod report;
pub mod run;
pub mod scan;
pub mod select;
pub mod signals;
