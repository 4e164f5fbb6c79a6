//! Checks that are other programs' runs, one after the other.

use anyhow::{Context, Result, ensure};
use std::ffi::OsString;
use std::process::Command;
use std::time::Instant;
use xtask::firmware::{BROWSER, TARGET};
use xtask::tools::root;

/// The effects of the plant, one file each.
const EFFECTS: &str = "hal-sim/plant/src/effects/kinds";

/// One program's run.
pub struct Step {
    program: OsString,
    arguments: String,
    environment: Vec<(&'static str, OsString)>,
    remedy: Option<&'static str>,
}

impl Step {
    /// A run of cargo; the arguments are words between blanks.
    pub fn cargo(arguments: impl Into<String>) -> Self {
        Self::program("cargo", arguments)
    }

    /// A run of a program; the arguments are words between blanks.
    pub fn program(program: impl Into<OsString>, arguments: impl Into<String>) -> Self {
        Self {
            program: program.into(),
            arguments: arguments.into(),
            environment: Vec::new(),
            remedy: None,
        }
    }

    /// The documentation, private items and their links too, without warnings.
    pub fn documentation(arguments: &str) -> Self {
        let flags = [("RUSTDOCFLAGS", OsString::from("-D warnings"))];
        Self::cargo(format!(
            "doc --no-deps --document-private-items {arguments}"
        ))
        .with(&flags)
    }

    /// The same, with more variables.
    pub fn with(mut self, variables: &[(&'static str, OsString)]) -> Self {
        self.environment.extend_from_slice(variables);
        self
    }

    /// The same, with the command that puts right what fails.
    fn put_right_by(mut self, command: &'static str) -> Self {
        self.remedy = Some(command);
        self
    }

    /// The format of all files. `cargo fmt` follows `mod`, and does not see the effects that a build script lists.
    ///
    /// # Errors
    /// The folder of the effects cannot be read.
    pub fn formatting() -> Result<[Self; 2]> {
        let root = root()?;
        let entries = std::fs::read_dir(root.join(EFFECTS))
            .with_context(|| format!("cannot read {EFFECTS}"))?;
        let mut files = Vec::new();
        for entry in entries {
            files.push(format!(
                "{EFFECTS}/{}",
                entry?.file_name().to_string_lossy()
            ));
        }
        let effects = Self::program(
            "rustfmt",
            format!("--edition 2024 --check {}", files.join(" ")),
        );
        Ok([
            Self::cargo("fmt --all --check").put_right_by("cargo fmt --all"),
            effects.put_right_by("rustfmt --edition 2024 hal-sim/plant/src/effects/kinds/*.rs"),
        ])
    }

    fn run(&self) -> Result<()> {
        let line = format!("{} {}", self.program.display(), self.arguments);
        println!("> {line}");
        let start = Instant::now();
        let status = Command::new(&self.program)
            .args(self.arguments.split_whitespace())
            .envs(self.environment.iter().map(|(name, value)| (name, value)))
            .current_dir(root()?)
            .status()
            .with_context(|| {
                format!(
                    "`{line}` could not be started: is {} installed and on the PATH?",
                    self.program.display()
                )
            })?;
        let remedy = self
            .remedy
            .map_or_else(String::new, |command| format!(": run `{command}`"));
        ensure!(status.success(), "`{line}` failed ({status}){remedy}");
        println!("> {:.1} s", start.elapsed().as_secs_f64());
        Ok(())
    }
}

/// What all checks need of the toolchain: `rust-toolchain.toml` names it, but automatic installation may be switched off.
///
/// # Errors
/// It is not there and cannot be fetched.
pub fn prepare() -> Result<()> {
    let rustup = |arguments: &str| Step::program("rustup", arguments);
    run_all(&[
        rustup("component add clippy rustfmt"),
        rustup(&format!("target add {TARGET} {BROWSER}")),
    ])
}

/// Runs them in order.
///
/// # Errors
/// The first that fails.
pub fn run_all(steps: &[Step]) -> Result<()> {
    steps.iter().try_for_each(Step::run)
}
