//! `cargo xtask identify` and `bench identify`: the identification, which is a program of its own, so that a simulation
//! does not wait for its libraries to be built.

use anyhow::{Context, Result, ensure};
use std::ffi::OsString;
use std::process::Command;

/// Builds the program and runs it with `arguments`, in the folder that the caller stands in.
pub fn run(arguments: &[OsString]) -> Result<()> {
    let manifest = crate::tools::root().join("Cargo.toml");
    let status = Command::new("cargo")
        .args([
            "run",
            "--quiet",
            "--release",
            "--package",
            "identify",
            "--manifest-path",
        ])
        .arg(manifest)
        .arg("--")
        .args(arguments)
        .status()
        .context("`cargo run --package identify` could not be started: is cargo on the PATH?")?;
    ensure!(
        status.success(),
        "identify ended with {status}: see its message above"
    );
    Ok(())
}
