//! The flash: the last page, which no program reaches (`memory.x` leaves it out), is erased and written (RM0440 3.3.6 and
//! 3.3.7). A page that holds anything but an earlier test is left alone.

use super::{cycles, put};
use crate::hw::flash as controller;
use link::bringup::{FLASH_DOUBLE_WORDS, FlashReading, flash};

/// The last 2 KiB: with two banks (OPTR.DBANK) page 127 of the second, with one the upper half of page 127 of 4 KiB.
const PAGE: u32 = 0x0807_F800;
const PAGE_BYTES: u32 = 2048;
const PAGE_NUMBER: u32 = 127;

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
    controller::unlocked(|| {
        let began = cycles();
        let status = controller::erase(PAGE_NUMBER);
        put(&words.erase, cycles().wrapping_sub(began));
        put(&words.status[0], status);
        if erased() {
            done |= flash::ERASED;
            put(&words.right, program(words));
        }
    });
    put(&words.done, done);
}

/// An earlier test that a reset ended: some of its double words, and nothing else.
fn torn() -> bool {
    let mut rest = (8 * FLASH_DOUBLE_WORDS..PAGE_BYTES).step_by(4);
    let blank = |k: u32| word(8 * k) == u32::MAX && word(8 * k + 4) == u32::MAX;
    rest.all(|at| word(at) == u32::MAX) && (0..FLASH_DOUBLE_WORDS).all(|k| holds(k) || blank(k))
}

/// Double words that are then right.
fn program(words: &FlashReading) -> u32 {
    let mut right = 0u32;
    let began = cycles();
    for k in 0..FLASH_DOUBLE_WORDS {
        // SAFETY: a double word of the reserved, erased page.
        let status = unsafe { controller::program(PAGE + 8 * k, pattern(k)) };
        if status & controller::ERRORS != 0 {
            put(&words.status[1], status);
        }
    }
    put(&words.program, cycles().wrapping_sub(began));
    for k in 0..FLASH_DOUBLE_WORDS {
        right += u32::from(holds(k));
    }
    right
}
