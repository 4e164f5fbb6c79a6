//! The two bridges' timers: TIM1 turns the screw, TIM8 the nut.
//!
//! Both count up and down; a phase's high side is on while the counter is below its compare value. At the top all low
//! sides are on: there the ADC samples (through TRGO2) and the compare values written since the last top take effect.
//! The nut's timer starts half a period behind the screw's, so that the two interrupts interleave. Either motor is sampled
//! while the other's timer is at its bottom, the middle of that bridge's high-side pulses: with the fraction `m` of the full
//! voltage in use the nearest edge is about `(1 - m) / 4` of a period away, 1.2 us at 20 kHz and 0.9. From 92 to 94 % on (83 % at
//! 40 kHz; `tests/tests/chip/settling.rs`) the edges of one motor are in the samples of the other, which no timing avoids; a quarter
//! period of offset would put them there at rest.

use crate::hw::encoder::FILTER_LENGTHS;
use control::plate::DrivePlate;
use stm32g4xx_hal::stm32::{TIM1, TIM8, tim1};

/// `BDTR.BKF` for a filter that waits `seconds` or a little longer. Fails to compile, in a constant, outside 0.3 to 1.5 us:
/// what is shorter takes ringing for a fault, what is longer leaves a shorted switch alone for longer than it bears (10 us
/// for IGBTs, 2 to 3 us for MOSFETs).
const fn break_filter(seconds: f64, timer_hz: f64) -> u32 {
    assert!(
        seconds >= 0.3e-6 && seconds <= 1.5e-6,
        "a break filter is 0.3 to 1.5 us long"
    );
    let mut index = 0;
    while (FILTER_LENGTHS[index] as f64) < seconds * timer_hz {
        index += 1;
    }
    index as u32 + 1
}

/// How both bridges are switched.
#[derive(Clone, Copy)]
pub(crate) struct PwmPlan {
    /// The counter's top: half a PWM period, timer counts.
    pub(crate) period: u16,
    /// Dead time, timer counts.
    pub(crate) dead_time_counts: u32,
    /// Filter of the break input, `BDTR.BKF`. It needs the timer's clock (RM0440 29.3.16), which the clock security system keeps going.
    pub(crate) break_filter: u32,
}

impl PwmPlan {
    /// The plan of a board. Fails to compile, in a constant, if the dead time is beyond the generator's reach.
    pub(crate) const fn new(plate: &DrivePlate, break_filter_s: f64) -> Self {
        let board = &plate.board;
        let counts = plate.bridge.dead_time_s * board.timer_hz;
        assert!(
            counts >= 0.0 && counts <= 1008.0,
            "the dead-time generator reaches 1008 timer counts"
        );
        // Rounded up: a dead time may be longer than asked, never shorter.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let dead_time_counts = (counts + 0.999_999) as u32;
        Self {
            period: board.period(),
            dead_time_counts,
            break_filter: break_filter(break_filter_s, board.timer_hz),
        }
    }
}

/// `TIMx_BDTR` of a timer without its main output enable: dead time, safe idle state, break and lock.
pub(crate) const fn bdtr(plan: &PwmPlan) -> u32 {
    const LOCK_LEVEL_3: u32 = 0b11 << 8;
    // Off-state: with the outputs disabled the pins are driven to their idle level (low: both switches open).
    const OSSI: u32 = 1 << 10;
    const OSSR: u32 = 1 << 11;
    const BREAK_ENABLE: u32 = 1 << 12;
    const BREAK_ACTIVE_HIGH: u32 = 1 << 13;
    dead_time_code(plan.dead_time_counts)
        | LOCK_LEVEL_3
        | OSSI
        | OSSR
        | BREAK_ENABLE
        | BREAK_ACTIVE_HIGH
        | plan.break_filter << 16
}

/// Main output enable.
pub(crate) const MOE: u32 = 1 << 15;

/// The chip itself has broken the timers since their flags were cleared (RM0440 29.6.5, TIM_SR.SBIF).
pub(crate) fn controller_broke() -> bool {
    const SBIF: u32 = 1 << 13;
    // SAFETY: a register is read, which changes nothing.
    let timer = unsafe { &*TIM1::ptr() };
    timer.sr().read().bits() & SBIF != 0
}

/// `BDTR.DTG` for a dead time of at most 1008 timer counts, rounded up (RM0440, TIMx_BDTR.DTG).
const fn dead_time_code(counts: u32) -> u32 {
    match counts {
        0..=127 => counts,
        128..=254 => 0x80 | (counts.div_ceil(2) - 64),
        255..=504 => 0xC0 | (counts.div_ceil(8) - 32),
        _ => 0xE0 | (counts.div_ceil(16) - 32),
    }
}

