//! Over-current stops a bridge in hardware: each shunt's comparator holds the phase against a DAC's threshold and
//! drives its timer's break input. No code is in the way.
//!
//! A comparator sees its phase's positive currents. The three sum to zero, so a current vector of length `i` (phase
//! amplitude) has a positive phase of at least `i / 2` whatever its angle.

use stm32g4xx_hal::stm32::{COMP, DAC3, DAC4, dac1};

/// `TIM1_AF1`: break by comparators 1 to 3 (the screw's shunts), pin input off.
pub(crate) const SCREW_BREAK: u32 = 1 << 1 | 1 << 2 | 1 << 3;
/// `TIM8_AF1`: break by comparators 4, 5 and 7 (the nut's shunts), pin input off.
pub(crate) const NUT_BREAK: u32 = 1 << 4 | 1 << 5 | 1 << 7;

/// Puts the thresholds (12-bit counts, as the ADC would read them) on the DACs and enables the comparators, locked.
pub(crate) fn start(comparators: &COMP, dac3: &DAC3, dac4: &DAC4, threshold_counts: u16) {
    start_dac(dac3, threshold_counts);
    start_dac(dac4, threshold_counts);
    // RM0440 table 199: the inverting input 4 is DAC3 channel 1 (COMP1, COMP3), DAC3 channel 2 (COMP2, COMP4) and
    // DAC4 channel 1 (COMP5, COMP7). Non-inverting input 0: PA1, PA7, PA0; PB0, PB13, PB14.
    const ENABLE: u32 = 1;
    const INVERTING_DAC: u32 = 4 << 4;
    const HYSTERESIS_20_MV: u32 = 2 << 16;
    const LOCK: u32 = 1 << 31;
    for index in [0, 1, 2, 3, 4, 6] {
        let csr = comparators.ccsr(index);
        // SAFETY: values of the fields (RM0440, COMP_CxCSR).
        csr.write(|w| unsafe { w.bits(ENABLE | INVERTING_DAC | HYSTERESIS_20_MV | LOCK) });
    }
}

fn start_dac(dac: &dac1::RegisterBlock, counts: u16) {
    // Both channels internal, without buffer (mode 3); the bus runs above 160 MHz (HFSEL 2, RM0440 22.7.16).
    // SAFETY: values of the fields (RM0440, DAC_MCR).
    dac.mcr()
        .write(|w| unsafe { w.bits(3 | 3 << 16 | 2 << 14) });
    // SAFETY: 12-bit values.
    dac.dhr12rd()
        .write(|w| unsafe { w.bits(u32::from(counts) | u32::from(counts) << 16) });
    dac.cr().write(|w| w.en1().set_bit().en2().set_bit());
}
