//! Commands that need more libraries than the door itself. Each stands behind a feature; without it xtask is built once
//! more, with it, and takes the command over. So `check` and `test` do not wait for a simulator, nor a simulation for
//! probe-rs.

use anyhow::{Context, Result};
use launch::Program;

/// What a command needs.
#[allow(dead_code, reason = "with all features on nothing is handed over")]
#[derive(Clone, Copy)]
pub enum With {
    /// The link.
    Drive,
    /// The link through the debug probe.
    DriveByProbe,
    /// A simulated drive.
    Serve,
    /// The simulator.
    Simulate,
    /// The identification, and the simulator.
    Identify,
    /// The debug probe.
    Probe,
}

impl With {
    fn build(self) -> &'static [&'static str] {
        match self {
            With::Drive => &["--features", "drive"],
            With::DriveByProbe => &["--features", "drive,probe"],
            With::Serve => &["--features", "serve"],
            With::Simulate => &["--release", "--features", "simulate"],
            With::Identify => &["--release", "--features", "identify"],
            // Not for release: probe-rs takes minutes to optimise as a whole, and waits for USB anyway.
            With::Probe => &["--features", "probe"],
        }
    }

    /// Builds xtask with it, hands the same arguments over, and ends as that one ends.
    ///
    /// # Errors
    /// Cargo could not be started.
    #[allow(dead_code, reason = "with all features on nothing is handed over")]
    pub fn take_over(self) -> Result<()> {
        let xtask = Program {
            package: "xtask",
            build: self.build(),
            environment: &[],
        };
        let status = xtask
            .run(std::env::args_os().skip(1))
            .context("cargo could not be started: is it on the PATH?")?;
        // It has said why.
        std::process::exit(status.code().unwrap_or(1));
    }
}
