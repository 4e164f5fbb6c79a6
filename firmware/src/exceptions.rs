//! What the core raises by itself: each ends in a crash.

use crate::crash::crash;
use crate::hw::{clock, flash, stack_guard};
use cortex_m_rt::{ExceptionFrame, exception};

#[exception]
// SAFETY: the attribute makes this the fault's handler; it touches only what `crash` may.
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    if stack_guard::overflowed() {
        crash(format_args!("the stack overflowed"));
    }
    crash(format_args!("hard fault at {:#010x}", frame.pc()))
}

/// The crystal has stopped, or flash or RAM has a wrong bit: the chip has broken the bridges already (see
/// [`crate::hw::clock`]), and what runs now runs at another clock or on wrong data.
#[exception]
// SAFETY: as above.
unsafe fn NonMaskableInt() {
    if flash::forgive_torn() {
        return;
    }
    if clock::crystal_failed() {
        crash(format_args!("the crystal stopped"));
    }
    crash(format_args!("flash or RAM has a wrong bit"))
}

#[exception]
// SAFETY: as above.
unsafe fn DefaultHandler(number: i16) -> ! {
    crash(format_args!("unexpected interrupt {number}"))
}
