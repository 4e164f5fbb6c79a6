//! The seam between a motor's current loop and its registers: raw counts in, compare values out.

use crate::hw::encoder::Encoder;
use control::sense::Shunts;
use core::ops::Deref;
use stm32g4xx_hal::stm32::{adc1, tim1};

/// The timer's flags: its update, and its two breaks.
const UIF: u32 = 1;
const BREAK_FLAGS: u32 = 1 << 7 | 1 << 8;

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
        }
    }

    /// Acknowledges the interrupt and the timer's update; `true` if the break has fired.
    #[inline(always)]
    pub(crate) fn acknowledge(&mut self) -> bool {
        const JEOC_JEOS: u32 = 1 << 5 | 1 << 6;
        // SAFETY: flags that are cleared by writing one.
        self.adc_x.isr().write(|w| unsafe { w.bits(JEOC_JEOS) });
        let flags = self.timer.sr().read().bits();
        // SAFETY: flags of this register are cleared by writing zero; ones leave the others.
        self.timer.sr().write(|w| unsafe { w.bits(!UIF) });
        flags & BREAK_FLAGS != 0
    }

    /// Acknowledges the break, which holds while its input is active, and lets the encoder start again.
    pub(crate) fn clear_break(&mut self) {
        self.encoder.restart();
        // SAFETY: as above.
        self.timer.sr().write(|w| unsafe { w.bits(!BREAK_FLAGS) });
    }

    /// ADC counts of the phases; of c only where it is measured.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)]
    pub(crate) fn current(&self, shunts: Shunts) -> [u16; 3] {
        [
            self.adc_x.jdr1().read().bits() as u16,
            self.adc_y.jdr1().read().bits() as u16,
            match shunts {
                Shunts::Two => 0,
                Shunts::Three => self.adc_y.jdr2().read().bits() as u16,
            },
        ]
    }

    /// ADC counts of the bus voltage.
    #[inline(always)]
    pub(crate) fn bus(&self) -> u32 {
        self.adc_x.jdr2().read().bits()
    }

    /// The encoder's raw word.
    #[inline(always)]
    pub(crate) fn encoder(&self) -> u32 {
        self.encoder.word()
    }

    /// Writes the compare values of the next period.
    #[inline(always)]
    pub(crate) fn write(&mut self, compare: [u16; 3]) {
        let [a, b, c] = compare.map(u32::from);
        // SAFETY: any 16-bit compare value is valid.
        unsafe {
            self.timer.ccr1().write(|w| w.bits(a));
            self.timer.ccr2().write(|w| w.bits(b));
            self.timer.ccr3().write(|w| w.bits(c));
        }
    }

    /// The next period has not begun. Past its begin, what was written just now missed its deadline and the old values
    /// hold for a period more.
    #[inline(always)]
    pub(crate) fn in_time(&self) -> bool {
        self.timer.sr().read().uif().bit_is_clear()
    }

    /// Closes the bridge: the outputs follow the compare values. To be called once: a bridge that the break has opened
    /// since this interrupt read its flag must not be closed again by a write that merely repeats.
    pub(crate) fn close(&mut self) {
        self.switch(crate::hw::pwm::MOE);
    }

    /// Opens the bridge.
    pub(crate) fn open(&mut self) {
        self.switch(0);
    }

    fn switch(&mut self, moe: u32) {
        // SAFETY: BDTR's fields are the configured ones.
        self.timer
            .bdtr()
            .write(|w| unsafe { w.bits(self.off | moe) });
    }
}
