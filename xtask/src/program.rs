//! Programs of the workspace that `cargo xtask` builds and becomes.

use crate::tools::root;
use anyhow::{Context, Result};
use std::ffi::OsString;
use std::process::Command;

/// What a command says that waits for the compiler.
pub const COMPILES: &str = "cargo compiles first what changed: from nothing that takes minutes";

/// A program as cargo builds it.
pub struct Program<'a> {
    /// Cargo's words that select it: package, binary, profile.
    pub build: &'a [&'a str],
    /// Variables of the build and the run.
    pub environment: &'a [(&'a str, OsString)],
}

impl Program<'_> {
    /// Builds the program and becomes it, in the caller's folder. Ctrl-C then reaches the program alone.
    ///
    /// # Errors
    /// Cargo does not start. Cargo prints the errors of a build.
    pub fn run(&self, arguments: impl IntoIterator<Item = OsString>) -> Result<()> {
        eprintln!("{COMPILES}");
        let mut cargo = Command::new("cargo");
        cargo.arg("run").args(self.build).arg("--manifest-path");
        cargo.arg(root()?.join("Cargo.toml"));
        cargo.arg("--").args(arguments);
        cargo.envs(self.environment.iter().map(|(name, value)| (name, value)));
        replace(&mut cargo).context("cargo does not start: is it on the PATH?")
    }
}

/// Replaces this process. It returns only if the program does not start.
#[cfg(unix)]
fn replace(program: &mut Command) -> std::io::Result<()> {
    use std::os::unix::process::CommandExt;
    Err(program.exec())
}

/// Runs the program, and ends as it ends.
#[cfg(not(unix))]
fn replace(program: &mut Command) -> std::io::Result<()> {
    let status = program.status()?;
    std::process::exit(status.code().unwrap_or(1))
}
