//! `cargo xtask check`: what can be told within a minute of a change: format, lints, documentation, and the tests of
//! control, plant and drive.

use crate::steps::{Step, prepare, run_all};
use anyhow::Result;

/// Runs the quick checks; stops at the first that fails.
pub fn run() -> Result<()> {
    prepare()?;
    run_all(&[
        Step::cargo("fmt --all --check"),
        Step::cargo("clippy --all-targets -- -D warnings"),
        Step::documentation(""),
        Step::cargo("test --package control --package link --package plant --package hal-sim"),
    ])?;
    println!("The quick checks passed.");
    Ok(())
}
