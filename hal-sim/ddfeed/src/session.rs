//! What a session with a debug probe can be asked.

use crate::hold::Hold;
use anyhow::{Result, ensure};
use clap::Args;
use std::path::PathBuf;

/// Where `cargo xtask build` writes the firmware, from the folder of the clone.
pub const FIRMWARE: &str = "target/thumbv7em-none-eabihf/firmware/firmware";

/// Which probe.
#[derive(Args, Clone, Debug, Default, PartialEq)]
pub struct Which {
    /// The probe, if there are several: its serial number, or another part of its line in the list.
    #[arg(long, value_name = "SELECTOR")]
    pub probe: Option<String>,
}

/// What `record` can be asked.
#[derive(Args, Clone, Debug, PartialEq)]
pub struct RecordOptions {
    /// The probe.
    #[command(flatten)]
    pub which: Which,
    /// The firmware's ELF, which says where the drive has its data. `cargo xtask build` writes the default.
    #[arg(long, value_name = "FILE", default_value = FIRMWARE)]
    pub elf: PathBuf,
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
    /// Refuses arguments before a probe is looked for.
    ///
    /// # Errors
    /// A sentence that names the argument.
    pub fn check(&self) -> Result<()> {
        self.divider()?;
        self.seconds()?;
        ensure!(
            !self.name.is_empty() && !self.name.contains(['/', '\\']),
            "--name is `{}`, but a name within the folder is needed",
            self.name
        );
        Ok(())
    }

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

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        options: RecordOptions,
    }

    fn parse(line: &str) -> Result<RecordOptions, String> {
        let line = Line::try_parse_from(line.split(' ')).map_err(|error| error.to_string())?;
        line.options.check().map_err(|error| error.to_string())?;
        Ok(line.options)
    }

    #[test]
    fn a_recording_is_as_long_as_its_holds() {
        let line = "record --out out --hold 2.5,300,3 --hold -2.5,-500,4 --rate 1000";
        let options = parse(line).unwrap();
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
            ("record --out out", "nothing to record"),
            ("record --out out --seconds nan", "nothing to record"),
            ("record --out out --seconds 1 --rate 3000", "5000, 2500"),
            ("record --out out --seconds 1 --name a/b", "a name within"),
            ("record --out out --hold 2.5,300", "give three"),
            ("record --out out --hold 2.5,300,-1", "a time above 0"),
        ] {
            let error = parse(line).unwrap_err();
            assert!(error.contains(expected), "{line}: {error}");
        }
    }
}
