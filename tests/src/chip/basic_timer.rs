//! TIM7: counts up, and interrupts when it runs out (RM0440, basic timers).

use super::registers::Registers;

const CR1: u32 = 0x00;
const DIER: u32 = 0x0C;
const SR: u32 = 0x10;
const EGR: u32 = 0x14;
const ARR: u32 = 0x2C;

/// The timer.
pub struct BasicTimer {
    registers: Registers,
    /// When the counter was last at zero.
    zero: u64,
    flag: bool,
    /// When a debugger halted the core, and it with it.
    held: Option<u64>,
}

impl BasicTimer {
    /// After reset.
    #[must_use]
    pub fn new() -> Self {
        Self {
            registers: Registers::new(
                "TIM7",
                &[("CR1", CR1, 0), ("DIER", DIER, 0), ("ARR", ARR, 0xFFFF)],
            ),
            zero: 0,
            flag: false,
            held: None,
        }
    }

    /// It stands from `now` on.
    pub fn hold(&mut self, now: u64) {
        self.held = Some(now);
    }

    /// It goes on.
    pub fn release(&mut self, now: u64) {
        self.zero += self.held.take().map_or(0, |held| now - held);
    }

    /// When it runs out.
    #[must_use]
    pub fn out_at(&self) -> Option<u64> {
        let counts = u64::from(self.registers.get("ARR")) + 1;
        let counting = self.registers.get("CR1") & 1 == 1 && self.held.is_none();
        counting.then_some(self.zero + counts)
    }

    /// It has run out.
    pub fn run_out(&mut self, now: u64) {
        self.zero = now;
        self.flag = true;
    }

    /// The interrupt line.
    #[must_use]
    pub fn interrupt(&self) -> bool {
        self.flag && self.registers.get("DIER") & 1 == 1
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
        match offset {
            SR => Ok(self.flag.into()),
            _ => self.registers.read(offset),
        }
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The model does not have it, or it is not used as the model has it.
    pub fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), String> {
        const URS: u32 = 1 << 2;
        match offset {
            SR => self.flag &= value & 1 == 1,
            EGR if value == 1 && self.registers.get("CR1") & URS != 0 => self.zero = now,
            EGR => {
                return Err(
                    "of the events, this model generates the update without flag only".into(),
                );
            }
            CR1 => {
                let old = self.registers.get("CR1");
                if value & !old & 1 == 1 {
                    self.zero = now;
                }
                self.registers.write(offset, value)?;
            }
            _ => {
                self.registers.write(offset, value)?;
            }
        }
        Ok(())
    }
}

impl Default for BasicTimer {
    fn default() -> Self {
        Self::new()
    }
}
