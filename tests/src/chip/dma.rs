//! DMA1 and its multiplexer: a circular transfer of one 16-bit word from an ADC to memory (RM0440 12 and 13).

use super::registers::Registers;

/// DMA1 with DMAMUX.
pub struct Dma {
    channels: [Registers; 2],
    requests: [u32; 2],
}

impl Dma {
    /// After reset.
    #[must_use]
    pub fn new() -> Self {
        let channel = |name| {
            Registers::new(
                name,
                &[
                    ("CR", 0x0, 0),
                    ("NDTR", 0x4, 0),
                    ("PAR", 0x8, 0),
                    ("MAR", 0xC, 0),
                ],
            )
        };
        Self {
            channels: [channel("DMA1 channel 1"), channel("DMA1 channel 2")],
            requests: [0; 2],
        }
    }

    /// ADC `index` + 1 has `counts` in its data register at `from`: where they go.
    ///
    /// # Errors
    /// A channel takes the request and is not set up for it.
    pub fn transfer(
        &self,
        index: usize,
        from: u32,
        counts: u16,
    ) -> Result<Option<(u32, u16)>, String> {
        // DMAMUX requests of ADC1 to ADC4 (RM0440 table 91).
        let request = [5, 36, 37, 38][index];
        let Some(channel) = self.requests.iter().position(|&taken| taken == request) else {
            return Ok(None);
        };
        let registers = &self.channels[channel];
        let cr = registers.get("CR");
        // Enabled, circular, 16 bits on both sides, from the peripheral, one word.
        let as_modelled = cr == (1 | 1 << 5 | 1 << 8 | 1 << 10) && registers.get("NDTR") == 1;
        if !as_modelled || registers.get("PAR") != from {
            return Err(format!(
                "DMA1 channel {} is not set up as this model has it (CR {cr:#x})",
                channel + 1
            ));
        }
        Ok(Some((registers.get("MAR"), counts)))
    }

    fn at(address: u32) -> Option<(usize, u32)> {
        let offset = (address & 0x3FF).checked_sub(8)?;
        let (channel, offset) = (offset / 20, offset % 20);
        (channel < 2).then_some((channel as usize, offset))
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn read(&self, address: u32) -> Result<u32, String> {
        match (address & 0x800, Self::at(address)) {
            (0, Some((channel, offset))) => self.channels[channel].read(offset),
            _ => Err("DMA or DMAMUX have no such register in this model".into()),
        }
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn write(&mut self, address: u32, value: u32) -> Result<(), String> {
        let offset = (address & 0x3FF) as usize;
        match (address & 0x800, Self::at(address)) {
            (0, Some((channel, offset))) => self.channels[channel].write(offset, value).map(|_| ()),
            (0x800, _) if offset / 4 < 2 => {
                self.requests[offset / 4] = value;
                Ok(())
            }
            _ => Err("DMA or DMAMUX have no such register in this model".into()),
        }
    }
}

impl Default for Dma {
    fn default() -> Self {
        Self::new()
    }
}
