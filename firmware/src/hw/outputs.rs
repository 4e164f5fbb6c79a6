//! Outputs that switch something of the power stage: the gate drivers' enables, the bus's contactor, the brake.
//!
//! Each is off from reset on: its pin floats then, so the board needs a resistor that holds it off (a pull-down for an
//! active-high input), as the chip's own does not exist before the pin is claimed. [`all_safe`] puts all of them off
//! from anywhere, also from a fault's handler.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use stm32g4xx_hal::gpio::{Output as Mode, Pin, PinState, PushPull};
use stm32g4xx_hal::stm32::GPIOA;

/// The level of a pin at which what it switches is on.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Level {
    #[allow(dead_code, reason = "a board's drivers say which")]
    Low,
    High,
}

/// A pin that switches something.
#[derive(Clone, Copy)]
pub(crate) struct Output {
    /// Its port's set and reset register.
    register: u32,
    on: u32,
    off: u32,
}

/// What a board switches; what it does not have is `None`.
#[derive(Clone, Copy, Default)]
pub(crate) struct Outputs {
    /// The gate drivers' enables: screw, nut.
    pub(crate) drivers: [Option<Output>; 2],
    /// Bypasses the resistor that the bus is charged through.
    pub(crate) contactor: Option<Output>,
    /// Releases the brake that holds the axis.
    pub(crate) brake: Option<Output>,
}

/// What puts each claimed output off: address and word of its port's set and reset register, or 0. A static: the handlers of
/// faults are outside of RTIC.
static SAFE: [[AtomicU32; 2]; 4] = [const { [const { AtomicU32::new(0) }; 2] }; 4];

/// A pin as an output that is off, and is switched on at `level`: `Pxn` becomes one without a pulse.
pub(crate) fn output<const P: char, const N: u8, M>(pin: Pin<P, N, M>, level: Level) -> Output
where
    M: stm32g4xx_hal::gpio::PinMode,
{
    let off = if level == Level::High {
        PinState::Low
    } else {
        PinState::High
    };
    let _: Pin<P, N, Mode<PushPull>> = pin.into_push_pull_output_in_state(off);
    // GPIOx follow each other by 0x400; BSRR is at 0x18: its lower half sets, its upper half resets (RM0440 9.4.7).
    let register = GPIOA::ptr() as u32 + 0x400 * (P as u32 - 'A' as u32) + 0x18;
    let (set, reset) = (1 << N, 1 << (N + 16));
    match level {
        Level::High => Output {
            register,
            on: set,
            off: reset,
        },
        Level::Low => Output {
            register,
            on: reset,
            off: set,
        },
    }
}

impl Output {
    fn write(self, word: u32) {
        // SAFETY: the address is a port's BSRR, every word of which is valid, and touches only the pin's own bit.
        unsafe { (self.register as *mut u32).write_volatile(word) };
    }

    /// Switches it.
    pub(crate) fn switch(self, on: bool) {
        self.write(if on { self.on } else { self.off });
    }
}

impl Outputs {
    /// From here on [`all_safe`] knows them.
    pub(crate) fn keep(&self) {
        let [screw, nut] = self.drivers;
        let all = [screw, nut, self.contactor, self.brake];
        for ([register, word], output) in SAFE.iter().zip(all) {
            if let Some(output) = output {
                word.store(output.off, Relaxed);
                register.store(output.register, Relaxed);
            }
        }
    }

    /// Wakes the gate drivers.
    pub(crate) fn enable_drivers(&self) {
        for driver in self.drivers.into_iter().flatten() {
            driver.switch(true);
        }
    }
}

/// Puts all outputs off: drivers asleep, contactor open, brake on.
pub(crate) fn all_safe() {
    for [register, word] in &SAFE {
        let register = register.load(Relaxed) as *mut u32;
        if !register.is_null() {
            // SAFETY: as in `Output::write`.
            unsafe { register.write_volatile(word.load(Relaxed)) };
        }
    }
}
