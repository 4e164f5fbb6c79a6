//! `cargo xtask test`: everything that must hold, in the order in which it fails fastest.

use crate::steps::{Step, prepare, run_all};
use anyhow::Result;

/// Runs all checks; stops at the first that fails.
pub fn run() -> Result<()> {
    prepare()?;
    run_all(&[
        Step::cargo("fmt --all --check"),
        // Most of it is checked with the identification in.
        Step::cargo("clippy --all-targets --features xtask/identify,xtask/bringup -- -D warnings"),
        Step::documentation("--features xtask/identify,xtask/bringup"),
        Step::cargo("test --features xtask/identify,xtask/bringup"),
    ])?;
    crate::firmware::test()?;
    // Last, since probe-rs is the longest to build.
    let probe = "--package xtask --features probe";
    run_all(&[
        Step::cargo(format!("clippy {probe} --all-targets -- -D warnings")),
        Step::cargo(format!("test {probe} --bin xtask --test probe")),
    ])?;
    println!("All checks passed.");
    Ok(())
}
