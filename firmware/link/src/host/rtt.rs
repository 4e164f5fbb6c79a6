//! RTT's up-channels, as SEGGER lays them out: ring buffers that the drive fills and the host empties.

use super::Memory;
use anyhow::{Result, bail, ensure};

/// What the control block starts with once the drive has set it up.
const ID: &[u8; 16] = b"SEGGER RTT\0\0\0\0\0\0";
/// In the block: how many up-channels there are, and the first one.
const UP_CHANNELS: u32 = 16;
const FIRST: u32 = 24;
/// A channel: its size, and its fields buffer and size, write and read position.
const CHANNEL: u32 = 24;
const BUFFER: u32 = 4;
const POSITIONS: u32 = 12;
const READ: u32 = 16;

/// An up-channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel {
    at: u32,
    buffer: u32,
    size: u32,
}

impl Channel {
    /// Channel `index` of the control block at `block`; `None` while the drive has not set it up.
    ///
    /// # Errors
    /// The memory cannot be read, or the block has no such channel.
    pub fn find(memory: &mut impl Memory, block: u32, index: usize) -> Result<Option<Self>> {
        let mut id = [0; ID.len()];
        memory.read(block, &mut id)?;
        if id != *ID {
            return Ok(None);
        }
        let [count] = memory.words(block + UP_CHANNELS)?;
        let Some(place) = u32::try_from(index).ok().filter(|place| *place < count) else {
            bail!(
                "the drive has {count} RTT channels and no channel {index}: flash this firmware first"
            );
        };
        let at = block + FIRST + place * CHANNEL;
        let [buffer, size] = memory.words(at + BUFFER)?;
        ensure!(
            size > 1 && size <= 1 << 20,
            "RTT channel {index} has a buffer of {size} bytes: flash this firmware first"
        );
        Ok(Some(Self { at, buffer, size }))
    }

    /// Takes out what is in it, and appends it to `bytes`. How much that was.
    ///
    /// # Errors
    /// The memory cannot be reached, or the drive's positions are not within the buffer.
    pub fn drain(&self, memory: &mut impl Memory, bytes: &mut Vec<u8>) -> Result<usize> {
        let [write, read] = memory.words(self.at + POSITIONS)?;
        let size = self.size;
        ensure!(
            write < size && read < size,
            "an RTT channel of {size} bytes stands at {write} and {read}: has the drive been flashed anew?"
        );
        let before = bytes.len();
        let parts = if read <= write {
            [(read, write - read), (0, 0)]
        } else {
            [(read, size - read), (0, write)]
        };
        for (from, length) in parts {
            if length > 0 {
                let start = bytes.len();
                bytes.resize(start + length as usize, 0);
                memory.read(self.buffer + from, &mut bytes[start..])?;
            }
        }
        if write != read {
            memory.write(self.at + READ, write)?;
        }
        Ok(bytes.len() - before)
    }
}
