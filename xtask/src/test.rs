//! `cargo xtask test`: everything that must hold, in the order in which it fails fastest.

use crate::firmware::TARGET;
use anyhow::{Context, Result, ensure};
use std::process::Command;

/// Most of it is checked with the identification in.
const WITH_IDENTIFY: [&str; 2] = ["--features", "xtask/identify"];

/// Runs all checks; stops at the first that fails.
pub fn run() -> Result<()> {
    // Automatic installation may be switched off, so the target is asked for by name.
    step("rustup", &["target", "add", TARGET])?;
    step("cargo", &["fmt", "--all", "--check"])?;
    step(
        "cargo",
        &[
            &["clippy", "--all-targets"],
            &WITH_IDENTIFY[..],
            &["--", "-D", "warnings"],
        ]
        .concat(),
    )?;
    step("cargo", &[&["test"], &WITH_IDENTIFY[..]].concat())?;
    crate::firmware::test()?;
    // Last, since probe-rs is the longest to build.
    let probe = ["--package", "xtask", "--features", "probe"];
    step(
        "cargo",
        &[
            &["clippy"],
            &probe[..],
            &["--all-targets", "--", "-D", "warnings"],
        ]
        .concat(),
    )?;
    step(
        "cargo",
        &[
            &["test"],
            &probe[..],
            &["--bin", "xtask", "--test", "probe"],
        ]
        .concat(),
    )?;
    println!("All checks passed.");
    Ok(())
}

fn step(program: &str, arguments: &[&str]) -> Result<()> {
    let line = format!("{program} {}", arguments.join(" "));
    println!("> {line}");
    let status = Command::new(program)
        .args(arguments)
        .status()
        .with_context(|| {
            format!("`{line}` could not be started: is {program} installed and on the PATH?")
        })?;
    ensure!(status.success(), "`{line}` failed ({status})");
    Ok(())
}
