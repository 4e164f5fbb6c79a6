//! What a bring-up's readings mean.
#![forbid(unsafe_code)]

pub mod bringup;
