//! The table's linear scale on TIM4.

use super::InputFilter;
use stm32g4xx_hal::stm32::TIM4;

/// The table's linear scale: a 16-bit counter that [`Scale::position`] extends.
pub(crate) struct Scale {
    timer: TIM4,
    last: u16,
    position: i32,
}

impl Scale {
    /// Starts counting from zero.
    pub(crate) fn start(timer: TIM4, filter: InputFilter) -> Self {
        // SAFETY: every 16-bit value is a valid reload.
        timer.arr().write(|w| unsafe { w.bits(0xFFFF) });
        // SAFETY: values of the fields (RM0440, TIMx_CCMR1).
        timer
            .ccmr1_input()
            .write(|w| unsafe { w.bits(filter.both_channels()) });
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
