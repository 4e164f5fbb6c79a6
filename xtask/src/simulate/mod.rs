//! `cargo xtask simulate`: the drive on a simulated machine, behind the feature `simulate`.

mod options;
#[cfg(feature = "serve")]
mod setup;
#[cfg(feature = "simulate")]
mod study;

#[allow(unused_imports, reason = "what serves a simulated drive names them")]
pub use options::{MachineOptions, Options, Preset};
#[cfg(feature = "simulate")]
pub use study::{PAPER_MEASURED, analytic_percent};

use anyhow::Result;

/// Runs what the options ask.
#[cfg(feature = "simulate")]
pub fn run(options: &Options) -> Result<()> {
    use options::Kind;
    match &options.kind {
        None => study::run(options),
        Some(Kind::Sweep(sweep)) => study::sweep(sweep),
        Some(Kind::Replay(replay)) => study::replay(replay),
    }
}

/// Hands over to an xtask with the simulator.
#[cfg(not(feature = "simulate"))]
pub fn run(_: &Options) -> Result<()> {
    crate::with::With::Simulate.take_over()
}
