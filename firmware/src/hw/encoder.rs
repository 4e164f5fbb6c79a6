//! Incremental encoders on timers in encoder mode.
//!
//! The timer's reload is the count of a turn, so that the counter is the angle, modulo the turn, without code. The
//! index, where the board has its pin, puts the counter to zero in hardware (RM0440 30.4.17). At each top of the
//! motor's PWM the count is captured in hardware: angle and currents belong to the same instant, however late the
//! interrupt reads them.

use stm32g4xx_hal::stm32::{TIM4, tim2};

/// The PWM timer whose top captures an encoder's count: its trigger output as the encoder timer sees it (RM0440
/// table 291), in the field `TS` of `TIMx_SMCR`.
#[derive(Clone, Copy)]
#[repr(u32)]
pub(crate) enum CaptureBy {
    /// TIM1: trigger 0.
    Screw = 0,
    /// TIM8: trigger 5, coded 0b01001 with its upper two bits at 20.
    Nut = 1 << 20 | 1 << 4,
}

/// Counts both edges of both channels of a motor's encoder, modulo `counts_per_turn`, and captures the count in
/// channel 3.
pub(crate) fn start_motor_encoder(
    timer: &tim2::RegisterBlock,
    counts_per_turn: u32,
    index: bool,
    capture: CaptureBy,
) {
    // SAFETY: every value of this 32-bit register is valid.
    timer
        .arr()
        .write(|w| unsafe { w.bits(counts_per_turn.saturating_sub(1)) });
    timer.ccmr1_input().write(|w| w.cc1s().ti1().cc2s().ti2());
    // Channel 3 captures (CC3E) on the internal trigger (CC3S 3).
    timer.ccmr2_input().write(|w| w.cc3s().trc());
    timer.ccer().write(|w| w.cc3e().set_bit());
    if index {
        timer.ecr().write(|w| w.ie().set_bit());
    }
    // SAFETY: 3 is encoder mode 3, the rest a value of TS (RM0440, TIMx_SMCR).
    timer
        .smcr()
        .write(|w| unsafe { w.bits(3 | capture as u32) });
    timer.cr1().write(|w| w.cen().set_bit());
}

/// The table's linear scale: a 16-bit counter that [`Scale::position`] extends.
pub(crate) struct Scale {
    timer: TIM4,
    last: u16,
    position: i32,
}

impl Scale {
    /// Starts counting from zero.
    pub(crate) fn start(timer: TIM4) -> Self {
        // SAFETY: every 16-bit value is a valid reload.
        timer.arr().write(|w| unsafe { w.bits(0xFFFF) });
        timer.ccmr1_input().write(|w| w.cc1s().ti1().cc2s().ti2());
        // SAFETY: 3 is encoder mode 3 (RM0440, TIMx_SMCR.SMS).
        timer.smcr().write(|w| unsafe { w.sms().bits(3) });
        timer.cr1().write(|w| w.cen().set_bit());
        Self {
            timer,
            last: 0,
            position: 0,
        }
    }

    /// Counts since the start, modulo 2^32. Right while it is called before the scale has moved 2^15 counts.
    pub(crate) fn position(&mut self) -> i32 {
        #[allow(clippy::cast_possible_truncation)]
        let now = self.timer.cnt().read().bits() as u16;
        let moved = now.wrapping_sub(self.last).cast_signed();
        self.last = now;
        self.position = self.position.wrapping_add(i32::from(moved));
        self.position
    }
}
