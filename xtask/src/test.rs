//! `cargo xtask test`: everything that must hold, in the order in which it fails fastest.

use crate::emulator_tools::EmulatorTools;
use anyhow::{Context, Result, ensure};
use std::path::Path;
use std::process::Command;
use std::time::Instant;

/// The target that the firmware is built for.
const TARGET: &str = "thumbv7em-none-eabihf";

/// Runs all checks; stops at the first that fails.
pub fn run() -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    // Automatic installation may be switched off, so the target is asked for by name.
    step(Command::new("rustup").args(["target", "add", TARGET]))?;
    let cargo = |line: &str| {
        let mut command = Command::new("cargo");
        command.current_dir(&root).args(line.split(' '));
        command
    };
    step(&mut cargo("fmt --all --check"))?;
    step(&mut cargo("clippy --all-targets -- -D warnings"))?;
    step(&mut cargo(&format!(
        "clippy --package firmware --profile firmware --target {TARGET} -- -D warnings"
    )))?;
    step(&mut cargo("test"))?;
    step(&mut cargo(&format!(
        "build --package firmware --profile firmware --target {TARGET}"
    )))?;
    let tools = EmulatorTools::install(&root)?;
    step(tools.give(&mut cargo(
        "clippy --release --package tests --all-targets -- -D warnings",
    )))?;
    step(tools.give(&mut cargo("test --release --package tests")))?;
    println!("All checks passed.");
    Ok(())
}

fn step(command: &mut Command) -> Result<()> {
    let arguments: Vec<_> = command
        .get_args()
        .map(|a| a.to_string_lossy().into_owned())
        .collect();
    let line = format!(
        "{} {}",
        command.get_program().to_string_lossy(),
        arguments.join(" ")
    );
    println!("> {line}");
    let start = Instant::now();
    let status = command
        .status()
        .with_context(|| format!("`{line}` could not be started: is it on the PATH?"))?;
    ensure!(status.success(), "`{line}` failed ({status})");
    println!("  {:.0} s", start.elapsed().as_secs_f64());
    Ok(())
}
