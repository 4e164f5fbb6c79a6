//! `cargo xtask identify` and `bench identify`.
//!
//! The identification's libraries are many, and nothing else needs them, so it is behind the feature `identify`.

#[cfg(feature = "identify")]
mod bench;
#[cfg(all(test, feature = "identify"))]
mod coverage_test;
#[cfg(feature = "identify")]
mod demo;
#[cfg(feature = "identify")]
mod simulation;
#[cfg(feature = "identify")]
mod told;
#[cfg(feature = "identify")]
mod trace;
#[cfg(all(test, feature = "identify"))]
mod trace_test;
#[cfg(feature = "identify")]
mod wrong_data;

use anyhow::Result;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Which record of which machine.
#[derive(Args)]
pub struct IdentifyOptions {
    /// The declared model (model.toml).
    #[arg(long, required_unless_present_any = ["demo", "reference"])]
    pub model: Option<PathBuf>,
    /// The record to identify from: text (.csv, .txt, also .gz), .npy, .npz, MATLAB 5 .mat, .parquet. More than one may be
    /// given.
    #[arg(long, num_args = 1.., required_unless_present_any = ["demo", "reference"])]
    pub fit: Vec<PathBuf>,
    /// Another record of the same machine: it confirms, and errors are reported on it. Without it some operating points of
    /// the fit record are held back.
    #[arg(long, num_args = 1..)]
    pub check: Vec<PathBuf>,
    /// Folder for report.html, report.json, model.toml and residual.csv.
    #[arg(long, default_value = "out/identify")]
    pub out: PathBuf,
    /// What the records are of and which of their columns is which, where they are not the project's own
    /// (hal-sim/identify/mappings has some, --reference all keys).
    #[arg(long)]
    pub mapping: Option<PathBuf>,
    /// What is done with a fault that a rule can mend.
    #[arg(long, value_enum, default_value_t = Fault::Refuse)]
    pub on_fault: Fault,
    /// Progress in lines even where standard error is no terminal.
    #[arg(long)]
    pub progress: bool,
    /// Leave out the simulation of the check record's profile with the declared and the new model.
    #[arg(long)]
    pub no_simulation: bool,
    /// Something to see: records a simulated machine with an effect drawn at random, and identifies it.
    #[arg(long, conflicts_with_all = ["model", "fit", "check", "mapping", "reference"])]
    pub demo: bool,
    /// The machine of the demonstration; without it another one each time.
    #[arg(long, requires = "demo")]
    pub seed: Option<u64>,
    /// Print all keys of mapping and model files.
    #[arg(long, conflicts_with_all = ["model", "fit", "check", "mapping"])]
    pub reference: bool,
}

/// What is done with a fault.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum Fault {
    /// The record is refused, the fault told by row and column.
    Refuse,
    /// The row is left out and counted in report.json.
    Skip,
}

/// How to say what the identification reaches.
#[derive(Args)]
pub struct BenchOptions {
    /// As JSON.
    #[arg(long)]
    pub json: bool,
    /// What the shared recordings' machines have, to judge by; recordings/answers.json beside the project if not given.
    #[arg(long)]
    pub answers: Option<PathBuf>,
    /// Runs the blind test first, on so many machines. Without it, what its last run wrote is taken, and the test of 20
    /// machines is run if there is none.
    #[arg(long)]
    pub blind: Option<u32>,
    /// The full numbers of drawn machines; without it a sample.
    #[arg(long)]
    pub long: bool,
    /// Only these parts.
    #[arg(long, value_enum, num_args = 1..)]
    pub only: Vec<Part>,
    /// So many machines of each part that draws them, in place of the sample's or the full numbers.
    #[arg(long)]
    pub runs: Option<u64>,
    /// The first machine of those with effects that no family has, and of clean double drives: another one is another seed.
    #[arg(long, default_value_t = 0)]
    pub first: usize,
}

/// A part of the bench.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Part {
    /// Shared recordings, EMPS, LAAS, an ODrive's records, the paper.
    Measured,
    /// The blind test.
    Blind,
    /// Motors alone.
    Pmsm,
    /// Clean motors and feed axes.
    Clean,
    /// Effects that no family has.
    Outside,
    /// Wrong data.
    Wrong,
}

/// Identifies.
#[cfg(feature = "identify")]
pub fn run(options: &IdentifyOptions) -> Result<()> {
    if options.reference {
        print!("{}", identify::reference::page());
        return Ok(());
    }
    if options.demo {
        return demo::run(options);
    }
    trace::run(options)
}

/// Measures.
#[cfg(feature = "identify")]
pub fn bench(options: &BenchOptions) -> Result<()> {
    bench::run(options)
}

/// Hands over to an xtask with the identification.
#[cfg(not(feature = "identify"))]
pub fn run(_: &IdentifyOptions) -> Result<()> {
    crate::with::With::Identify.take_over()
}

/// Hands over to an xtask with the identification.
#[cfg(not(feature = "identify"))]
pub fn bench(_: &BenchOptions) -> Result<()> {
    crate::with::With::Identify.take_over()
}
