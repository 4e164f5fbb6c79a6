//! Builds a program of the workspace and runs it. Cargo tells what it compiles; where nothing is compiled, nothing is told.
//!
//! Without dependencies, so that it is there in a second: what takes longer is built by it, visibly.
#![forbid(unsafe_code)]

use std::ffi::OsString;
use std::io::{self, BufRead, BufReader, IsTerminal};
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};

/// A program as cargo builds it.
pub struct Program<'a> {
    /// Its package.
    pub package: &'a str,
    /// Cargo's further words: profile, features, binary.
    pub build: &'a [&'a str],
    /// Variables of the build and the run.
    pub environment: &'a [(&'a str, OsString)],
}

impl Program<'_> {
    /// Builds it and runs it in the caller's folder: paths that a person gave are from there.
    ///
    /// # Errors
    /// Cargo could not be started. A build that fails has told why, and its status is what comes back.
    pub fn run(&self, arguments: impl IntoIterator<Item = OsString>) -> io::Result<ExitStatus> {
        let built = self.build()?;
        if !built.success() {
            return Ok(built);
        }
        let mut run = self.cargo("run");
        hand_over(run.arg("--quiet").arg("--").args(arguments))
    }

    /// Builds it.
    fn build(&self) -> io::Result<ExitStatus> {
        let mut build = self.cargo("build");
        if io::stderr().is_terminal() && std::env::var_os("CARGO_TERM_COLOR").is_none() {
            build.env("CARGO_TERM_COLOR", "always");
        }
        let mut child = build.stderr(Stdio::piped()).spawn()?;
        if let Some(told) = child.stderr.take() {
            for line in BufReader::new(told).split(b'\n') {
                let line = line?;
                let line = String::from_utf8_lossy(&line);
                if !is_summary(&line) {
                    eprintln!("{line}");
                }
            }
        }
        child.wait()
    }

    fn cargo(&self, command: &str) -> Command {
        let mut cargo = Command::new("cargo");
        let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../Cargo.toml");
        cargo.args([command, "--package", self.package, "--manifest-path"]);
        cargo.arg(workspace).args(self.build);
        cargo.envs(self.environment.iter().map(|(name, value)| (name, value)));
        cargo
    }
}

/// Becomes the program, so that Ctrl-C is the program's alone, and who called waits until that has ended.
#[cfg(unix)]
fn hand_over(program: &mut Command) -> io::Result<ExitStatus> {
    use std::os::unix::process::CommandExt;
    // It comes back only if it could not be started.
    Err(program.exec())
}

/// Runs the program and waits for it.
#[cfg(not(unix))]
fn hand_over(program: &mut Command) -> io::Result<ExitStatus> {
    program.status()
}

/// Whether it is the line that cargo ends every build with.
fn is_summary(line: &str) -> bool {
    line.contains("Finished") && line.contains(" profile [")
}

#[cfg(test)]
mod tests {
    use super::is_summary;

    #[test]
    fn only_the_summary_is_kept_back() {
        for (line, kept_back) in [
            (
                "    Finished `dev` profile [optimized + debuginfo] target(s) in 0.05s",
                true,
            ),
            (
                "\u{1b}[1m\u{1b}[92m    Finished\u{1b}[0m `release` profile [optimized] target(s) in 1m 02s",
                true,
            ),
            ("   Compiling clap v4.6.7", false),
            (
                "    Blocking waiting for file lock on build directory",
                false,
            ),
            ("error: could not compile `xtask`", false),
        ] {
            assert_eq!(is_summary(line), kept_back, "{line}");
        }
    }
}
