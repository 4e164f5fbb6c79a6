//! `ddfeed serve`: a simulated drive behind its link.

mod flash;
mod lines;
mod machine;
mod switched_on;
mod within;

pub use within::ServedWithin;

use crate::simulate::MachineOptions;
use anyhow::{Result, ensure};
use clap::Args;
use std::path::PathBuf;

/// Which drive, and where it is to be found.
#[derive(Args, Debug)]
pub struct ServeOptions {
    /// Prints the coupled machine as a model file to begin with, and ends: `ddfeed serve --example > mine.toml`.
    #[arg(long)]
    pub example: bool,
    /// Which machine, with which sensors: the mains board's where nothing is named.
    #[command(flatten)]
    pub machine: MachineOptions,
    /// Where it listens.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:7474")]
    pub listen: String,
    /// A pseudo-terminal too, as a serial port has it: its name is printed.
    #[arg(long)]
    pub pty: bool,
    /// How many times as fast as real time, up to 10; what this computer does not reach, it does not.
    #[arg(long, default_value_t = 1.0)]
    pub speed: f64,
    /// The drive has just been switched on, with its rotors anywhere: it aligns them at each start.
    #[arg(long)]
    pub cold: bool,
    /// Settings that hold from the start (TOML), instead of those that fit the machine.
    #[arg(long)]
    pub settings: Option<PathBuf>,
    /// The file that is the drive's flash: settings that were set hold when the drive is served again. It is made if it is
    /// not there.
    #[arg(long, conflicts_with = "settings")]
    pub flash: Option<PathBuf>,
}

/// Serves until Ctrl-C.
pub fn run(options: &ServeOptions) -> Result<()> {
    if options.example {
        ensure!(
            options.machine.board.is_none(),
            "--example prints the coupled machine, not a board's. For a board's model leave --example out, and write it with \
             `ddfeed drive --sim {} settings model own.toml`",
            options.listen
        );
        print!("{}", machine::example());
        return Ok(());
    }
    lines::run(options)
}
