//! The project measured against its goals: random machines, faults, other controllers, and what comes of them. No product
//! depends on this crate.
#![forbid(unsafe_code)]

pub mod alignment;
pub mod commissioning;
pub mod draw;
pub mod drive;
pub mod faults;
pub mod identify;
pub mod journey;
pub mod link;
pub mod probe;
pub mod runaway;
pub mod smooth;
