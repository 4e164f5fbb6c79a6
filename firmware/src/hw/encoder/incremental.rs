//! Incremental encoders on timers in encoder mode.
//!
//! The timer's reload is the count of a turn, so that the counter is the angle, modulo the turn, without code. The
//! index, where the board has its pin, puts the counter to zero in hardware (RM0440 30.4.17). At each top of the
//! motor's PWM the count is captured in hardware: angle and currents belong to the same instant, however late the
//! interrupt reads them.

use super::{Encoder, InputFilter, TopOf};
use control::encoder::Interface;
use control::plate::EncoderPlate;
use core::ops::Deref;
use stm32g4xx_hal::stm32::tim2;

/// An encoder on timer `T`; `INDEX`: the timer has the index's pin.
pub(crate) struct Incremental<T, const INDEX: bool>(T);

impl<T: Deref<Target = tim2::RegisterBlock>, const INDEX: bool> Incremental<T, INDEX> {
    /// Counts both edges of both channels modulo the turn, and captures the count in channel 3.
    pub(crate) fn start(timer: T, plate: &EncoderPlate, filter: InputFilter, top: TopOf) -> Self {
        // SAFETY: every value of this 32-bit register is valid.
        timer
            .arr()
            .write(|w| unsafe { w.bits(plate.counts_per_turn.saturating_sub(1)) });
        // SAFETY: values of the fields (RM0440, TIMx_CCMR1).
        timer
            .ccmr1_input()
            .write(|w| unsafe { w.bits(filter.both_channels()) });
        // Channel 3 captures (CC3E) on the internal trigger (CC3S 3).
        timer.ccmr2_input().write(|w| w.cc3s().trc());
        timer.ccer().write(|w| w.cc3e().set_bit());
        if INDEX {
            // IPOS 0: the index is at both channels low; it acts in both directions (IDIR 0), each time (FIDX 0).
            timer.ecr().write(|w| w.ie().set_bit());
        }
        // SAFETY: 3 is encoder mode 3, the rest values of TS and, for the index, ETF (RM0440, TIMx_SMCR).
        timer
            .smcr()
            .write(|w| unsafe { w.bits(3 | top as u32 | filter.0 << 8) });
        timer.cr1().write(|w| w.cen().set_bit());
        Self(timer)
    }
}

impl<T: Deref<Target = tim2::RegisterBlock>, const INDEX: bool> Encoder for Incremental<T, INDEX> {
    const INTERFACE: Interface = if INDEX {
        Interface::IncrementalWithIndex
    } else {
        Interface::Incremental
    };

    #[inline(always)]
    fn word(&self) -> u32 {
        self.0.ccr3().read().bits()
    }
}

/// What an encoder's timer saw since the last look.
#[derive(Clone, Copy, Default)]
pub(crate) struct Flags {
    /// The index.
    pub(crate) index: bool,
    /// Both channels changing together: an edge was lost, or is noise.
    pub(crate) transition_error: bool,
}

impl Flags {
    /// Takes the flags of an encoder's timer.
    pub(crate) fn take(timer: &tim2::RegisterBlock) -> Self {
        const IDXF: u32 = 1 << 20;
        const TERRF: u32 = 1 << 23;
        let flags = timer.sr().read().bits();
        // SAFETY: flags are cleared by writing zero; what came since the read stays.
        timer
            .sr()
            .write(|w| unsafe { w.bits(!(flags & (IDXF | TERRF))) });
        Self {
            index: flags & IDXF != 0,
            transition_error: flags & TERRF != 0,
        }
    }
}
