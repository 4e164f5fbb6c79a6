//! Over-current stops a bridge in hardware: each shunt's comparator holds the phase against a DAC's threshold and
//! drives its timer's break input. No code is in the way.
//!
//! A comparator sees its phase's positive currents. The three sum to zero, so a current vector of length `i` (phase
//! amplitude) has a positive phase of at least `i / 2` whatever its angle.

use stm32g4xx_hal::stm32::{COMP, DAC3, DAC4, dac1};

/// The comparators of a motor's shunts, and what they compare with.
#[derive(Clone, Copy)]
pub(crate) struct OverCurrent {
    /// Their numbers, 1 to 7, one for each shunt that has one; their non-inverting input is the pin of input 0.
    pub(crate) comparators: &'static [usize],
    /// Threshold, 12-bit counts as the ADC would read the comparator's pin.
    pub(crate) threshold: u16,
}

impl OverCurrent {
    /// `TIMx_AF1`: break by these comparators, pin input off.
    pub(crate) const fn break_sources(&self) -> u32 {
        let (mut sources, mut index) = (0, 0);
        while index < self.comparators.len() {
            sources |= 1 << self.comparators[index];
            index += 1;
        }
        sources
    }
}

/// Puts the thresholds on the DACs and enables the comparators, locked. DAC3 and DAC4 serve both motors, so their
/// thresholds are alike.
pub(crate) fn start(comparators: &COMP, dac3: &DAC3, dac4: &DAC4, motors: &[OverCurrent; 2]) {
    let [screw, nut] = motors;
    assert!(screw.threshold == nut.threshold);
    start_dac(dac3, screw.threshold);
    start_dac(dac4, screw.threshold);
    // RM0440 table 199: the inverting input 4 is DAC3 channel 1 (COMP1, COMP3), DAC3 channel 2 (COMP2, COMP4) and
    // DAC4 channel 1 (COMP5, COMP7), DAC4 channel 2 (COMP6).
    const ENABLE: u32 = 1;
    const INVERTING_DAC: u32 = 4 << 4;
    const HYSTERESIS_20_MV: u32 = 2 << 16;
    const LOCK: u32 = 1 << 31;
    for number in screw.comparators.iter().chain(nut.comparators) {
        let csr = comparators.ccsr(number - 1);
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
