//! The one door to the project: `cargo xtask <command>`.
#![forbid(unsafe_code)]

mod bench;
mod output;
mod simulate;
mod test;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Drive software for a double-drive differential feed.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    command: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Run the drive on a simulated machine and report how smoothly the table moves.
    Simulate(Box<simulate::Options>),
    /// Measure the project against its goals.
    Bench {
        #[command(subcommand)]
        what: bench::Bench,
    },
    /// Everything that must hold: format, lints, tests, the firmware's build.
    Test,
}

fn main() -> ExitCode {
    let result = match Arguments::parse().command {
        Task::Simulate(options) => simulate::run(&options),
        Task::Bench { what } => bench::run(&what),
        Task::Test => test::run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
