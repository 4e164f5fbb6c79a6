//! What stops a bridge in hardware, with no code in the way: the gate driver's fault output on the timer's break pin, the
//! comparators on the shunts behind it, and the chip's own faults.
//!
//! Which of them sees what depends on where the current is measured:
//!
//! | fault | driver (measures its switches' voltage) | comparator, low-side shunt | comparator, in-line sensor |
//! | --- | --- | --- | --- |
//! | phase to phase | yes | while a low side conducts it | yes |
//! | phase to earth or to minus | yes (high side) | no: it flows past the shunt | yes |
//! | phase to plus | yes (low side) | yes | yes |
//! | shoot-through | yes | yes, as a negative phase current | no: it does not leave the bridge |
//!
//! A comparator sees one sign of its phase's current. The three sum to zero, so a current vector of length `i` (phase
//! amplitude) has a phase of at least `i / 2` of either sign whatever its angle, if all three are watched.
//!
//! The comparators' pins are the ADC's too, whose sampling capacitor makes a dip when it connects, and the bridge's edges
//! ring: the break filter (`TIMx_BDTR.BKF`) waits until both are over (AN4232 3.4 blanks instead).

use crate::hw::outputs::Level;
use stm32g4xx_hal::stm32::{COMP, DAC3, DAC4, DBGMCU, SYSCFG, dac1};

/// The comparators of a motor's shunts, and what they compare with.
#[derive(Clone, Copy)]
pub(crate) struct OverCurrent {
    /// Their numbers, 1 to 7, one for each shunt that has one; their non-inverting input is the pin of input 0.
    pub(crate) comparators: &'static [usize],
    /// Threshold, 12-bit counts as the ADC would read the comparator's pin.
    pub(crate) threshold: u16,
    /// They trip when the pin is below the threshold, instead of above.
    pub(crate) below: bool,
}

impl OverCurrent {
    /// Comparators that trip where their pin reads `threshold`, away from the `zero` that it reads without current.
    pub(crate) const fn past(comparators: &'static [usize], threshold: f64, zero: f64) -> Self {
        assert!(
            threshold >= 1.0 && threshold <= 4094.0,
            "the over-current threshold is beyond the comparators' DAC"
        );
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        Self {
            comparators,
            threshold: (threshold + 0.5) as u16,
            below: threshold < zero,
        }
    }
}

/// The gate drivers' fault output on the timers' break pins.
#[derive(Clone, Copy)]
pub(crate) struct DriverFault {
    /// The level that says that there is a fault: most drivers pull the line low.
    pub(crate) level: Level,
}

/// `TIMx_AF1`: break by these comparators and, if the board has it, by the driver's fault (RM0440 29.6.26). The break itself
/// is active high (BDTR.BKP), the comparators' outputs are; BKINP turns a pin that is active low.
pub(crate) const fn break_sources(comparators: &OverCurrent, driver: Option<DriverFault>) -> u32 {
    const BKINE: u32 = 1;
    const BKINP: u32 = 1 << 9;
    let (mut sources, mut index) = (0, 0);
    while index < comparators.comparators.len() {
        sources |= 1 << comparators.comparators[index];
        index += 1;
    }
    match driver {
        None => sources,
        Some(DriverFault { level: Level::High }) => sources | BKINE,
        Some(DriverFault { level: Level::Low }) => sources | BKINE | BKINP,
    }
}

/// Puts the thresholds on the DACs and enables the comparators, locked. DAC3 and DAC4 serve both motors, so their
/// thresholds are alike.
pub(crate) fn start(comparators: &COMP, (dac3, dac4): (&DAC3, &DAC4), motors: &[OverCurrent; 2]) {
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
    // The output is high below the threshold instead of above it (POLARITY).
    const INVERTED: u32 = 1 << 15;
    for motor in motors {
        let polarity = if motor.below { INVERTED } else { 0 };
        for number in motor.comparators {
            let csr = comparators.ccsr(number - 1);
            let word = ENABLE | INVERTING_DAC | polarity | HYSTERESIS_20_MV | LOCK;
            // SAFETY: values of the fields (RM0440, COMP_CxCSR).
            csr.write(|w| unsafe { w.bits(word) });
        }
    }
}

/// A core that no longer runs, or runs on wrong data or a failing supply, controls nothing.
///
/// Halted by a debugger, it stops both bridges' timers, whose outputs go idle (RM0440 29.3.30, DBGMCU_APB2FZR), and the
/// watchdog, which would end the session; the timer that waits for the current loops runs on, so that the bridges stay
/// off when the core goes on: for the under 1 us that TIM7's handler then takes the outputs may follow the compare values
/// that stood before.
///
/// Locked up, or with a wrong bit in flash or RAM, or with a supply that sags, it breaks both timers (RM0440
/// SYSCFG_CFGR2: CLL, ECCL, SPL, PVDL), with no filter between (RM0440 29.3.16, system break).
pub(crate) fn core_stopped_opens_bridges(debug: &DBGMCU, system: &SYSCFG) {
    debug
        .apb2_fz()
        .write(|w| w.dbg_tim1_stop().set_bit().dbg_tim8_stop().set_bit());
    debug.apb1l_fz().write(|w| w.dbg_iwdg_stop().set_bit());
    system.cfgr2().write(|w| {
        w.cll()
            .set_bit()
            .spl()
            .set_bit()
            .pvdl()
            .set_bit()
            .eccl()
            .set_bit()
    });
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
