//! On-chip operational amplifiers as current amplifiers: programmable gain from a shunt's pin to an ADC, inside the
//! chip.

use stm32g4xx_hal::stm32::OPAMP;

/// One of them.
#[derive(Clone, Copy)]
pub(crate) struct Amplifier {
    /// Its number, 1 to 6.
    pub(crate) number: usize,
    /// Code of its non-inverting input (`VP_SEL`).
    pub(crate) input: u8,
}

/// Gains, with the code of `PGA_GAIN`.
#[derive(Clone, Copy)]
#[repr(u32)]
#[allow(dead_code, reason = "a board picks one")]
pub(crate) enum Gain {
    X2 = 0,
    X4 = 1,
    X8 = 2,
    X16 = 3,
    X32 = 4,
    X64 = 5,
}

impl Gain {
    /// How often its input the output is.
    #[allow(dead_code, reason = "not every board has amplifiers")]
    pub(crate) const fn times(self) -> f64 {
        (2u32 << self as u32) as f64
    }
}

/// Lets them amplify, locked.
pub(crate) fn start(opamps: &OPAMP, amplifiers: [Option<Amplifier>; 4], gain: Gain) {
    const ENABLE: u32 = 1;
    // The gain's resistors are the inverting input.
    const PROGRAMMABLE: u32 = 2 << 5;
    // 45 V/us instead of 6.5 (typical, datasheet): it has to follow the bridge's edges before the sample.
    const HIGH_SPEED: u32 = 1 << 7;
    const TO_ADC: u32 = 1 << 8;
    const LOCK: u32 = 1 << 31;
    for amplifier in amplifiers.into_iter().flatten() {
        let csr = ENABLE
            | u32::from(amplifier.input) << 2
            | PROGRAMMABLE
            | HIGH_SPEED
            | TO_ADC
            | (gain as u32) << 14;
        // OPAMP1_CSR to OPAMP6_CSR follow each other (RM0440, OPAMP registers).
        let register = opamps
            .opamp1_csr()
            .as_ptr()
            .wrapping_add(amplifier.number - 1);
        // SAFETY: a register of the block, in values of its fields; the lock goes in last.
        unsafe {
            register.write_volatile(csr);
            register.write_volatile(csr | LOCK);
        }
    }
}
