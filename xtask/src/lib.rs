//! What `cargo xtask` knows of the workspace: where it lies, how its programs are built, and the wiring page.
#![forbid(unsafe_code)]

pub mod firmware;
pub mod program;
pub mod tools;
pub mod wiring;
