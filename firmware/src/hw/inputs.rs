//! Contacts that the speed task reads: enable, end switches; and the gate drivers' fault lines.
//!
//! Each is closed to ground while all is well, against the chip's pull-up: a broken wire or a plug that is out reads as an
//! open contact. The pull-up is 25 to 55 kohm (DS12288 Rev 6, I/O static characteristics), too little for a long cable
//! beside a motor's: the wiring page asks for a stronger one and a capacitor.

use super::outputs::Level;
use super::protection::DriverFault;
use control::interlock;
use stm32g4xx_hal::gpio::{Input as Mode, Pin, PinExt, PinMode};
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
    /// Closed, both: the drive may run.
    pub(crate) enable: [Contact; 2],
    /// Open: the table is at its end, ahead of positive velocity.
    pub(crate) end_forward: Contact,
    /// Open: the table is at its other end.
    pub(crate) end_backward: Contact,
}

/// A gate driver's fault line, on a break input.
#[derive(Clone, Copy)]
pub(crate) struct FaultLine {
    line: Contact,
    /// It is high where the driver has a fault.
    high: bool,
}

impl FaultLine {
    /// That at a pin, which stays what it is: a pin in an alternate function can be read.
    pub(crate) fn at(pin: &impl PinExt, fault: DriverFault) -> Self {
        Self {
            line: Contact {
                register: register(u32::from(pin.port_id())),
                bit: 1 << pin.pin_id(),
            },
            high: fault.level == Level::High,
        }
    }

    /// The driver says that it has a fault.
    pub(crate) fn is_pulled(self) -> bool {
        self.line.is_open() == self.high
    }
}

/// A port's input register; 0 is A. GPIOx follow each other by 0x400; IDR is at 0x10 (RM0440 9.4.5).
fn register(port: u32) -> u32 {
    GPIOA::ptr() as u32 + 0x400 * port + 0x10
}

/// A pin as a contact to ground.
pub(crate) fn contact<const P: char, const N: u8, M: PinMode>(pin: Pin<P, N, M>) -> Contact {
    let _: Pin<P, N, Mode> = pin.into_pull_up_input();
    Contact {
        register: register(P as u32 - 'A' as u32),
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
            enabled: self.enable.map(|contact| !contact.is_open()),
            end_forward: self.end_forward.is_open(),
            end_backward: self.end_backward.is_open(),
            ..interlock::Inputs::CLEAR
        }
    }
}
