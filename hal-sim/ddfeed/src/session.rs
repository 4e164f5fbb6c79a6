//! What a session with a debug probe can be asked.

use anyhow::{Result, ensure};
use clap::Args;

/// Which probe.
#[derive(Args, Clone, Debug, Default, PartialEq)]
pub struct Which {
    /// The probe, if there are several: its serial number, or another part of its line in the list. Or the address of an emulated
    /// chip's: `127.0.0.1:2331`.
    #[arg(long, value_name = "SELECTOR")]
    pub probe: Option<String>,
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
