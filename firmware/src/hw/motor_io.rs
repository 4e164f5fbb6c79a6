//! The registers that a motor's current loop reads and writes.

use crate::bridges::BRIDGES_OFF;
use crate::config::BOARD;
use crate::hw::encoder::Encoder;
use control::motor_io::{MotorIo, Sensing};
use control::sense::Shunts;
use core::ops::Deref;
use stm32g4xx_hal::stm32::{adc1, tim1};

/// The timer's flags: its update; its two breaks, and the break by a fault of the chip itself (SBIF: clock, supply, memory).
const UIF: u32 = 1;
const BREAK_FLAGS: u32 = 1 << 7 | 1 << 8 | 1 << 13;

/// The registers of one motor: `T` its timer, `X` and `Y` its two ADCs, `E` its encoder.
///
/// Converted are, first and second: X phase a and the bus, Y phases b and c.
pub(crate) struct Registers<T, X, Y, E> {
    timer: T,
    adc_x: X,
    adc_y: Y,
    encoder: E,
}

impl<T, X, Y, E> Registers<T, X, Y, E>
where
    T: Deref<Target = tim1::RegisterBlock>,
    X: Deref<Target = adc1::RegisterBlock>,
    Y: Deref<Target = adc1::RegisterBlock>,
    E: Encoder,
{
    /// Owns the registers from here on.
    pub(crate) fn new(timer: T, adc_x: X, adc_y: Y, encoder: E) -> Self {
        Self {
            timer,
            adc_x,
            adc_y,
            encoder,
        }
    }

    fn switch(&mut self, moe: u32) {
        // SAFETY: BDTR's fields are the configured ones. What is locked in it keeps its value whatever is written.
        self.timer
            .bdtr()
            .write(|w| unsafe { w.bits(BRIDGES_OFF | moe) });
    }
}

impl<T, X, Y, E> MotorIo for Registers<T, X, Y, E>
where
    T: Deref<Target = tim1::RegisterBlock>,
    X: Deref<Target = adc1::RegisterBlock>,
    Y: Deref<Target = adc1::RegisterBlock>,
    E: Encoder,
{
    #[inline(always)]
    fn acknowledge(&mut self) -> bool {
        const JEOC_JEOS: u32 = 1 << 5 | 1 << 6;
        // SAFETY: flags that are cleared by writing one.
        self.adc_x.isr().write(|w| unsafe { w.bits(JEOC_JEOS) });
        let flags = self.timer.sr().read().bits();
        // SAFETY: flags of this register are cleared by writing zero; ones leave the others.
        self.timer.sr().write(|w| unsafe { w.bits(!UIF) });
        flags & BREAK_FLAGS != 0
    }

    fn clear_break(&mut self) {
        self.encoder.restart();
        // SAFETY: as above.
        self.timer.sr().write(|w| unsafe { w.bits(!BREAK_FLAGS) });
    }

    #[inline(always)]
    fn sensing(&self) -> Sensing {
        const {
            Sensing {
                encoder: E::INTERFACE,
                ..BOARD.drive.current_loops[0].sensing()
            }
        }
    }

    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)]
    fn current(&mut self) -> [u16; 3] {
        [
            self.adc_x.jdr1().read().bits() as u16,
            self.adc_y.jdr1().read().bits() as u16,
            match self.sensing().shunts {
                Shunts::Two => 0,
                Shunts::Three => self.adc_y.jdr2().read().bits() as u16,
            },
        ]
    }

    #[inline(always)]
    fn bus(&mut self) -> u32 {
        self.adc_x.jdr2().read().bits()
    }

    #[inline(always)]
    fn encoder(&mut self) -> u32 {
        self.encoder.word()
    }

    #[inline(always)]
    fn write(&mut self, compare: [u16; 3]) {
        let [a, b, c] = compare.map(u32::from);
        // SAFETY: any 16-bit compare value is valid.
        unsafe {
            self.timer.ccr1().write(|w| w.bits(a));
            self.timer.ccr2().write(|w| w.bits(b));
            self.timer.ccr3().write(|w| w.bits(c));
        }
    }

    #[inline(always)]
    fn in_time(&mut self) -> bool {
        self.timer.sr().read().uif().bit_is_clear()
    }

    fn close(&mut self) {
        self.switch(crate::hw::pwm::MOE);
    }

    fn open(&mut self) {
        self.switch(0);
    }
}
