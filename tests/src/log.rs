//! The firmware's log as a probe reads it, from the emulated chip's memory.

use crate::emulator::Emulator;
use crate::image::Image;
use link::host::log::{Log, table};
use link::host::rtt::Channel;
use link::{LOG_CHANNEL, RTT_SYMBOL};

/// The error of a log that the firmware has not set up since its reset.
pub const NOT_SET_UP: &str = "the firmware has not set its log up";

/// Takes what is in the log's channel out of it, as lines.
///
/// # Errors
/// [`NOT_SET_UP`]; the channel is not where the ELF says, or what is in it is no log.
pub fn drain(emulator: &mut Emulator, image: &Image) -> Result<Vec<String>, String> {
    let block = image.symbol(RTT_SYMBOL)?;
    let said = |error: anyhow::Error| format!("{error:#}");
    let channel = Channel::find(emulator, block, LOG_CHANNEL)
        .map_err(said)?
        .ok_or(NOT_SET_UP)?;
    let mut bytes = Vec::new();
    channel.drain(emulator, &mut bytes).map_err(said)?;
    let table = table(&image.file).map_err(said)?;
    let lines = Log::new(&table).take(&bytes);
    Ok(lines.into_iter().map(|line| line.message).collect())
}
