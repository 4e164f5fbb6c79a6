//! DAC3 and DAC4 as thresholds, and the comparators that drive the break inputs (RM0440 22 and 24).

use super::registers::Registers;
use super::wiring::Wiring;

/// A DAC with two internal outputs.
pub struct Dac {
    registers: Registers,
}

const DHR12RD: u32 = 0x20;

impl Dac {
    /// A DAC after reset.
    #[must_use]
    pub fn new(name: &'static str) -> Self {
        Self {
            registers: Registers::new(
                name,
                &[("CR", 0x00, 0), ("DHR12RD", DHR12RD, 0), ("MCR", 0x3C, 0)],
            ),
        }
    }

    /// Output of channel 1 or 2, 12-bit counts; `None` while it is off or not connected inside the chip.
    #[must_use]
    pub fn output(&self, channel: u32) -> Option<u16> {
        let shift = 16 * (channel - 1);
        let enabled = self.registers.get("CR") >> shift & 1 == 1;
        const INTERNAL: u32 = 3;
        let internal = self.registers.get("MCR") >> shift & 7 == INTERNAL;
        #[allow(clippy::cast_possible_truncation)]
        (enabled && internal).then_some((self.registers.get("DHR12RD") >> shift & 0xFFF) as u16)
    }

    /// Its plain registers.
    #[must_use]
    pub fn registers(&self) -> &Registers {
        &self.registers
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn read(&self, offset: u32) -> Result<u32, String> {
        self.registers.read(offset)
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn write(&mut self, offset: u32, value: u32) -> Result<(), String> {
        self.registers.write(offset, value).map(|_| ())
    }
}

/// COMP1 to COMP7.
pub struct Comparators {
    control: [u32; 7],
    /// Those (bit n is COMPn) whose output stays low.
    pub dead: u32,
}

const LOCK: u32 = 1 << 31;

impl Comparators {
    /// All off.
    #[must_use]
    pub fn new() -> Self {
        Self {
            control: [0; 7],
            dead: 0,
        }
    }

    /// Outputs (bit n is COMPn) of the comparators of motor `index` for its phase currents in ADC counts.
    /// `thresholds`: DAC3 channel 1, DAC3 channel 2, DAC4 channel 1.
    #[must_use]
    pub fn outputs(
        &self,
        wiring: Wiring,
        index: usize,
        currents: [u16; 3],
        thresholds: [Option<u16>; 3],
    ) -> u32 {
        // The DAC at each comparator's inverting input 4 (RM0440 table 199); COMP6 is not used.
        let dacs = [0, 1, 0, 1, 2, 3, 2];
        let mut outputs = 0;
        for &(number, phase) in wiring.comparators(index) {
            let current = currents[phase];
            let control = self.control[number - 1];
            if self.dead >> number & 1 == 1 {
                continue;
            }
            let from_dac = control >> 4 & 7 == 4 && control >> 8 & 1 == 0;
            const INVERTED: u32 = 1 << 15;
            let above = thresholds[dacs[number - 1]].map(|threshold| current > threshold);
            let high = above.map(|above| above != (control & INVERTED != 0));
            if control & 1 == 1 && from_dac && high == Some(true) {
                outputs |= 1 << number;
            }
        }
        outputs
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn read(&self, offset: u32) -> Result<u32, String> {
        self.control
            .get((offset / 4) as usize)
            .copied()
            .ok_or_else(|| format!("COMP has no register at {offset:#x}"))
    }

    /// Writes a register; a locked one holds.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn write(&mut self, offset: u32, value: u32) -> Result<(), String> {
        let control = self
            .control
            .get_mut((offset / 4) as usize)
            .ok_or_else(|| format!("COMP has no register at {offset:#x}"))?;
        if *control & LOCK == 0 {
            *control = value;
        }
        Ok(())
    }
}

impl Default for Comparators {
    fn default() -> Self {
        Self::new()
    }
}
