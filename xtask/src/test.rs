//! `cargo xtask test`: everything that must hold, in the order in which it fails fastest.

use crate::firmware::TARGET;
use crate::steps::{Step, prepare, run_all};
use crate::tools::{cross_compiler, emulator_environment, target_folder};
use anyhow::Result;

/// All that runs on this computer, in one go with all features, so that no library is built twice.
const HOST: &str =
    "--workspace --exclude firmware --features xtask/identify,xtask/bringup,xtask/probe";

/// Runs all checks; stops at the first that fails.
pub fn run() -> Result<()> {
    prepare()?;
    run_all(&[Step::cargo("fmt --all --check")])?;
    cross_compiler();
    let emulator = emulator_environment(&target_folder())?;
    let firmware = format!("--package firmware --profile firmware --target {TARGET}");
    let mains = "--no-default-features --features board-mains";
    run_all(&[
        Step::cargo(format!("clippy {HOST} --all-targets -- -D warnings")).with(&emulator),
        // As the door is built: what hands over.
        Step::cargo("clippy --package xtask --package launch -- -D warnings"),
        Step::documentation(HOST).with(&emulator),
        // Both boards; the default one last, whose ELF is the one that is flashed.
        Step::cargo(format!("clippy {firmware} {mains} -- -D warnings")),
        Step::cargo(format!("clippy {firmware} -- -D warnings")),
        Step::documentation(&firmware),
    ])?;
    crate::firmware::build()?;
    run_all(&[Step::cargo(format!("test {HOST}")).with(&emulator)])?;
    println!("All checks passed.");
    Ok(())
}
