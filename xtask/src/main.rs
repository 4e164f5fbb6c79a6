//! `cargo xtask`: builds, checks and tests the project.
#![forbid(unsafe_code)]

mod check;
mod steps;
mod test;

use anyhow::{Result, bail};
use clap::{Args, Parser, Subcommand};
use std::ffi::OsString;
use std::process::ExitCode;
use xtask::program::Program;
use xtask::{firmware, tools, wiring};

/// Builds, checks and tests the project. `cargo ddfeed` runs the product.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    command: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Check within a minute: format, lints, documentation, tests of control, plant and drive.
    Check,
    /// Check everything: format, lints, tests, the firmware's build.
    Test,
    /// Measure the project against its goals.
    #[command(disable_help_flag = true)]
    Bench(Words),
    /// Build the firmware as it is flashed, for a board and a PWM rate.
    Build(firmware::Build),
    /// Build the firmware and write it to the chip's flash.
    #[command(disable_help_flag = true)]
    Flash(Words),
    /// Flash, start, and print the firmware's log.
    #[command(disable_help_flag = true)]
    Run(Words),
    /// Show the debug structure of a running drive, without halting it.
    #[command(disable_help_flag = true)]
    Attach(Words),
    /// With no voltage on the bus: flash, let the firmware check the board, and report.
    #[command(disable_help_flag = true)]
    Bringup(Words),
    /// Run the firmware on an emulated chip that a debugger and a host reach.
    #[command(disable_help_flag = true)]
    Emulate(Words),
    /// Test the firmware on an emulated chip: bit equality, link, settings, cost, stack. Words filter the tests: `chip same_bits`.
    ///
    /// `same_bits` is the test that the chip's ELF and the simulated drive give equal values, bit for bit, in each control period.
    Chip(firmware::ChipOptions),
    /// Run the firmware on an emulated chip and print what its interrupts cost.
    Cost(firmware::CostOptions),
    /// Print what the firmware takes of the chip's flash, RAM, CCM and stack, and its largest symbols.
    Sizes(firmware::SizesOptions),
    /// Draw the default board's wiring from the table on its page.
    Wiring,
    /// Build the browser page: one HTML file with the simulated drive in it.
    #[command(disable_help_flag = true)]
    Page(Words),
    /// Build an archive with the program, both boards' firmware, pages, licences and checksums.
    #[command(disable_help_flag = true)]
    Release(Words),
    #[command(external_subcommand)]
    Other(Vec<OsString>),
}

/// The words of a command that another program reads.
#[derive(Args)]
struct Words {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    words: Vec<OsString>,
}

/// Commands of `ddfeed` that `cargo xtask` once had.
const MOVED: [&str; 7] = [
    "simulate",
    "identify",
    "serve",
    "drive",
    "compensate",
    "record",
    "completions",
];

/// Builds a package's program and hands a command over to it.
fn hand_over(build: &[&str], command: Option<&str>, words: Vec<OsString>) -> Result<()> {
    let program = Program {
        build,
        environment: &[],
    };
    program.run(command.map(OsString::from).into_iter().chain(words))
}

/// A benchmark. That of the browser page needs Node and Chromium, so the page's builder has it.
fn bench(words: Vec<OsString>) -> Result<()> {
    if words.first().is_some_and(|name| name == "scope") {
        let rest = words.into_iter().skip(1).collect();
        return hand_over(&["--package", "browser"], Some("--measure"), rest);
    }
    hand_over(&["--release", "--package", "bench"], None, words)
}

/// A board at a debug probe. Not for release: the probe's library takes minutes to optimise.
fn board(command: &str, words: Words) -> Result<()> {
    hand_over(&["--package", "board"], Some(command), words.words)
}

/// Names the command that is meant.
fn other(words: &[OsString]) -> Result<()> {
    let name = words[0].to_string_lossy();
    if MOVED.contains(&&*name) {
        bail!("`{name}` is a command of the program ddfeed: run `cargo ddfeed {name}`");
    }
    bail!("there is no command `{name}`: `cargo xtask --help` lists all")
}

fn run(task: Task) -> Result<()> {
    match task {
        Task::Check => check::run(),
        Task::Test => test::run(),
        Task::Bench(words) => bench(words.words),
        Task::Build(which) => firmware::build(which).map(|_| ()),
        Task::Flash(words) => board("flash", words),
        Task::Run(words) => board("run", words),
        Task::Attach(words) => board("attach", words),
        Task::Bringup(words) => board("bringup", words),
        Task::Emulate(words) => firmware::emulate(words.words),
        Task::Chip(options) => firmware::chip(&options),
        Task::Cost(options) => firmware::cost(&options),
        Task::Sizes(options) => firmware::sizes(&options),
        Task::Wiring => {
            println!("{}", wiring::draw(&tools::root()?)?.display());
            Ok(())
        }
        Task::Page(words) => hand_over(&["--package", "browser"], None, words.words),
        Task::Release(words) => hand_over(&["--package", "release"], None, words.words),
        Task::Other(words) => other(&words),
    }
}

fn main() -> ExitCode {
    match run(Arguments::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use given::pages::commands;

    #[test]
    fn commands_of_the_pages_are_read() {
        let commands = commands("cargo xtask");
        assert!(!commands.is_empty());
        for command in commands {
            let read = Arguments::try_parse_from(&command.words[1..]);
            if let Err(error) = read
                && error.use_stderr()
            {
                panic!("{}: {error}", command.place);
            }
        }
    }
}
