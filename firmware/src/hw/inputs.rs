//! Contacts that the speed task reads: enable, end switches.
//!
//! Each is closed to ground while all is well, against the chip's pull-up: a broken wire or a plug that is out reads as an
//! open contact. The pull-up is 25 to 55 kohm (datasheet, I/O static characteristics; memory), too little for a long cable
//! beside a motor's: the wiring page asks for a stronger one and a capacitor.

use control::interlock;
use stm32g4xx_hal::gpio::{Input as Mode, Pin, PinMode};
use stm32g4xx_hal::stm32::GPIOA;

/// A contact.
#[derive(Clone, Copy)]
pub(crate) struct Contact {
    /// Its port's input register.
    register: u32,
    bit: u32,
}

/// The contacts of a board. Where a machine has none, a wire to ground stands for it (wiring page).
#[derive(Clone, Copy)]
pub(crate) struct Inputs {
    /// Closed: the drive may run.
    pub(crate) enable: Contact,
    /// Open: the table is at its end, ahead of positive velocity.
    pub(crate) end_forward: Contact,
    /// Open: the table is at its other end.
    pub(crate) end_backward: Contact,
}

/// A pin as a contact to ground.
pub(crate) fn contact<const P: char, const N: u8, M: PinMode>(pin: Pin<P, N, M>) -> Contact {
    let _: Pin<P, N, Mode> = pin.into_pull_up_input();
    // GPIOx follow each other by 0x400; IDR is at 0x10 (RM0440 9.4.5).
    let register = GPIOA::ptr() as u32 + 0x400 * (P as u32 - 'A' as u32) + 0x10;
    Contact {
        register,
        bit: 1 << N,
    }
}

impl Contact {
    #[inline(always)]
    fn is_open(self) -> bool {
        // SAFETY: the address is a port's IDR, which may be read at any time and changes nothing.
        let levels = unsafe { (self.register as *const u32).read_volatile() };
        levels & self.bit != 0
    }
}

impl Inputs {
    /// What they say now.
    #[inline(always)]
    pub(crate) fn read(&self) -> interlock::Inputs {
        interlock::Inputs {
            enabled: !self.enable.is_open(),
            end_forward: self.end_forward.is_open(),
            end_backward: self.end_backward.is_open(),
            ..interlock::Inputs::CLEAR
        }
    }
}
