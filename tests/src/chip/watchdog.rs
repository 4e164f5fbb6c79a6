//! The independent watchdog (RM0440 42), on the LSI.

use super::CORE_HZ;

/// IWDG.
pub struct Watchdog {
    prescaler: u32,
    reload: u32,
    unlocked: bool,
    running: bool,
    fed: u64,
    /// When a debugger halted the core, and it with it.
    held: Option<u64>,
}

impl Watchdog {
    /// Off.
    #[must_use]
    pub fn new() -> Self {
        Self {
            prescaler: 0,
            reload: 0xFFF,
            unlocked: false,
            running: false,
            fed: 0,
            held: None,
        }
    }

    /// It stands from `now` on.
    pub fn hold(&mut self, now: u64) {
        self.held = Some(now);
    }

    /// It goes on.
    pub fn release(&mut self, now: u64) {
        self.fed += self.held.take().map_or(0, |held| now - held);
    }

    /// When it resets the chip unless it is fed, where the LSI has `lsi_hz`.
    #[must_use]
    pub fn bites_at(&self, lsi_hz: f64) -> Option<u64> {
        let ticks = (u64::from(self.reload) + 1) * (4 << self.prescaler.min(6));
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let cycles = (ticks as f64 * CORE_HZ as f64 / lsi_hz) as u64;
        (self.running && self.held.is_none()).then_some(self.fed + cycles)
    }

    /// It has bitten.
    pub fn stop(&mut self) {
        self.running = false;
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn read(&self, offset: u32) -> Result<u32, String> {
        match offset {
            0x04 => Ok(self.prescaler),
            0x08 => Ok(self.reload),
            // No update is ever under way.
            0x0C => Ok(0),
            _ => Err(format!("IWDG has no register at {offset:#x} in this model")),
        }
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The model does not have it, or it is locked.
    pub fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), String> {
        match (offset, value) {
            (0x00, 0xCCCC) => {
                self.running = true;
                self.fed = now;
            }
            (0x00, 0x5555) => self.unlocked = true,
            (0x00, 0xAAAA) => {
                self.unlocked = false;
                self.fed = now;
            }
            (0x00, _) => self.unlocked = false,
            (0x04 | 0x08, _) if !self.unlocked => return Err("IWDG is locked".into()),
            (0x04, _) => self.prescaler = value & 7,
            (0x08, _) => {
                self.reload = value & 0xFFF;
                self.fed = now;
            }
            (0x10, window) if window & 0xFFF < self.reload => {
                return Err("this model has no window".into());
            }
            (0x10, _) => {}
            _ => return Err(format!("IWDG has no register at {offset:#x} in this model")),
        }
        Ok(())
    }
}

impl Default for Watchdog {
    fn default() -> Self {
        Self::new()
    }
}