/// Sets both timers up with their outputs off and lets them run half a period apart. `false` if a timer's update
/// could not be put on the counter's top: the timers' clock is then not what it should be.
pub(crate) fn start(screw: &TIM1, nut: &TIM8, plan: &PwmPlan, breaks: [u32; 2]) -> bool {
    configure(screw, plan, breaks[0]);
    configure(nut, plan, breaks[1]);

    // The screw's counter starts one count below its top and the nut's at its bottom: tops half a period apart.
    // SAFETY: the counter takes any 16-bit value.
    screw
        .cnt()
        .write(|w| unsafe { w.bits(u32::from(plan.period) - 1) });
    // The nut's timer starts with the screw's: trigger mode (6) on ITR0, which is TIM1's TRGO = counter enable (1).
    // SAFETY: both are values of the field (RM0440, TIMx_SMCR.SMS and TIMx_CR2.MMS).
    nut.smcr()
        .write(|w| unsafe { w.sms().bits(6).ts().bits(0) });
    screw.cr1().modify(|_, w| w.cen().set_bit());

    // The nut's first: the call ends at the screw counter's bottom, so that the next top is the screw's, in half a
    // period, and all that follows has that long before the first sample.
    let aligned = align_update_to_top(nut) && align_update_to_top(screw);
    capture_encoder_at_top(screw);
    capture_encoder_at_top(nut);
    aligned
}

/// TRGO becomes the update, which the encoder's timer captures its count on; TRGO2 stays the update for the ADCs.
fn capture_encoder_at_top(timer: &tim1::RegisterBlock) {
    // SAFETY: values of the fields (RM0440, TIMx_CR2): MMS 2, MMS2 2.
    timer.cr2().write(|w| unsafe { w.bits(2 << 4 | 2 << 20) });
}

fn configure(timer: &tim1::RegisterBlock, plan: &PwmPlan, break_sources: u32) {
    // Center-aligned mode 1, reload preloaded.
    timer
        .cr1()
        .write(|w| w.cms().center_aligned1().arpe().enabled());
    // TRGO = counter enable (MMS 1), TRGO2 = update (MMS2 2); idle level of all outputs low (OISx 0).
    // SAFETY: values of the fields (RM0440, TIMx_CR2).
    timer.cr2().write(|w| unsafe { w.bits(1 << 4 | 2 << 20) });
    // SAFETY: any 16-bit value.
    timer
        .arr()
        .write(|w| unsafe { w.bits(u32::from(plan.period)) });
    // PWM mode 1 (6) with preload on channels 1 to 3.
    // SAFETY: values of the fields (RM0440, TIMx_CCMR1 and 2).
    timer.ccmr1_output().write(|w| unsafe { w.bits(0x6868) });
    // SAFETY: as above.
    timer.ccmr2_output().write(|w| unsafe { w.bits(0x0068) });
    // CCxE and CCxNE of channels 1 to 3, all active high.
    // SAFETY: values of the fields (RM0440, TIMx_CCER).
    timer.ccer().write(|w| unsafe { w.bits(0x0555) });
    // SAFETY: the caller's break sources are bits of TIMx_AF1; `bdtr` composes valid fields.
    timer.af1().write(|w| unsafe { w.bits(break_sources) });
    // SAFETY: as above. This also locks what it and the lines above have set, until the next reset.
    timer.bdtr().write(|w| unsafe { w.bits(bdtr(plan)) });
    // Takes the preloaded registers over.
    timer.egr().write(|w| w.ug().set_bit());
}

/// Makes the update happen at each top only.
///
/// A repetition counter written before the start gives updates at the bottom by RM0440 29.3.3, at the top by the
/// manuals of other families with this timer. So it is written while the counter is seen to go up: it is loaded at the
/// next top and then counts two turns.
fn align_update_to_top(timer: &tim1::RegisterBlock) -> bool {
    // A turn comes every half period; four of them are more than enough, at a few cycles a look.
    const LOOKS: u32 = 100_000;
    let mut looks = 0;
    timer.sr().write(|w| w.uif().clear_bit());
    while looks < LOOKS {
        looks += 1;
        if timer.sr().read().uif().bit_is_clear() {
            continue;
        }
        timer.sr().write(|w| w.uif().clear_bit());
        if timer.cr1().read().dir().bit_is_clear() {
            // SAFETY: any 16-bit value.
            timer.rcr().write(|w| unsafe { w.bits(1) });
            return true;
        }
    }
    false
}
