//! `cargo xtask bench`: the project against its goals.

mod align;
mod commission;
mod drive;
mod faults;
mod identify;
mod link;
mod runaway;
mod smooth;

use anyhow::Result;
use clap::{Args, Parser, Subcommand};
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
pub enum Bench {
    /// Ripple of the simulated drive on the paper's machine, and the simulator's speed.
    Drive(DriveOptions),
    /// Starts of a drive that does not know where its rotors stand, and what it says of wrong wiring.
    Align(AlignOptions),
    /// Drives of two decades of power commissioned over their link from cold, and wrong wirings named.
    Commission(CommissionOptions),
    /// Wrong electrical angles, and what they do until the bridges are off.
    Runaway(RunawayOptions),
    /// Each input wrong in each way in each situation on both boards, and what comes of it.
    Faults(FaultsOptions),
    /// How long a command takes to a simulated drive and back, and what telemetry comes, by transport and rate.
    Link(LinkOptions),
    /// How smooth the table moves with the drive's compensation, with others' and without.
    Smooth(SmoothOptions),
    /// The identification on the recordings and measured data beside the project.
    Identify(identify::BenchOptions),
    /// The drive that `link` measures.
    #[command(hide = true)]
    Serve(ddfeed::serve::ServeOptions),
}

/// How many, and how to say it.
#[derive(Args)]
pub struct AlignOptions {
    /// Starts of each kind of machine whose rotors friction holds; a machine that it does not hold comes on top.
    #[arg(long, default_value_t = 500)]
    pub starts: usize,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// How many, and how to say it.
#[derive(Args)]
pub struct CommissionOptions {
    /// Drives.
    #[arg(long, default_value_t = 100)]
    pub drives: u64,
    /// Seed of the first.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// How to say it.
#[derive(Args)]
pub struct RunawayOptions {
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// Which cells, and how to say it.
#[derive(Args)]
pub struct FaultsOptions {
    /// Runs each so-many-th cell only.
    #[arg(long, default_value = "1")]
    pub every: std::num::NonZeroUsize,
    /// So many random pairs of faults besides.
    #[arg(long, default_value_t = 200)]
    pub pairs: usize,
    /// And long runs of so many simulated seconds each, on both boards: with random commands, faults and resets.
    #[arg(long, value_name = "SECONDS")]
    pub soak: Option<f64>,
    /// The same of hard but healthy running, in which no watch may stop the drive.
    #[arg(long, value_name = "SECONDS")]
    pub healthy: Option<f64>,
    /// Writes the matrix as a page into this folder.
    #[arg(long)]
    pub out: Option<std::path::PathBuf>,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// How many, how long, and how to say it.
#[derive(Args)]
pub struct LinkOptions {
    /// Status commands of each transport.
    #[arg(long, value_name = "N", default_value = "1000")]
    pub round_trips: std::num::NonZeroUsize,
    /// How long each rate of telemetry is taken, s.
    #[arg(long, value_name = "S", default_value_t = 5.0)]
    pub duration: f64,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// How many, and how to say it.
#[derive(Args)]
pub struct SmoothOptions {
    /// Seeds of each row.
    #[arg(long, default_value = "5")]
    pub seeds: std::num::NonZeroU64,
    /// Only these parts.
    #[arg(long, value_enum, num_args = 1..)]
    pub only: Vec<SmoothPart>,
    /// Writes the table as a picture into this folder.
    #[arg(long)]
    pub out: Option<std::path::PathBuf>,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// A part of the bench of smoothness.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum SmoothPart {
    /// Machines, modes, speeds and controllers, side by side.
    Rows,
    /// The drive is told wrongly.
    Robustness,
    /// Reversal through friction.
    Reversal,
    /// A step of load, and a base speed that wanders.
    Disturbance,
    /// Time to learn.
    Learning,
    /// What sets the ripple that is left.
    Floor,
    /// Record, identify, compensate, record again.
    Loop,
}

/// How to say it.
#[derive(Args)]
pub struct DriveOptions {
    /// As JSON.
    #[arg(long)]
    pub json: bool,
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
        Bench::Smooth(options) => smooth::run(options),
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
