//! Each comparator against its pin: both DACs go up over the whole range and down again, in all channels at once, and each
//! output's changes are noted. The drive's thresholds are put back.

use super::{pause, put};
use crate::board;
use core::sync::atomic::AtomicU32;
use core::sync::atomic::Ordering::Relaxed;
use link::bringup::{COMPARATORS, ComparatorReading, Signal};
use stm32g4xx_hal::stm32::{COMP, DAC3, DAC4, dac1};

/// DAC counts of a step; 3.2 mV.
const STEP: u16 = 4;
const TOP: u16 = 4096;
/// The comparator's output bit (COMP_CxCSR.VALUE).
const VALUE: u32 = 1 << 30;
/// From one step to the next: a DAC without buffer settles within a microsecond, a comparator in a tenth of that.
const SETTLE_US: u32 = 2;

pub(super) fn read(words: &[ComparatorReading; COMPARATORS]) {
    const PHASES: [[Signal; 3]; 2] = [
        [Signal::ScrewA, Signal::ScrewB, Signal::ScrewC],
        [Signal::NutA, Signal::NutB, Signal::NutC],
    ];
    let all = board::OVER_CURRENT
        .iter()
        .zip(PHASES)
        .flat_map(|(motor, phases)| motor.comparators.iter().zip(phases));
    for (entry, (number, signal)) in words.iter().zip(all) {
        #[allow(clippy::cast_possible_truncation)]
        put(&entry.number, *number as u32);
        put(&entry.signal, signal.word());
        put(&entry.up, TOP.into());
        put(&entry.down, TOP.into());
    }
    set_threshold(0);
    pause(50);
    let mut before = [false; COMPARATORS];
    for (entry, before) in words.iter().zip(&mut before) {
        *before = output(entry);
        put(&entry.start, u32::from(*before));
    }
    let up = (0..TOP).step_by(STEP.into());
    for counts in up.clone() {
        note(words, &mut before, counts, |entry| &entry.up);
    }
    for counts in up.rev() {
        note(words, &mut before, counts, |entry| &entry.down);
    }
    restore_threshold();
}

/// The DACs stand at `counts`: which outputs have changed.
fn note(
    words: &[ComparatorReading; COMPARATORS],
    before: &mut [bool; COMPARATORS],
    counts: u16,
    first: impl Fn(&ComparatorReading) -> &AtomicU32,
) {
    set_threshold(counts);
    pause(SETTLE_US);
    for (entry, before) in words.iter().zip(before) {
        let now = output(entry);
        if now == *before {
            continue;
        }
        *before = now;
        put(&entry.changes, entry.changes.load(Relaxed).wrapping_add(1));
        let first = first(entry);
        if first.load(Relaxed) == u32::from(TOP) {
            put(first, counts.into());
        }
    }
}

/// The output of an entry's comparator.
fn output(entry: &ComparatorReading) -> bool {
    let number = entry.number.load(Relaxed) as usize;
    // SAFETY: a status is read, which changes nothing.
    let comparators = unsafe { &*COMP::ptr() };
    number
        .checked_sub(1)
        .filter(|index| *index < COMPARATORS)
        .is_some_and(|index| comparators.ccsr(index).read().bits() & VALUE != 0)
}

/// Puts all channels of DAC3 and DAC4 to `counts`.
pub(super) fn set_threshold(counts: u16) {
    let both = u32::from(counts) | u32::from(counts) << 16;
    // SAFETY: interrupts are masked, so nobody else is at the DACs.
    let dacs: [&dac1::RegisterBlock; 2] = unsafe { [&*DAC3::ptr(), &*DAC4::ptr()] };
    for dac in dacs {
        // SAFETY: 12-bit values.
        dac.dhr12rd().write(|w| unsafe { w.bits(both) });
    }
}

/// The threshold that the drive has.
pub(super) fn restore_threshold() {
    set_threshold(board::OVER_CURRENT[0].threshold);
    pause(50);
}
