//! TIM2, TIM4 and TIM5 in encoder mode: the count is the machine's, and a trigger captures it (RM0440 30).

use super::registers::Registers;

const CR1: u32 = 0x00;
const SMCR: u32 = 0x08;
const CCMR1: u32 = 0x18;
const CCMR2: u32 = 0x1C;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const ARR: u32 = 0x2C;
const CCR3: u32 = 0x3C;
const ECR: u32 = 0x58;

/// The value of `TS` that selects internal trigger `input`: 0 to 3 are coded as they are, 4 and above from 8 on.
#[must_use]
pub fn trigger_code(input: u32) -> u32 {
    if input < 4 { input } else { input + 4 }
}

/// An encoder's timer.
pub struct EncoderTimer {
    registers: Registers,
    count: u32,
}

impl EncoderTimer {
    /// A timer after reset.
    #[must_use]
    pub fn new(name: &'static str, reload: u32) -> Self {
        let registers = Registers::new(
            name,
            &[
                ("CR1", CR1, 0),
                ("SMCR", SMCR, 0),
                ("CCMR1", CCMR1, 0),
                ("CCMR2", CCMR2, 0),
                ("CCER", CCER, 0),
                ("ARR", ARR, reload),
                ("CCR3", CCR3, 0),
                ("ECR", ECR, 0),
            ],
        );
        Self {
            registers,
            count: 0,
        }
    }

    /// It counts both edges of both inputs, directly.
    fn counts(&self) -> bool {
        const ENCODER_MODE_3: u32 = 3;
        let inputs = self.registers.get("CCMR1") & 0x0303 == 0x0101;
        self.registers.get("CR1") & 1 == 1
            && self.registers.get("SMCR") & 7 == ENCODER_MODE_3
            && inputs
    }

    /// The encoder stands at `count`.
    pub fn set_count(&mut self, count: u32) {
        if self.counts() {
            self.count = match self.registers.get("ARR") {
                u32::MAX => count,
                top => count % (top + 1),
            };
        }
    }

    /// A rising edge of the trigger that `TS` codes as `code`: channel 3 captures, if it is set to.
    pub fn trigger(&mut self, code: u32) {
        let smcr = self.registers.get("SMCR");
        let selected = (smcr >> 4 & 7) | (smcr >> 20 & 3) << 3;
        let on_trigger = self.registers.get("CCMR2") & 3 == 3;
        let enabled = self.registers.get("CCER") >> 8 & 1 == 1;
        if selected == code && on_trigger && enabled {
            self.registers.set("CCR3", self.count);
        }
    }

    /// Reads a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn read(&self, offset: u32) -> Result<u32, String> {
        match offset {
            CNT => Ok(self.count),
            _ => self.registers.read(offset),
        }
    }

    /// Writes a register.
    ///
    /// # Errors
    /// The model does not have it.
    pub fn write(&mut self, offset: u32, value: u32) -> Result<(), String> {
        self.registers.write(offset, value).map(|_| ())
    }
}
