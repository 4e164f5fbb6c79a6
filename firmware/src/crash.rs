//! What to do when nothing else can be done: bridges off, say where it happened, reset; and say so at the next boot.

use crate::hw::outputs;
use core::fmt::Write;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use cortex_m::peripheral::SCB;
use stm32g4xx_hal::stm32::{RCC, TIM1, TIM8};

/// Says that a record was written; any other value is what RAM held at power up.
const MAGIC: u32 = 0xC0DE_DEAD;
const TEXT: usize = link::CRASH_TEXT;

/// A crash, kept across the reset that it causes, and after it has been reported.
#[repr(C)]
struct Record {
    magic: u32,
    length: usize,
    text: [u8; TEXT],
}

/// At a symbol that a debugger knows.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".uninit.keep")]
static mut DRIVE_CRASH: MaybeUninit<Record> = MaybeUninit::uninit();

impl Write for Record {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        for (slot, byte) in self.text.iter_mut().skip(self.length).zip(text.bytes()) {
            *slot = byte;
            self.length += 1;
        }
        Ok(())
    }
}

/// The last run's crash, once. Call it before interrupts are enabled.
pub(crate) fn take(report: impl FnOnce(&str)) {
    // SAFETY: interrupts are off and this runs once, so the reference is the only one; every bit pattern of the
    // record's integers is valid, and it is believed only with its magic word.
    let record = unsafe { &mut *(&raw mut DRIVE_CRASH).cast::<Record>() };
    if record.magic == MAGIC {
        let text = record.text.get(..record.length).unwrap_or(&record.text);
        report(core::str::from_utf8(text).unwrap_or("a record that is not text"));
    }
    record.magic = 0;
}

/// Bridges off, the cause written down, reset.
pub(crate) fn crash(cause: core::fmt::Arguments<'_>) -> ! {
    cortex_m::interrupt::disable();
    // SAFETY: nothing else runs from here on; clearing the main output enable opens both bridges. Before the timers have
    // their clocks nothing has closed them, but a write to a timer without one is lost.
    unsafe {
        (*RCC::ptr())
            .apb2enr()
            .modify(|_, w| w.tim1en().set_bit().tim8en().set_bit());
        let _ = (*RCC::ptr()).apb2enr().read();
        (*TIM1::ptr()).bdtr().modify(|_, w| w.moe().clear_bit());
        (*TIM8::ptr()).bdtr().modify(|_, w| w.moe().clear_bit());
    }
    outputs::all_safe();
    let mut record = Record {
        magic: MAGIC,
        length: 0,
        text: [0; TEXT],
    };
    let _ = record.write_fmt(cause);
    // SAFETY: nothing else runs from here on.
    unsafe { (&raw mut DRIVE_CRASH).write_volatile(MaybeUninit::new(record)) };
    SCB::sys_reset()
}

/// The chip or the board is not as it must be: the drive does not start. The reset tries again, and says why.
pub(crate) fn refuse(why: &str) -> ! {
    crash(format_args!("{why}"))
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    match info.location() {
        Some(at) => crash(format_args!("panic at {}:{}", at.file(), at.line())),
        None => crash(format_args!("panic")),
    }
}
