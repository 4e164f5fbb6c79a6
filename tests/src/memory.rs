//! The emulated chip's memory as a debug probe reads and writes it.

use crate::emulator::Emulator;
use anyhow::{Error, Result};
use link::host::Memory;

impl Memory for Emulator {
    fn read(&mut self, address: u32, bytes: &mut [u8]) -> Result<()> {
        let there = self.bytes(address, bytes.len()).map_err(Error::msg)?;
        bytes.copy_from_slice(&there);
        Ok(())
    }

    fn write(&mut self, address: u32, word: u32) -> Result<()> {
        self.set_word(address, word).map_err(Error::msg)
    }
}
