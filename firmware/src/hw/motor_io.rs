//! The seam between a motor's current loop and its registers: raw counts in, compare values out.

use crate::hw::encoder::Encoder;
use control::current_loop::{MotorSample, PwmCommand};
use core::ops::Deref;
use stm32g4xx_hal::stm32::{adc1, tim1};

/// The registers of one motor: `T` its timer, `X` and `Y` its two ADCs, `E` its encoder.
///
/// Converted are, first and second: X phase a and the bus, Y phases b and c.
pub(crate) struct MotorIo<T, X, Y, E> {
    timer: T,
    adc_x: X,
    adc_y: Y,
    encoder: E,
    /// BDTR without the main output enable; what is locked in it keeps its value whatever is written.
    off: u32,
    enabled: bool,
}

impl<T, X, Y, E> MotorIo<T, X, Y, E>
where
    T: Deref<Target = tim1::RegisterBlock>,
    X: Deref<Target = adc1::RegisterBlock>,
    Y: Deref<Target = adc1::RegisterBlock>,
    E: Encoder,
{
    /// Owns the registers from here on. `bdtr` is the timer's BDTR with the outputs off.
    pub(crate) fn new(timer: T, adc_x: X, adc_y: Y, encoder: E, bdtr: u32) -> Self {
        Self {
            timer,
            adc_x,
            adc_y,
            encoder,
            off: bdtr,
            enabled: false,
        }
    }

    /// What the ADCs and the encoder's capture hold, and whether the break has fired. Acknowledges the interrupt and
    /// the timer's update, and with `clear_break` the break, which holds while its input is active.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)]
    pub(crate) fn sample(&mut self, clear_break: bool) -> MotorSample {
        const UIF: u32 = 1;
        const BREAK_FLAGS: u32 = 1 << 7 | 1 << 8;
        const JEOC_JEOS: u32 = 1 << 5 | 1 << 6;
        // SAFETY: flags that are cleared by writing one.
        self.adc_x.isr().write(|w| unsafe { w.bits(JEOC_JEOS) });
        let flags = self.timer.sr().read().bits();
        let acknowledged = if clear_break { UIF | BREAK_FLAGS } else { UIF };
        if clear_break {
            self.encoder.restart();
        }
        // SAFETY: flags of this register are cleared by writing zero; ones leave the others.
        self.timer.sr().write(|w| unsafe { w.bits(!acknowledged) });
        MotorSample {
            current: [
                self.adc_x.jdr1().read().bits() as u16,
                self.adc_y.jdr1().read().bits() as u16,
                self.adc_y.jdr2().read().bits() as u16,
            ],
            bus: self.adc_x.jdr2().read().bits() as u16,
            encoder: self.encoder.word(),
            broken: flags & BREAK_FLAGS != 0,
        }
    }

    /// Writes the compare values of the next period and opens or closes the bridge. `true` if that came before the
    /// period began: past it, the deadline was missed and the old values hold for a period more.
    #[inline(always)]
    pub(crate) fn apply(&mut self, output: &PwmCommand) -> bool {
        let [a, b, c] = output.compare.map(u32::from);
        // SAFETY: any 16-bit compare value is valid.
        unsafe {
            self.timer.ccr1().write(|w| w.bits(a));
            self.timer.ccr2().write(|w| w.bits(b));
            self.timer.ccr3().write(|w| w.bits(c));
        }
        if output.enable != self.enabled {
            self.switch(output.enable);
        }
        self.timer.sr().read().uif().bit_is_clear()
    }

    /// Opens or closes the bridge. Only a change is written: a bridge that the break has opened since this interrupt
    /// read its flag must not be closed again by a write that merely repeats.
    #[inline(always)]
    fn switch(&mut self, enable: bool) {
        let moe = if enable { crate::hw::pwm::MOE } else { 0 };
        // SAFETY: BDTR's fields are the configured ones.
        self.timer
            .bdtr()
            .write(|w| unsafe { w.bits(self.off | moe) });
        self.enabled = enable;
    }
}
