//! Where the journal is kept: RAM that no start clears, at a symbol that a debugger knows.

use control::journal::Journal;
use core::mem::MaybeUninit;

/// At [`link::JOURNAL_SYMBOL`].
#[unsafe(no_mangle)]
#[unsafe(link_section = ".uninit.keep")]
static mut DRIVE_JOURNAL: MaybeUninit<Journal> = MaybeUninit::uninit();

/// Takes it up after a start. Call it once, before interrupts are enabled.
pub(crate) fn take_up() -> &'static mut Journal {
    // SAFETY: this runs once, so the reference is the only one; every bit pattern of its integers is valid, and an event is
    // believed only with its check.
    let journal = unsafe { &mut *(&raw mut DRIVE_JOURNAL).cast::<Journal>() };
    journal.take_up();
    journal
}
