//! The one door to the project: `cargo xtask <command>`.
#![forbid(unsafe_code)]

mod bench;
mod check;
mod compensate;
mod completions;
mod drive;
mod firmware;
mod identify;
#[cfg(any(feature = "drive", feature = "probe"))]
mod interrupt;
#[cfg(feature = "probe")]
mod probe;
mod serve;
mod session;
mod simulate;
mod steps;
mod test;
mod tools;
mod with;

#[cfg(any(feature = "drive", feature = "simulate"))]
use xtask::output;
use xtask::wiring;

use clap::{CommandFactory, Parser, Subcommand};
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
    /// Hold a model against a recording, and trace what the model lacks.
    Identify(identify::IdentifyOptions),
    /// Measure the project against its goals.
    Bench {
        #[command(subcommand)]
        what: bench::Bench,
    },
    /// Turn what a model knows of a machine into what its drive compensates, and predict the ripple with it.
    Compensate(compensate::CompensateOptions),
    /// Build the firmware as it is flashed.
    Build,
    /// Run the firmware on an emulated chip and print what its interrupts cost.
    Cost(firmware::CostOptions),
    /// Print what the firmware takes of the chip's flash, RAM, CCM and stack, and its largest symbols.
    Sizes(firmware::SizesOptions),
    /// Draw the default board's wiring from the table on its page.
    Wiring,
    #[command(flatten)]
    Session(session::Session),
    /// A simulated drive behind its link, in real time: what `drive --sim` commands.
    Serve(serve::ServeOptions),
    /// Command a drive over its link: one that `serve` simulates, or one at a serial port.
    Drive(drive::DriveOptions),
    /// Print a script by which a shell completes this command line.
    Completions(completions::CompletionsOptions),
    /// What can be told within a minute: format, lints, documentation, tests of control, plant and drive.
    Check,
    /// Everything that must hold: format, lints, tests, the firmware's build.
    Test,
}

/// Does what needs a probe with the one that is there.
#[cfg(feature = "probe")]
fn with_probe(session: session::Session) -> anyhow::Result<()> {
    probe::run(session)
}

/// Hands over to an xtask with probe-rs.
#[cfg(not(feature = "probe"))]
fn with_probe(_: session::Session) -> anyhow::Result<()> {
    with::With::Probe.take_over()
}

fn main() -> ExitCode {
    // Whose reader goes, ends: `cargo xtask ... | head`.
    sigpipe::reset();
    let result = match Arguments::parse().command {
        Task::Simulate(options) => simulate::run(&options),
        Task::Identify(options) => identify::run(&options),
        Task::Bench { what } => bench::run(&what),
        Task::Compensate(options) => compensate::run(&options),
        Task::Build => firmware::build().map(|_| ()),
        Task::Cost(options) => firmware::cost(&options),
        Task::Sizes(options) => firmware::sizes(&options),
        Task::Wiring => wiring::draw(&tools::root()).map(|path| println!("{}", path.display())),
        Task::Serve(options) => serve::run(&options),
        Task::Drive(options) => drive::run(&options),
        Task::Session(session) => session.check().and_then(|()| with_probe(session)),
        Task::Completions(options) => completions::run(&options, Arguments::command()),
        Task::Check => check::run(),
        Task::Test => test::run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            drive::exit_code(&error)
        }
    }
}
