//! `cargo xtask flash | run | attach`: what needs a debug probe.
//!
//! probe-rs is large, and nothing else needs it, so it is behind the feature `probe`: without it these commands build
//! xtask once more, with it, and hand over.

use anyhow::Result;
use clap::Subcommand;

/// A command that needs a probe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Subcommand)]
pub enum Session {
    /// Build the firmware and write it to the chip's flash.
    Flash,
    /// Flash, start, and print the firmware's log.
    Run,
    /// Show the debug structure of a running drive, without halting it.
    Attach,
}

/// Does `session` with the only probe that is there.
#[cfg(feature = "probe")]
pub fn run(session: Session) -> Result<()> {
    crate::probe::run(session)
}

/// Builds xtask with probe-rs and hands over.
#[cfg(not(feature = "probe"))]
pub fn run(session: Session) -> Result<()> {
    use anyhow::Context;
    let name = match session {
        Session::Flash => "flash",
        Session::Run => "run",
        Session::Attach => "attach",
    };
    let mut arguments = vec!["run", "--quiet", "--release", "--package", "xtask"];
    arguments.extend(["--features", "probe", "--", name]);
    let status = std::process::Command::new("cargo")
        .args(arguments)
        .current_dir(crate::tools::root())
        .status()
        .context("cargo could not be started")?;
    // It has said why.
    std::process::exit(status.code().unwrap_or(1));
}
