//! Which clock each peripheral needs (RM0440 7.4, the enable registers): without it an access is lost.

/// A peripheral: the start of its registers, its name, and where its clock is enabled: offset in RCC, bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gated {
    /// Where its registers start.
    pub start: u32,
    /// As the manual calls it.
    pub name: &'static str,
    /// Offset of the enable register in RCC.
    pub register: u32,
    /// Its bit.
    pub bit: u32,
}

const fn gated(start: u32, name: &'static str, register: u32, bit: u32) -> Gated {
    Gated {
        start,
        name,
        register,
        bit,
    }
}

/// Offsets in RCC.
const AHB1ENR: u32 = 0x48;
const AHB2ENR: u32 = 0x4C;
const APB1ENR1: u32 = 0x58;
const APB1ENR2: u32 = 0x5C;
const APB2ENR: u32 = 0x60;

/// All that the model has, by kilobytes of address.
pub const GATED: [Gated; 26] = [
    gated(0x4000_0000, "TIM2", APB1ENR1, 0),
    gated(0x4000_0800, "TIM4", APB1ENR1, 2),
    gated(0x4000_0C00, "TIM5", APB1ENR1, 3),
    gated(0x4000_1400, "TIM7", APB1ENR1, 5),
    gated(0x4000_7000, "PWR", APB1ENR1, 28),
    gated(0x4000_8000, "LPUART1", APB1ENR2, 0),
    // With COMP and OPAMP, which have no clock of their own.
    gated(0x4001_0000, "SYSCFG", APB2ENR, 0),
    gated(0x4001_2C00, "TIM1", APB2ENR, 11),
    gated(0x4001_3000, "SPI1", APB2ENR, 12),
    gated(0x4001_3400, "TIM8", APB2ENR, 13),
    gated(0x4001_4400, "TIM16", APB2ENR, 17),
    gated(0x4002_0000, "DMA1", AHB1ENR, 0),
    gated(0x4002_0800, "DMAMUX1", AHB1ENR, 2),
    gated(0x4002_2000, "FLASH", AHB1ENR, 8),
    gated(0x4800_0000, "GPIOA", AHB2ENR, 0),
    gated(0x4800_0400, "GPIOB", AHB2ENR, 1),
    gated(0x4800_0800, "GPIOC", AHB2ENR, 2),
    gated(0x4800_0C00, "GPIOD", AHB2ENR, 3),
    gated(0x4800_1000, "GPIOE", AHB2ENR, 4),
    gated(0x4800_1400, "GPIOF", AHB2ENR, 5),
    gated(0x5000_0000, "ADC1", AHB2ENR, 13),
    gated(0x5000_0100, "ADC2", AHB2ENR, 13),
    gated(0x5000_0400, "ADC3", AHB2ENR, 14),
    gated(0x5000_0500, "ADC4", AHB2ENR, 14),
    gated(0x5000_1000, "DAC3", AHB2ENR, 18),
    gated(0x5000_1400, "DAC4", AHB2ENR, 19),
];

/// The peripheral at `address`, if it needs a clock.
#[must_use]
pub fn at(address: u32) -> Option<&'static Gated> {
    // The ADCs of a pair share a kilobyte, and the enable bit.
    GATED.iter().find(|gated| gated.start == address & !0x3FF)
}
