//! The firmware's log as a probe reads it: defmt frames in RTT's ring buffer, decoded with the ELF's own table.

use crate::emulator::Emulator;
use crate::image::Image;
use defmt_decoder::{DecodeError, Table};

/// From the control block: its first up-channel, and that channel's fields.
const UP_CHANNEL: u32 = 24;
const BUFFER: u32 = UP_CHANNEL + 4;
const SIZE: u32 = UP_CHANNEL + 8;
const WRITE: u32 = UP_CHANNEL + 12;
const READ: u32 = UP_CHANNEL + 16;

/// Takes what is in the buffer out of it, as lines.
///
/// # Errors
/// The buffer is not where the ELF says, or what is in it is no log.
pub fn drain(emulator: &mut Emulator, image: &Image) -> Result<Vec<String>, String> {
    let block = image.symbol("_SEGGER_RTT")?;
    if emulator.bytes(block, 10)? != b"SEGGER RTT" {
        return Err("the firmware has not set its log up".into());
    }
    let [buffer, size, write, read] =
        [BUFFER, SIZE, WRITE, READ].map(|offset| emulator.word(block + offset));
    let (buffer, size, write, read) = (buffer?, size?, write?, read?);
    let ring = emulator.bytes(buffer, size as usize)?;
    let (write_at, read_at) = (write as usize, read as usize);
    let bytes = if read_at <= write_at {
        ring[read_at..write_at].to_vec()
    } else {
        [&ring[read_at..], &ring[..write_at]].concat()
    };
    emulator.set_word(block + READ, write)?;

    let table = Table::parse(&image.file)
        .map_err(|error| format!("the log table cannot be read: {error}"))?
        .ok_or("the firmware has no log table")?;
    let mut decoder = table.new_stream_decoder();
    decoder.received(&bytes);
    let mut lines = Vec::new();
    loop {
        match decoder.decode() {
            Ok(frame) => lines.push(frame.display_message().to_string()),
            Err(DecodeError::UnexpectedEof) => return Ok(lines),
            Err(DecodeError::Malformed) => return Err("the log holds what is no frame".into()),
        }
    }
}
