//! `cargo xtask bench`: the project against its goals.

use anyhow::Result;
use bench::alignment::report as align;
use bench::commissioning::report as commission;
use bench::faults::report as faults;
use bench::runaway::report as runaway;
use bench::smooth::report as smooth;
use bench::{drive, identify, journey, link, probe};
use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Measure the project against its goals.
#[derive(Parser)]
#[command(name = "cargo xtask bench", bin_name = "cargo xtask bench")]
struct Arguments {
    #[command(subcommand)]
    what: Bench,
}

/// What to measure.
#[derive(Subcommand)]
enum Bench {
    /// Ripple of the simulated drive on the paper's machine, and the simulator's speed.
    Drive(drive::DriveOptions),
    /// Starts of a drive that does not know where its rotors stand, and what it says of wrong wiring.
    Align(align::AlignOptions),
    /// Drives of two decades of power commissioned over their link from cold, and wrong wirings named.
    Commission(commission::CommissionOptions),
    /// Wrong electrical angles, and what they do until the bridges are off.
    Runaway(runaway::RunawayOptions),
    /// Each input wrong in each way in each situation on both boards, and what comes of it.
    Faults(faults::FaultsOptions),
    /// How long a command takes to a simulated drive and back, and what telemetry comes, by transport and rate.
    Link(link::LinkOptions),
    /// A debugger's session with the emulated chip: flash, breakpoints, steps, recordings, halts, failures.
    Probe(probe::ProbeOptions),
    /// How smooth the table moves with the drive's compensation, with others' and without.
    Smooth(smooth::SmoothOptions),
    /// Machines of users from cold to a smoother table, by the commands alone.
    Journey(journey::JourneyOptions),
    /// The identification on the recordings and measured data beside the project.
    Identify(identify::BenchOptions),
    /// The drive that `link` measures.
    #[command(hide = true)]
    Serve(ddfeed::serve::ServeOptions),
}

/// Measures and prints.
fn run(what: &Bench) -> Result<()> {
    match what {
        Bench::Drive(options) => drive::run(options),
        Bench::Align(options) => align::run(options),
        Bench::Commission(options) => commission::run(options),
        Bench::Runaway(options) => runaway::run(options),
        Bench::Faults(options) => faults::run(options),
        Bench::Link(options) => link::run(options),
        Bench::Probe(options) => probe::run(options),
        Bench::Smooth(options) => smooth::run(options),
        Bench::Journey(options) => journey::run(options),
        Bench::Identify(options) => identify::run(options),
        Bench::Serve(options) => ddfeed::serve::run(options),
    }
}

fn main() -> ExitCode {
    // Ends quietly on a broken pipe.
    sigpipe::reset();
    match run(&Arguments::parse().what) {
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
        let mut commands = commands("cargo xtask bench");
        // The package `browser` reads this one.
        commands.retain(|command| command.words.get(3).is_none_or(|name| name != "scope"));
        assert!(!commands.is_empty());
        for command in commands {
            let read = Arguments::try_parse_from(&command.words[2..]);
            if let Err(error) = read
                && error.use_stderr()
            {
                panic!("{}: {error}", command.place);
            }
        }
    }
}
