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

#[cfg(test)]
mod tests {
    use super::*;

    struct Ram(Vec<u8>);

    impl Memory for Ram {
        fn read(&mut self, address: u32, bytes: &mut [u8]) -> Result<()> {
            let at = address as usize;
            bytes.copy_from_slice(&self.0[at..at + bytes.len()]);
            Ok(())
        }

        fn write(&mut self, address: u32, word: u32) -> Result<()> {
            let at = address as usize;
            self.0[at..at + 4].copy_from_slice(&word.to_le_bytes());
            Ok(())
        }
    }

    /// Two channels; the second has eight bytes, of which `read` to `write` are there.
    fn ram(write: u32, read: u32) -> Ram {
        let mut ram = Ram(vec![0; 0x100]);
        ram.0[..16].copy_from_slice(ID);
        for (k, word) in [2, 0].into_iter().enumerate() {
            ram.write(16 + 4 * k as u32, word).unwrap();
        }
        for (k, word) in [0, 0x80, 8, write, read, 0].into_iter().enumerate() {
            ram.write(48 + 4 * k as u32, word).unwrap();
        }
        ram.0[0x80..0x88].copy_from_slice(b"abcdefgh");
        ram
    }

    #[test]
    fn a_channel_is_emptied_over_its_end() {
        for (write, read, expected) in [(5, 2, "cde"), (2, 6, "ghab"), (3, 3, ""), (0, 6, "gh")] {
            let mut ram = ram(write, read);
            let channel = Channel::find(&mut ram, 0, 1).unwrap().unwrap();
            let mut bytes = b"+".to_vec();
            let length = channel.drain(&mut ram, &mut bytes).unwrap();
            assert_eq!(bytes, format!("+{expected}").as_bytes());
            assert_eq!(length, expected.len());
            assert_eq!(channel.drain(&mut ram, &mut bytes).unwrap(), 0);
        }
    }

    #[test]
    fn what_is_no_channel_is_said() {
        let mut unready = ram(0, 0);
        unready.0[0] = 0;
        assert_eq!(Channel::find(&mut unready, 0, 1).unwrap(), None);
        let error = Channel::find(&mut ram(0, 0), 0, 2).unwrap_err().to_string();
        assert!(error.contains("no channel 2"), "{error}");
        let mut wild = ram(9, 0);
        let channel = Channel::find(&mut wild, 0, 1).unwrap().unwrap();
        assert!(
            channel.drain(&mut wild, &mut Vec::new()).is_err(),
            "a channel with wild pointers was read"
        );
    }
}
