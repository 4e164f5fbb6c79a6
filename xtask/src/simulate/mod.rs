//! `cargo xtask simulate`: the drive on a simulated machine.

mod curves;
mod heat;
mod html;
mod options;
mod records;
mod replay;
mod report;
mod run;
mod sweep;
mod sweep_html;
mod sweep_report;
mod table;

pub use options::Options;
pub use run::{PAPER_MEASURED, analytic_percent};

use anyhow::Result;
use options::Kind;

/// Runs what the options ask.
pub fn run(options: &Options) -> Result<()> {
    match &options.kind {
        None => run::run(options),
        Some(Kind::Sweep(sweep)) => sweep::run(sweep),
        Some(Kind::Replay(replay)) => replay::run(replay),
    }
}
