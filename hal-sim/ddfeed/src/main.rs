//! The program `ddfeed`.
#![forbid(unsafe_code)]

mod completions;

use clap::{CommandFactory, Parser, Subcommand};
use ddfeed::{compensate, drive, identify, serve, session, simulate};
use std::process::ExitCode;

/// Drive software for a double-drive differential feed.
#[derive(Parser)]
#[command(name = "ddfeed", version)]
struct Arguments {
    #[command(subcommand)]
    command: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Run the drive on a simulated machine and report how smoothly the table moves.
    Simulate(Box<simulate::Options>),
    /// Compare a model with a recording, and find the effect that the model lacks.
    Identify(identify::IdentifyOptions),
    /// Simulate a drive behind its link, in real time. `drive --sim` commands it.
    Serve(serve::ServeOptions),
    /// Command a drive over its link: a simulated one, or one at a serial port or a debug probe.
    Drive(drive::DriveOptions),
    /// Turn a model's effects into settings that compensate them, and predict the ripple.
    Compensate(compensate::CompensateOptions),
    /// Record a running drive through a debug probe, into a folder that `identify` reads.
    Record(session::RecordOptions),
    /// Print a script that completes this command line in a shell.
    Completions(completions::CompletionsOptions),
}

/// Records through the probe.
#[cfg(feature = "probe")]
fn record(options: &session::RecordOptions) -> anyhow::Result<()> {
    options.check()?;
    ddfeed::probe::record::run(options)
}

/// Says which feature is missing.
#[cfg(not(feature = "probe"))]
fn record(options: &session::RecordOptions) -> anyhow::Result<()> {
    options.check()?;
    Err(ddfeed::missing_feature("`record`", "probe"))
}

fn main() -> ExitCode {
    // Ends quietly on a broken pipe: `ddfeed ... | head`.
    sigpipe::reset();
    let result = match Arguments::parse().command {
        Task::Simulate(options) => simulate::run(&options),
        Task::Identify(options) => identify::run(&options),
        Task::Serve(options) => serve::run(&options),
        Task::Drive(options) => drive::run(&options),
        Task::Compensate(options) => compensate::run(&options),
        Task::Record(options) => record(&options),
        Task::Completions(options) => completions::run(&options, Arguments::command()),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            drive::exit_code(&error)
        }
    }
}
