//! `cargo xtask simulate`: the drive on a simulated machine.

mod html;
mod options;
mod plots;
mod replay;
mod report;
mod run;
mod sweep;
mod sweep_html;
mod sweep_report;
mod table;

pub use options::Options;

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
