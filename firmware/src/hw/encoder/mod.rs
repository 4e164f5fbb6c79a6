//! The motors' encoders and the table's scale.

use control::encoder::Interface;

mod filter;
mod incremental;
#[allow(dead_code, reason = "not every board has one")]
pub(crate) mod mt6835;
mod scale;

pub(crate) use filter::{InputFilter, LENGTHS as FILTER_LENGTHS};
pub(crate) use incremental::{Flags, Incremental};
pub(crate) use scale::Scale;

/// A motor's encoder as its current loop reads it.
pub(crate) trait Encoder {
    /// How its words are read.
    const INTERFACE: Interface;

    /// The raw word of the last top of the motor's PWM: see `control::encoder::Interface`.
    fn word(&self) -> u32;

    /// Called right after a top when a fault is to be left: what can come out of step starts again.
    #[inline(always)]
    fn restart(&self) {}
}

/// The PWM timer whose top is an encoder's instant: its trigger output as the encoder's timer sees it (RM0440
/// table 291), in the field `TS` of `TIMx_SMCR`.
#[derive(Clone, Copy)]
#[repr(u32)]
pub(crate) enum TopOf {
    /// TIM1: trigger 0.
    Screw = 0,
    /// TIM8: trigger 5, coded 0b01001 with its upper two bits at 20.
    Nut = 1 << 20 | 1 << 4,
}
