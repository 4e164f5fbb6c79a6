//! OPAMP1 to OPAMP6 as programmable-gain amplifiers into the ADCs (RM0440, OPAMP).

use super::wiring::Wiring;

/// All six.
pub struct Amplifiers {
    control: [u32; 6],
}

const LOCK: u32 = 1 << 31;

impl Amplifiers {
    /// All off.
    #[must_use]
    pub fn new() -> Self {
        Self { control: [0; 6] }
    }

    /// Amplifier `number` takes the board's pin to the ADC with the board's gain of four, in high-speed mode.
    #[must_use]
    pub fn works(&self, wiring: Wiring, number: usize) -> bool {
        let Some((_, input)) = wiring
            .amplifiers()
            .iter()
            .find(|(wired, _)| *wired == number)
        else {
            return false;
        };
        const GAIN_4: u32 = 1 << 14;
        let expected = 1 | input << 2 | 2 << 5 | 1 << 7 | 1 << 8 | GAIN_4;
        self.control[number - 1] & !LOCK == expected
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn read(&self, offset: u32) -> Result<u32, String> {
        self.control
            .get((offset / 4) as usize)
            .copied()
            .ok_or_else(|| format!("OPAMP has no register at {offset:#x} in this model"))
    }

    /// Writes a register; a locked one holds.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn write(&mut self, offset: u32, value: u32) -> Result<(), String> {
        let control = self
            .control
            .get_mut((offset / 4) as usize)
            .ok_or_else(|| format!("OPAMP has no register at {offset:#x} in this model"))?;
        if *control & LOCK == 0 {
            *control = value;
        }
        Ok(())
    }
}

impl Default for Amplifiers {
    fn default() -> Self {
        Self::new()
    }
}
