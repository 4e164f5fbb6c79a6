//! The flash: the last page, which no program reaches (`memory.x` leaves it out), is erased and written (RM0440 5.3.6 and
//! 5.3.7). A page that holds anything but an earlier test is left alone.

use super::{cycles, put, wait_until};
use link::bringup::{FLASH_DOUBLE_WORDS, FlashReading, flash};
use stm32g4xx_hal::stm32::{FLASH, flash as registers};

/// The last 2 KiB: with two banks (OPTR.DBANK) page 127 of the second, with one the upper half of page 127 of 4 KiB.
const PAGE: u32 = 0x0807_F800;
const PAGE_BYTES: u32 = 2048;
const DBANK: u32 = 1 << 22;

const BSY: u32 = 1 << 16;
/// All errors of FLASH_SR and EOP, cleared by writing one.
const CLEAR: u32 = 0xC3FB;
const PG: u32 = 1;
const PER: u32 = 1 << 1;
const PAGE_127: u32 = 127 << 3;
const SECOND_BANK: u32 = 1 << 11;
const START: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;

/// What double word `k` of the test holds: its place, and that turned over.
fn pattern(k: u32) -> [u32; 2] {
    let word = 0x5A17_C3E0 ^ k.wrapping_mul(0x0101_0101);
    [word, !word]
}

fn word(offset: u32) -> u32 {
    // SAFETY: within the reserved page.
    unsafe { ((PAGE + offset) as *const u32).read_volatile() }
}

fn holds(k: u32) -> bool {
    let [low, high] = pattern(k);
    word(8 * k) == low && word(8 * k + 4) == high
}

pub(super) fn read(words: &FlashReading) {
    // SAFETY: interrupts are masked: nobody else is at the flash's registers.
    let interface = unsafe { &*FLASH::ptr() };
    put(&words.address, PAGE);
    let erased = || (0..PAGE_BYTES).step_by(4).all(|at| word(at) == u32::MAX);
    let tested = || {
        let rest = 8 * FLASH_DOUBLE_WORDS..PAGE_BYTES;
        (0..FLASH_DOUBLE_WORDS).all(holds) && rest.step_by(4).all(|at| word(at) == u32::MAX)
    };
    if !erased() && !tested() && !torn() {
        return;
    }
    let mut done = flash::WAS_OURS;
    // SAFETY: the two keys, in their order (RM0440 5.3.5); the page is nobody's.
    unsafe {
        interface.keyr().write(|w| w.bits(0x4567_0123));
        interface.keyr().write(|w| w.bits(0xCDEF_89AB));
    }
    let bank = match interface.optr().read().bits() & DBANK {
        0 => 0,
        _ => SECOND_BANK,
    };
    let began = cycles();
    let status = command(interface, PER | PAGE_127 | bank, || {
        // SAFETY: the same page.
        interface
            .cr()
            .modify(|r, w| unsafe { w.bits(r.bits() | START) });
    });
    put(&words.erase, cycles().wrapping_sub(began));
    put(&words.status[0], status);
    forget_cached(interface);
    if erased() {
        done |= flash::ERASED;
        put(&words.right, program(interface, words));
    }
    // SAFETY: locked again.
    interface.cr().write(|w| unsafe { w.bits(LOCK) });
    put(&words.done, done);
}

/// An earlier test that a reset ended: some of its double words, and nothing else.
fn torn() -> bool {
    let mut rest = (8 * FLASH_DOUBLE_WORDS..PAGE_BYTES).step_by(4);
    let blank = |k: u32| word(8 * k) == u32::MAX && word(8 * k + 4) == u32::MAX;
    rest.all(|at| word(at) == u32::MAX) && (0..FLASH_DOUBLE_WORDS).all(|k| holds(k) || blank(k))
}

/// Double words that are then right.
fn program(interface: &registers::RegisterBlock, words: &FlashReading) -> u32 {
    let mut right = 0u32;
    let began = cycles();
    for k in 0..FLASH_DOUBLE_WORDS {
        let status = command(interface, PG, || {
            let [low, high] = pattern(k);
            let at = (PAGE + 8 * k) as *mut u32;
            // SAFETY: a double word of the reserved, erased page, in two words, the lower first (RM0440 5.3.7).
            unsafe {
                at.write_volatile(low);
                at.wrapping_add(1).write_volatile(high);
            }
        });
        if status & CLEAR & !1 != 0 {
            put(&words.status[1], status);
        }
    }
    put(&words.program, cycles().wrapping_sub(began));
    forget_cached(interface);
    for k in 0..FLASH_DOUBLE_WORDS {
        right += u32::from(holds(k));
    }
    right
}

/// Sets CR, starts, waits: the status afterwards.
fn command(interface: &registers::RegisterBlock, control: u32, start: impl Fn()) -> u32 {
    // An erase takes 25 ms at most, 4.2 million cycles; a look is about ten.
    const LOOKS: u32 = 1_000_000;
    // SAFETY: flags that are cleared by writing one; values of the fields.
    unsafe {
        interface.sr().write(|w| w.bits(CLEAR));
        interface.cr().write(|w| w.bits(control));
    }
    start();
    wait_until(LOOKS, || interface.sr().read().bits() & BSY == 0);
    let status = interface.sr().read().bits();
    // SAFETY: no operation is chosen.
    interface.cr().write(|w| unsafe { w.bits(0) });
    status
}

/// What the data cache holds of the page is of before (RM0440 5.3.4: it must be off to be reset).
fn forget_cached(interface: &registers::RegisterBlock) {
    interface.acr().modify(|_, w| w.dcen().clear_bit());
    interface.acr().modify(|_, w| w.dcrst().set_bit());
    interface.acr().modify(|_, w| w.dcrst().clear_bit());
    interface.acr().modify(|_, w| w.dcen().set_bit());
}
