//! From a recording to the missing effect.
#![forbid(unsafe_code)]

mod along;
pub mod analysis;
pub mod balance;
pub mod bench;
mod bounded;
pub mod channel;
mod conclusion;
pub mod design;
pub mod feed_axis;
mod figures;
pub mod fourier;
pub mod gain;
pub mod html;
pub mod hypothesis;
pub mod interval;
mod judge;
mod leftover;
pub mod limits;
mod lookalike;
pub mod machines;
pub mod motor;
pub mod noise;
pub mod normal;
pub mod outcome;
pub mod paper;
mod pmsm_file;
mod progress;
mod recalibrated;
pub mod record;
pub mod records;
pub mod reference;
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
mod unnamed;
pub mod verdict;

// Until all that names it by its old name is rewritten.
pub use records as load;
