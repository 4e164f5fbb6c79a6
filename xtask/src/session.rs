//! `cargo xtask bringup | flash | run | attach`: what needs a debug probe.
//!
//! probe-rs is large, and nothing else needs it, so it is behind the feature `probe`.

use anyhow::{Result, ensure};
use clap::{Args, Subcommand};
use std::path::PathBuf;

/// A command that needs a probe.
#[derive(Clone, Debug, PartialEq, Subcommand)]
pub enum Session {
    /// With no voltage on the bus: flash, let the firmware ask the board itself, and say what it found.
    Bringup(BringupOptions),
    /// Build the firmware and write it to the chip's flash.
    Flash(Which),
    /// Flash, start, and print the firmware's log.
    Run(Which),
    /// Show the debug structure of a running drive, without halting it.
    Attach(Which),
}

/// Which probe.
#[derive(Args, Clone, Debug, Default, PartialEq)]
pub struct Which {
    /// The probe, if there are several: its serial number, or another part of its line in the list.
    #[arg(long, value_name = "SELECTOR")]
    pub probe: Option<String>,
}

/// What `bringup` can be asked.
#[derive(Args, Clone, Debug, PartialEq)]
pub struct BringupOptions {
    /// The probe.
    #[command(flatten)]
    pub which: Which,
    /// Listen to the encoders for so long, s, while a person turns both shafts by hand.
    #[arg(long, value_name = "S", value_parser = clap::value_parser!(f64))]
    pub turn: Option<f64>,
    /// Where the page goes: `bringup.html`, and `bringup.json`.
    #[arg(long, default_value = "out/bringup")]
    pub out: PathBuf,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// Steps of the speed task a second, of which a sample takes each, each second, or each `n`th.
pub const FULL_RATE: u32 = 5000;

/// Which step of the speed task makes a sample, of so many samples a second.
pub fn divider(rate: u32) -> Result<u8> {
    let divider = FULL_RATE.checked_div(rate).unwrap_or(0);
    ensure!(
        divider >= 1 && divider * rate == FULL_RATE && divider <= u32::from(u8::MAX),
        "--rate is {rate}, but {FULL_RATE} samples a second divided by a whole number up to 255 is possible: 5000, 2500, \
         1000, 500"
    );
    Ok(u8::try_from(divider)?)
}

impl Session {
    /// What can be said against the arguments before a probe is looked for.
    pub fn check(&self) -> Result<()> {
        if let Self::Bringup(options) = self
            && let Some(seconds) = options.turn
        {
            ensure!(
                (0.1..=600.0).contains(&seconds),
                "--turn is {seconds} s, but 0.1 to 600 s are possible"
            );
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(subcommand)]
        session: Session,
    }

    fn parse(line: &str) -> Result<Session, String> {
        let line = Line::try_parse_from(line.split(' ')).map_err(|error| error.to_string())?;
        line.session.check().map_err(|error| error.to_string())?;
        Ok(line.session)
    }

    #[test]
    fn what_cannot_be_done_is_said_before_a_probe_is_looked_for() {
        for (line, expected) in [
            ("xtask bringup --turn 0", "0.1 to 600"),
            ("xtask bringup --turn nan", "0.1 to 600"),
        ] {
            let error = parse(line).unwrap_err();
            assert!(error.contains(expected), "{line}: {error}");
        }
    }
}
