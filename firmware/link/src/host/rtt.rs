//! RTT's channels, as SEGGER lays them out: ring buffers, of which the drive fills those that go up and the host those that go
//! down.

use super::Memory;
use anyhow::{Result, bail, ensure};

/// What the control block starts with once the drive has set it up.
const ID: &[u8; 16] = b"SEGGER RTT\0\0\0\0\0\0";
/// In the block: how many channels there are that go up and down, and the first one; those that go down follow the others.
const UP_CHANNELS: u32 = 16;
const DOWN_CHANNELS: u32 = 20;
const FIRST: u32 = 24;
/// A channel: its size, and its fields buffer and size, write and read position.
const CHANNEL: u32 = 24;
const BUFFER: u32 = 4;
const POSITIONS: u32 = 12;
const WRITE: u32 = 12;
const READ: u32 = 16;

/// Where RTT's control block is in the memory from `start` on; `None` if there is none, as before the firmware has started.
///
/// # Errors
/// The memory cannot be read.
pub fn locate(memory: &mut impl Memory, start: u32, bytes: u32) -> Result<Option<u32>> {
    const PIECE: u32 = 4096;
    let mut all = vec![0; bytes as usize];
    for (piece, at) in all
        .chunks_mut(PIECE as usize)
        .zip((start..).step_by(PIECE as usize))
    {
        memory.read(at, piece)?;
    }
    // The block is aligned as its words are.
    let found = all
        .windows(ID.len())
        .step_by(4)
        .position(|words| words == ID);
    Ok(found
        .and_then(|word| u32::try_from(4 * word).ok())
        .map(|at| start + at))
}

/// A channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel {
    at: u32,
    buffer: u32,
    size: u32,
}

impl Channel {
    /// Up-channel `index` of the control block at `block`; `None` while the drive has not set it up.
    ///
    /// # Errors
    /// The memory cannot be read, or the block has no such channel.
    pub fn find(memory: &mut impl Memory, block: u32, index: usize) -> Result<Option<Self>> {
        Self::find_one(memory, block, index, false)
    }

    /// The same of a down-channel.
    ///
    /// # Errors
    /// As [`Channel::find`].
    pub fn find_down(memory: &mut impl Memory, block: u32, index: usize) -> Result<Option<Self>> {
        Self::find_one(memory, block, index, true)
    }

    fn find_one(
        memory: &mut impl Memory,
        block: u32,
        index: usize,
        down: bool,
    ) -> Result<Option<Self>> {
        let mut id = [0; ID.len()];
        memory.read(block, &mut id)?;
        if id != *ID {
            return Ok(None);
        }
        const { assert!(DOWN_CHANNELS == UP_CHANNELS + 4, "one read") };
        let [ups, downs] = memory.words(block + UP_CHANNELS)?;
        let (count, before, way) = if down {
            (downs, ups, "down")
        } else {
            (ups, 0, "up")
        };
        let Some(place) = u32::try_from(index).ok().filter(|place| *place < count) else {
            bail!(
                "the drive has {count} RTT {way}-channels and no {way}-channel {index}: flash this firmware first"
            );
        };
        ensure!(
            before <= 16,
            "the drive says that it has {before} RTT up-channels: flash this firmware first"
        );
        let place = before + place;
        let at = block + FIRST + place * CHANNEL;
        let [buffer, size] = memory.words(at + BUFFER)?;
        ensure!(
            size > 1 && size <= 1 << 20,
            "RTT channel {index} has a buffer of {size} bytes: flash this firmware first"
        );
        Ok(Some(Self { at, buffer, size }))
    }

    /// Puts as many of `bytes` into a down-channel as it has room for: how many.
    ///
    /// # Errors
    /// As [`Channel::drain`].
    pub fn fill(&self, memory: &mut impl Memory, bytes: &[u8]) -> Result<usize> {
        let [write, read] = memory.words(self.at + POSITIONS)?;
        self.check(write, read)?;
        let size = self.size;
        let room = (read + size - write - 1) % size;
        let count = u32::try_from(bytes.len()).unwrap_or(u32::MAX).min(room);
        let (mut at, mut rest) = (write, &bytes[..count as usize]);
        while !rest.is_empty() {
            let piece = rest.len().min((size - at) as usize);
            memory.write_bytes(self.buffer + at, &rest[..piece])?;
            rest = &rest[piece..];
            // Within the buffer's size.
            #[allow(clippy::cast_possible_truncation)]
            let next = (at + piece as u32) % size;
            at = next;
        }
        if count > 0 {
            memory.write(self.at + WRITE, at)?;
        }
        Ok(count as usize)
    }

    fn check(&self, write: u32, read: u32) -> Result<()> {
        let size = self.size;
        ensure!(
            write < size && read < size,
            "an RTT channel of {size} bytes stands at {write} and {read}: has the drive been flashed anew?"
        );
        Ok(())
    }

    /// Takes out what is in it, and appends it to `bytes`. How much that was.
    ///
    /// # Errors
    /// The memory cannot be reached, or the drive's positions are not within the buffer.
    pub fn drain(&self, memory: &mut impl Memory, bytes: &mut Vec<u8>) -> Result<usize> {
        let [write, read] = memory.words(self.at + POSITIONS)?;
        let size = self.size;
        self.check(write, read)?;
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

    /// One up and one down, which is where the second one is.
    #[test]
    fn a_down_channel_is_filled_over_its_end_and_not_past_what_is_unread() {
        for (write, read, sent, expected) in [
            (2, 2, "123", 3),
            (6, 2, "1234", 3),
            (6, 6, "123456789", 7),
            (1, 2, "1", 0),
        ] {
            let mut ram = ram(write, read);
            ram.write(16, 1).unwrap();
            ram.write(20, 1).unwrap();
            let channel = Channel::find_down(&mut ram, 0, 0).unwrap().unwrap();
            let count = channel.fill(&mut ram, sent.as_bytes()).unwrap();
            assert_eq!(count, expected, "{write} {read}");
            let mut bytes = Vec::new();
            // What was there before, and this.
            channel.drain(&mut ram, &mut bytes).unwrap();
            assert!(bytes.ends_with(&sent.as_bytes()[..count]), "{bytes:?}");
            assert_eq!(bytes.len() as u32, (write + 8 - read) % 8 + count as u32);
        }
    }

    #[test]
    fn the_control_block_is_found_where_it_is() {
        let mut memory = Ram(vec![0; 5000]);
        assert_eq!(locate(&mut memory, 0, 5000).unwrap(), None);
        // Over the end of a piece.
        memory.0[4088..4104].copy_from_slice(ID);
        assert_eq!(locate(&mut memory, 0, 5000).unwrap(), Some(4088));
    }

    #[test]
    fn what_is_no_channel_is_said() {
        let mut unready = ram(0, 0);
        unready.0[0] = 0;
        assert_eq!(Channel::find(&mut unready, 0, 1).unwrap(), None);
        let error = Channel::find(&mut ram(0, 0), 0, 2).unwrap_err().to_string();
        assert!(error.contains("no up-channel 2"), "{error}");
        let error = Channel::find_down(&mut ram(0, 0), 0, 0)
            .unwrap_err()
            .to_string();
        assert!(error.contains("no down-channel 0"), "{error}");
        let mut wild = ram(9, 0);
        let channel = Channel::find(&mut wild, 0, 1).unwrap().unwrap();
        assert!(
            channel.drain(&mut wild, &mut Vec::new()).is_err(),
            "a channel with wild pointers was read"
        );
    }
}
