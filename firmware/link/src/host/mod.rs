//! The host's end: a drive read, told and recorded through its chip's memory, while it runs.

pub mod bringup;
pub mod burst;
pub mod client;
pub mod command;
pub mod dialogue;
mod drive;
#[cfg(feature = "log")]
pub mod log;
pub mod reference;
pub mod refused;
pub mod rtt;
pub mod session;
pub mod settings;
pub mod status;
mod stream;

pub use drive::{Drive, View};
pub use stream::{Count, Decoder, MotorRow, Row};

use anyhow::Result;

/// A chip's memory: behind a debug probe, emulated, or a test's stand-in.
pub trait Memory {
    /// Reads bytes from `address` on.
    ///
    /// # Errors
    /// The memory cannot be reached, or there is none.
    fn read(&mut self, address: u32, bytes: &mut [u8]) -> Result<()>;

    /// Writes the word at `address`.
    ///
    /// # Errors
    /// As [`Memory::read`].
    fn write(&mut self, address: u32, word: u32) -> Result<()>;

    /// Writes bytes from `address` on, which need not be a word's: whole words, of which the ends stay as they are.
    ///
    /// # Errors
    /// As [`Memory::read`].
    fn write_bytes(&mut self, address: u32, bytes: &[u8]) -> Result<()> {
        let first = address & !3;
        let before = (address - first) as usize;
        let mut words = vec![0; (before + bytes.len()).next_multiple_of(4)];
        self.read(first, &mut words)?;
        words[before..before + bytes.len()].copy_from_slice(bytes);
        let mut at = first;
        for word in words.as_chunks::<4>().0 {
            self.write(at, u32::from_le_bytes(*word))?;
            at += 4;
        }
        Ok(())
    }

    /// Reads words from `address` on.
    ///
    /// # Errors
    /// As [`Memory::read`].
    fn words<const N: usize>(&mut self, address: u32) -> Result<[u32; N]> {
        let mut bytes = vec![0; 4 * N];
        self.read(address, &mut bytes)?;
        let mut words = bytes
            .as_chunks::<4>()
            .0
            .iter()
            .map(|word| u32::from_le_bytes(*word));
        Ok(std::array::from_fn(|_| words.next().unwrap_or_default()))
    }
}
