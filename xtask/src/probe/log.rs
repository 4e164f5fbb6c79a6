//! The firmware's log: defmt frames over RTT, decoded with the ELF's own table.

use super::image::Image;
use anyhow::{Context, Result, anyhow};
use defmt_decoder::{DecodeError, Table};
use probe_rs::Core;
use probe_rs::rtt::{Rtt, ScanRegion};
use std::time::Duration;
use std::{thread, time::Instant};

/// How long the firmware has to set its log up.
const START: Duration = Duration::from_secs(2);
/// How often the log is looked at.
const LOOK: Duration = Duration::from_millis(20);

/// Prints the log for as long as the session lasts.
pub fn follow(core: &mut Core<'_>, image: &Image) -> Result<()> {
    let table =
        Table::parse(image.bytes())?.ok_or_else(|| anyhow!("the firmware has no log table"))?;
    let region = ScanRegion::Exact(u64::from(image.log()?));
    let start = Instant::now();
    let mut rtt = loop {
        match Rtt::attach_region(core, &region) {
            Ok(rtt) => break rtt,
            Err(error) if start.elapsed() > START => {
                return Err(error)
                    .context("the firmware's log does not start: does the firmware run?");
            }
            Err(_) => thread::sleep(LOOK),
        }
    };
    let channel = rtt
        .up_channel(0)
        .ok_or_else(|| anyhow!("the firmware's log has no channel"))?;
    let mut decoder = table.new_stream_decoder();
    let mut buffer = [0; 1024];
    loop {
        let length = channel
            .read(core, &mut buffer)
            .context("the log cannot be read")?;
        decoder.received(&buffer[..length]);
        loop {
            match decoder.decode() {
                Ok(frame) => println!("{}", frame.display(false)),
                Err(DecodeError::UnexpectedEof) => break,
                Err(DecodeError::Malformed) => println!("(a log line was lost)"),
            }
        }
        thread::sleep(LOOK);
    }
}
