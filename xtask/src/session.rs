//! `cargo xtask bringup | flash | run | attach | command | record`: what needs a debug probe.
//!
//! probe-rs is large, and nothing else needs it, so it is behind the feature `probe`.

use anyhow::{Result, ensure};
use clap::{Args, Subcommand};
use std::path::PathBuf;
use xtask::hold::Hold;

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
    /// Tell a running drive what to do, without halting it: it runs until Ctrl-C, and comes to rest when the probe is pulled.
    Command(CommandOptions),
    /// Record a running drive into a folder that `cargo xtask identify` reads, without halting it.
    Record(RecordOptions),
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

/// What `command` can be asked.
#[derive(Args, Clone, Debug, PartialEq)]
#[command(group = clap::ArgGroup::new("what").required(true).multiple(true).args(["velocity", "base", "stop", "reset"]))]
pub struct CommandOptions {
    /// The probe.
    #[command(flatten)]
    pub which: Which,
    /// Run, with the table at this velocity, mm/s.
    #[arg(long, value_name = "MM_S", allow_negative_numbers = true, conflicts_with_all = ["stop", "reset"])]
    pub velocity: Option<f64>,
    /// Run, with the nut at this speed, rpm.
    #[arg(long, value_name = "RPM", allow_negative_numbers = true, conflicts_with_all = ["stop", "reset"])]
    pub base: Option<f64>,
    /// Come to rest and switch the bridges off.
    #[arg(long, conflicts_with = "reset")]
    pub stop: bool,
    /// Leave a fault whose cause is gone.
    #[arg(long)]
    pub reset: bool,
}

/// What `record` can be asked.
#[derive(Args, Clone, Debug, PartialEq)]
pub struct RecordOptions {
    /// The probe.
    #[command(flatten)]
    pub which: Which,
    /// How long, s; by default as long as the holds.
    #[arg(long, value_parser = clap::value_parser!(f64))]
    pub seconds: Option<f64>,
    /// The folder.
    #[arg(long)]
    pub out: PathBuf,
    /// The recording's name in it: `fit` and `check` are what `identify` is usually given.
    #[arg(long, default_value = "record")]
    pub name: String,
    /// Samples a second: the speed task's 5000, or less if the probe is too slow.
    #[arg(long, default_value_t = 5000)]
    pub rate: u32,
    /// Run at table mm/s, nut rpm for seconds, and then the next; and come to rest at the end. For example 2.5,300,3.
    #[arg(long, value_name = "MM_S,RPM,S", allow_hyphen_values = true)]
    pub hold: Vec<Hold>,
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

impl RecordOptions {
    /// Which step of the speed task makes a sample.
    pub fn divider(&self) -> Result<u8> {
        divider(self.rate)
    }

    /// How long to record, s.
    pub fn seconds(&self) -> Result<f64> {
        let holds: f64 = self.hold.iter().map(|hold| hold.seconds).sum();
        let seconds = self.seconds.unwrap_or(holds);
        ensure!(
            seconds.is_finite() && seconds > 0.0,
            "nothing to record for {seconds} s: give --seconds, or --hold MM_S,RPM,S for each operating point"
        );
        Ok(seconds)
    }
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
        if let Self::Record(options) = self {
            options.divider()?;
            options.seconds()?;
            ensure!(
                !options.name.is_empty() && !options.name.contains(['/', '\\']),
                "--name is `{}`, but a name within the folder is needed",
                options.name
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
    fn a_recording_is_as_long_as_its_holds() {
        let line = "xtask record --out out --hold 2.5,300,3 --hold -2.5,-500,4 --rate 1000";
        let Session::Record(options) = parse(line).unwrap() else {
            panic!("a recording");
        };
        assert_eq!(options.seconds().unwrap(), 7.0);
        assert_eq!(options.divider().unwrap(), 5);
        assert!(
            (options.hold[1].velocity + 2.5e-3).abs() < 1e-12,
            "measured {}, expected -({}) within {:e}",
            options.hold[1].velocity,
            2.5e-3,
            1e-12
        );
        assert!(
            (options.hold[1].base + 500.0 * std::f64::consts::TAU / 60.0).abs() < 1e-9,
            "measured {}, expected -({}) within {:e}",
            options.hold[1].base,
            500.0 * std::f64::consts::TAU / 60.0,
            1e-9
        );
    }

    #[test]
    fn what_cannot_be_done_is_said_before_a_probe_is_looked_for() {
        for (line, expected) in [
            ("xtask record --out out", "nothing to record"),
            ("xtask record --out out --seconds nan", "nothing to record"),
            (
                "xtask record --out out --seconds 1 --rate 3000",
                "5000, 2500",
            ),
            (
                "xtask record --out out --seconds 1 --name a/b",
                "a name within",
            ),
            ("xtask record --out out --hold 2.5,300", "give three"),
            ("xtask record --out out --hold 2.5,300,-1", "a time above 0"),
            ("xtask command", "required"),
            ("xtask bringup --turn 0", "0.1 to 600"),
            ("xtask bringup --turn nan", "0.1 to 600"),
            ("xtask command --stop --reset", "cannot be used with"),
            ("xtask command --velocity 1 --stop", "cannot be used with"),
        ] {
            let error = parse(line).unwrap_err();
            assert!(error.contains(expected), "{line}: {error}");
        }
    }
}
