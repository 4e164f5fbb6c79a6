//! What a session with a board can be asked.

use anyhow::{Result, ensure};
use clap::{Args, Subcommand};
use ddfeed::session::Which;
use link::bringup::POWERED_V;
use std::path::PathBuf;
use xtask::firmware::Build;

/// A command that needs a debug probe.
#[derive(Clone, Debug, PartialEq, Subcommand)]
pub enum Session {
    /// Flash, let the firmware ask the board itself, and say what it found: with no voltage on the bus, or at 12 V.
    Bringup(BringupOptions),
    /// Build the firmware and write it to the chip's flash.
    Flash(Chosen),
    /// Flash, start, and print the firmware's log.
    Run(Chosen),
    /// Show the debug structure of a running drive, without halting it.
    Attach(Chosen),
}

/// A board: its probe, and its firmware.
#[derive(Args, Clone, Debug, PartialEq)]
pub struct Chosen {
    /// The probe.
    #[command(flatten)]
    pub which: Which,
    /// The firmware.
    #[command(flatten)]
    pub build: Build,
}

/// What `bringup` can be asked.
#[derive(Args, Clone, Debug, PartialEq)]
pub struct BringupOptions {
    /// The board.
    #[command(flatten)]
    pub chosen: Chosen,
    /// Listen to the encoders for so long, s, while a person turns both shafts by hand.
    #[arg(long, value_name = "S", value_parser = clap::value_parser!(f64))]
    pub turn: Option<f64>,
    /// The second stage, at 12 V on the bus: drivers awake, bridges off. No motor may be connected.
    #[arg(long, requires = "bus_volts", conflicts_with = "turn")]
    pub powered: bool,
    /// What your meter reads at the bus, V.
    #[arg(long, value_name = "V", requires = "powered")]
    pub bus_volts: Option<f64>,
    /// Where the page goes: `bringup.html`, and `bringup.json`.
    #[arg(long, default_value = "out/bringup")]
    pub out: PathBuf,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

impl Session {
    /// The board.
    pub fn chosen(&self) -> &Chosen {
        match self {
            Self::Flash(chosen) | Self::Run(chosen) | Self::Attach(chosen) => chosen,
            Self::Bringup(options) => &options.chosen,
        }
    }

    /// Refuses arguments before a probe is looked for.
    pub fn check(&self) -> Result<()> {
        self.chosen().build.features()?;
        let Self::Bringup(options) = self else {
            return Ok(());
        };
        if let Some(seconds) = options.turn {
            ensure!(
                (0.1..=600.0).contains(&seconds),
                "--turn is {seconds} s, but 0.1 to 600 s are possible"
            );
        }
        if let Some(volts) = options.bus_volts {
            let [least, most] = POWERED_V;
            ensure!(
                (least..=most).contains(&volts),
                "--bus-volts is {volts} V, but the second stage runs at {least} to {most} V: set the bus to 12 V"
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

    #[test]
    fn what_cannot_be_done_is_said_before_a_probe_is_looked_for() {
        for (line, expected) in [
            ("xtask bringup --turn 0", "0.1 to 600"),
            ("xtask bringup --turn nan", "0.1 to 600"),
            ("xtask bringup --powered", "--bus-volts"),
            ("xtask bringup --bus-volts 12", "--powered"),
            ("xtask bringup --powered --bus-volts 48", "8 to 30 V"),
            ("xtask flash --board mains --pwm-khz 40", "runs at 20 kHz"),
        ] {
            let error = match Line::try_parse_from(line.split(' ')) {
                Ok(line) => line.session.check().unwrap_err().to_string(),
                Err(error) => error.to_string(),
            };
            assert!(error.contains(expected), "{line}: {error}");
        }
    }
}
