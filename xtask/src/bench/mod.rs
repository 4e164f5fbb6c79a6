//! `cargo xtask bench`: the project against its goals.

#[cfg(feature = "simulate")]
mod align;
#[cfg(feature = "simulate")]
mod commission;
#[cfg(feature = "simulate")]
mod drive;
#[cfg(feature = "simulate")]
mod faults;
#[cfg(feature = "serve")]
mod link;
#[cfg(feature = "simulate")]
mod runaway;
#[cfg(feature = "identify")]
mod smooth;

use anyhow::Result;
use clap::{Args, Subcommand};

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
    Identify(crate::identify::BenchOptions),
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
    /// Seed of their draw: other seeds draw other pairs.
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    pub pair_seed: u64,
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
pub fn run(what: &Bench) -> Result<()> {
    match what {
        Bench::Drive(options) => drive(options),
        Bench::Align(options) => align(options),
        Bench::Commission(options) => commission(options),
        Bench::Runaway(options) => runaway(options),
        Bench::Faults(options) => faults(options),
        Bench::Link(options) => link(options),
        Bench::Smooth(options) => smooth(options),
        Bench::Identify(options) => crate::identify::bench(options),
    }
}

#[cfg(feature = "simulate")]
fn drive(options: &DriveOptions) -> Result<()> {
    drive::run(options)
}

#[cfg(feature = "simulate")]
fn commission(options: &CommissionOptions) -> Result<()> {
    commission::run(options)
}

/// Hands over to an xtask with the simulator.
#[cfg(not(feature = "simulate"))]
fn commission(_: &CommissionOptions) -> Result<()> {
    crate::with::With::Simulate.take_over()
}

#[cfg(feature = "simulate")]
fn align(options: &AlignOptions) -> Result<()> {
    align::run(options)
}

/// Hands over to an xtask with the simulator.
#[cfg(not(feature = "simulate"))]
fn align(_: &AlignOptions) -> Result<()> {
    crate::with::With::Simulate.take_over()
}

/// Hands over to an xtask with the simulator.
#[cfg(not(feature = "simulate"))]
fn drive(_: &DriveOptions) -> Result<()> {
    crate::with::With::Simulate.take_over()
}

#[cfg(feature = "simulate")]
fn runaway(options: &RunawayOptions) -> Result<()> {
    runaway::run(options)
}

/// Hands over to an xtask with the simulator.
#[cfg(not(feature = "simulate"))]
fn runaway(_: &RunawayOptions) -> Result<()> {
    crate::with::With::Simulate.take_over()
}

#[cfg(feature = "simulate")]
fn faults(options: &FaultsOptions) -> Result<()> {
    faults::run(options)
}

/// Hands over to an xtask with the simulator.
#[cfg(not(feature = "simulate"))]
fn faults(_: &FaultsOptions) -> Result<()> {
    crate::with::With::Simulate.take_over()
}

#[cfg(feature = "serve")]
fn link(options: &LinkOptions) -> Result<()> {
    link::run(options)
}

/// Hands over to an xtask with the simulated drive.
#[cfg(not(feature = "serve"))]
fn link(_: &LinkOptions) -> Result<()> {
    crate::with::With::Serve.take_over()
}

#[cfg(feature = "identify")]
fn smooth(options: &SmoothOptions) -> Result<()> {
    smooth::run(options)
}

/// Hands over to an xtask with the identification.
#[cfg(not(feature = "identify"))]
fn smooth(_: &SmoothOptions) -> Result<()> {
    crate::with::With::Identify.take_over()
}
