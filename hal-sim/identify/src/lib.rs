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
pub mod gain;
pub mod html;
pub mod hypothesis;
pub mod interval;
mod judge;
mod leftover;
pub mod load;
mod lookalike;
pub mod motor;
pub mod noise;
pub mod normal;
pub mod outcome;
pub mod paper;
mod progress;
mod recalibrated;
pub mod record;
mod refine;
mod remains;
pub mod report;
pub mod rest;
mod roundings;
pub mod run;
mod sandwich;
pub mod scan;
pub mod select;
pub mod signals;
mod suggest;
mod unexplained;
