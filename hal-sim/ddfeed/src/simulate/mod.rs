//! `ddfeed simulate`: the drive on a simulated machine.

mod literature;
mod losses;
mod options;
mod proposal;
mod setup;
mod study;

pub use options::{BoardName, Bridges, MachineOptions, Options, Preset};
pub use study::{PAPER_MEASURED, analytic_percent};

use anyhow::Result;

/// Runs what the options ask.
pub fn run(options: &Options) -> Result<()> {
    use options::Kind;
    match &options.kind {
        None => study::run(options),
        Some(Kind::Sweep(sweep)) => study::sweep(sweep),
        Some(Kind::Replay(replay)) => study::replay(replay),
        Some(Kind::Literature(literature)) => literature::run(literature),
    }
}
