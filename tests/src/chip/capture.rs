//! TIM16 as an input capture of a clock inside the chip (RM0440 31.4.5; TI1SEL: MCO is 2, LSI is 6).

use super::CORE_HZ;
use super::registers::Registers;

const CR1: u32 = 0x00;
const SR: u32 = 0x10;
const CCMR1: u32 = 0x18;
const CCER: u32 = 0x20;
const ARR: u32 = 0x2C;
const CCR1: u32 = 0x34;
const TISEL: u32 = 0x5C;

/// The timer. It captures by arithmetic: a capture is there once its time has come.
pub struct CaptureTimer {
    registers: Registers,
    /// When the counter started, and captures that were read.
    started: Option<(u64, u64)>,
}

/// The clocks that it can be given, Hz, and the core's true one.
#[derive(Clone, Copy, Debug, Default)]
pub struct Clocks {
    /// MCO, while it is on.
    pub mco: Option<f64>,
    /// LSI, while it is on.
    pub lsi: Option<f64>,
    /// What the core's clock is, for the crystal may be another one.
    pub core: f64,
}

impl CaptureTimer {
    /// After reset.
    #[must_use]
    pub fn new() -> Self {
        Self {
            registers: Registers::new(
                "TIM16",
                &[
                    ("CR1", CR1, 0),
                    ("CCMR1", CCMR1, 0),
                    ("CCER", CCER, 0),
                    ("ARR", ARR, 0xFFFF),
                    ("TISEL", TISEL, 0),
                ],
            ),
            started: None,
        }
    }

    /// Core cycles from one capture to the next.
    fn interval(&self, clocks: Clocks) -> Option<f64> {
        const EVERY_EIGHTH_OF_TI1: u32 = 1 | 3 << 2;
        let set_up = self.registers.get("CCMR1") & 0xFF == EVERY_EIGHTH_OF_TI1
            && self.registers.get("CCER") & 1 == 1;
        let input = match self.registers.get("TISEL") & 15 {
            2 => clocks.mco,
            6 => clocks.lsi,
            _ => None,
        };
        input
            .filter(|_| set_up)
            .map(|hertz| 8.0 * clocks.core / hertz)
    }

    /// Reads a register at a time.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn read(&mut self, offset: u32, now: u64, clocks: Clocks) -> Result<u32, String> {
        let due = self.started.zip(self.interval(clocks));
        // The time of the next capture that was not read, in cycles since the start.
        let next = due.map(|((start, taken), interval)| {
            let at = (taken + 1) as f64 * interval;
            (at, at <= (now - start) as f64)
        });
        Ok(match (offset, next) {
            (SR, Some((_, true))) => 1 << 1,
            (SR, _) => 0,
            (CCR1, Some((at, true))) => {
                if let Some((_, taken)) = &mut self.started {
                    *taken += 1;
                }
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                let count = at as u64 as u32;
                count & 0xFFFF
            }
            (CCR1, _) => 0,
            _ => self.registers.read(offset)?,
        })
    }

    /// Writes a register at a time.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), String> {
        match offset {
            SR => Ok(()),
            CR1 => {
                self.started = (value & 1 == 1).then_some((now, 0));
                self.registers.write(offset, value).map(|_| ())
            }
            _ => self.registers.write(offset, value).map(|_| ()),
        }
    }
}

impl Default for CaptureTimer {
    fn default() -> Self {
        Self::new()
    }
}

/// The core's clock with a crystal of `crystal` where the firmware counts on 24 MHz.
#[must_use]
pub fn core_hz(crystal: f64) -> f64 {
    CORE_HZ as f64 * crystal / 24e6
}
