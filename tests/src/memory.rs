//! The emulated chip's memory as a debug probe reads and writes it, and its time as a bench's.

use crate::chip::CORE_HZ;
use crate::emulator::Emulator;
use anyhow::{Error, Result};
use link::host::Memory;
use link::host::bringup::Bench;

/// Where peripherals begin.
const PERIPHERALS: u32 = 0x4000_0000;

impl Memory for Emulator {
    fn read(&mut self, address: u32, bytes: &mut [u8]) -> Result<()> {
        let there = self.bytes(address, bytes.len()).map_err(Error::msg)?;
        bytes.copy_from_slice(&there);
        Ok(())
    }

    fn write(&mut self, address: u32, word: u32) -> Result<()> {
        if address >= PERIPHERALS {
            self.chip().write(address, 4, word);
            return Ok(());
        }
        self.set_word(address, word).map_err(Error::msg)
    }
}

impl Bench for Emulator {
    fn wait(&mut self, seconds: f64) -> Result<()> {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let cycles = (seconds * CORE_HZ as f64).round() as u64;
        let until = self.chip().now + cycles;
        self.run_until(until).map_err(Error::msg)
    }

    fn now(&self) -> f64 {
        self.time() as f64 / CORE_HZ as f64
    }
}
