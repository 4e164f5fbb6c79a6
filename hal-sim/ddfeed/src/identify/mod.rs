//! `ddfeed identify`.

pub mod demo;
mod printed;
mod simulation;
mod told;
mod trace;
#[cfg(test)]
mod trace_test;

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

/// Identifies.
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
