//! Each source of each timer's break: the main output enable is set, the source acts, and the enable must be gone.
//!
//! First one source at a time, before the timers are locked; then all comparators with the timers set up, locked and
//! running as the drive has them. The bridges' pins are inputs meanwhile: an enabled output reaches no pin.

use super::comparators::{restore_threshold, set_threshold};
use super::{Started, pause, put, wait_until};
use crate::board;
use crate::bridges::{BREAK_SOURCES, PLAN};
use crate::hw::pwm::{self, MOE};
use link::bringup::{BREAKS, BreakReading, BreakSource, Owner, seen};
use stm32g4xx_hal::stm32::{TIM1, TIM8, tim1};

/// Lock level (BDTR.LOCK).
const LOCK: u32 = 3 << 8;
/// The break's flag in SR.
const BIF: u32 = 1 << 7;
const LOOKS: u32 = 1000;

type Timer = &'static tim1::RegisterBlock;

pub(super) fn read(words: &[BreakReading; BREAKS], started: &Started<'_>) {
    // SAFETY: interrupts are masked and the drive's start has not reached the timers: nobody else is at them.
    let timers: [Timer; 2] = unsafe { [&*TIM1::ptr(), &*TIM8::ptr()] };
    let owners = [Owner::Screw, Owner::Nut];
    let unlocked = pwm::bdtr(&PLAN) & !LOCK;
    let mut entries = words.iter();
    let mut next = |owner: Owner, source: BreakSource, comparator: u32, seen: u32| {
        if let Some(entry) = entries.next() {
            put(&entry.source, source.word());
            put(&entry.comparator, comparator);
            put(&entry.seen, seen);
            put(&entry.owner, owner.word());
        }
    };
    // BKIN, by TIMx_AF1.BKINE.
    const PIN: u32 = 1;
    for index in 0..2 {
        let (timer, other) = (timers[index], timers[1 - index]);
        let bench = Bench {
            timer,
            other,
            bdtr: unlocked,
        };
        let owner = owners[index];
        bench.listen(0);
        next(owner, BreakSource::Software, 0, bench.software());
        for number in board::OVER_CURRENT[index].comparators {
            bench.listen(of_comparator(BREAK_SOURCES[index], *number));
            #[allow(clippy::cast_possible_truncation)]
            let number = *number as u32;
            next(owner, BreakSource::Comparator, number, bench.comparator());
        }
        if BREAK_SOURCES[index] & PIN != 0
            && let Some(pin) = super::pins::fault_pin(&started.pins.claims, owner)
        {
            // With its polarity (BKINP).
            bench.listen(BREAK_SOURCES[index] & (PIN | 1 << 9));
            next(owner, BreakSource::Pin, 0, bench.pin(&pin));
        }
        bench.rest();
    }

    // SAFETY: as above.
    let owned = unsafe { (TIM1::steal(), TIM8::steal()) };
    // Without the pin, at which a driver that sleeps may say that it has a fault.
    let comparators = BREAK_SOURCES.map(|sources| sources & !PIN);
    let running = pwm::start(&owned.0, &owned.1, &PLAN, comparators);
    for index in 0..2 {
        let bench = Bench {
            timer: timers[index],
            other: timers[1 - index],
            bdtr: pwm::bdtr(&PLAN),
        };
        let seen = if running { bench.comparator() } else { 0 };
        next(owners[index], BreakSource::Configured, 0, seen);
        bench.rest();
    }
    restore_threshold();
}

/// The enable of one comparator of `TIMx_AF1`, with its polarity, which comparators 1 to 4 have (RM0440 29.6.26).
fn of_comparator(sources: u32, number: usize) -> u32 {
    let polarity = if number <= 4 { 1 << (9 + number) } else { 0 };
    sources & (1 << number | polarity)
}

struct Bench {
    timer: Timer,
    other: Timer,
    bdtr: u32,
}

impl Bench {
    /// Lets these sources of `TIMx_AF1` break the timer, with the drive's filter, and none the other.
    fn listen(&self, sources: u32) {
        // SAFETY: bits of TIMx_AF1 that the drive uses, and the drive's BDTR without its lock.
        unsafe {
            self.timer.af1().write(|w| w.bits(sources));
            self.other.af1().write(|w| w.bits(0));
            self.timer.bdtr().write(|w| w.bits(self.bdtr));
            self.other.bdtr().write(|w| w.bits(self.bdtr));
        }
        self.forget();
    }

    fn forget(&self) {
        // SAFETY: flags are cleared by writing zero.
        self.timer.sr().write(|w| unsafe { w.bits(!BIF) });
    }

    fn enable(timer: Timer, bdtr: u32) -> bool {
        // SAFETY: the drive's fields, and the main output enable: the pins are inputs.
        timer.bdtr().write(|w| unsafe { w.bits(bdtr | MOE) });
        // It follows within a few timer clocks.
        pause(1);
        Self::enabled(timer)
    }

    fn enabled(timer: Timer) -> bool {
        timer.bdtr().read().moe().bit_is_set()
    }

    fn rest(&self) {
        for timer in [self.timer, self.other] {
            // SAFETY: the drive's fields, without the main output enable.
            timer.bdtr().write(|w| unsafe { w.bits(self.bdtr) });
        }
        restore_threshold();
        self.forget();
    }

    /// Enables, lets `act` act, looks; takes it back by `undo`, looks again.
    fn try_source(&self, act: impl Fn(), undo: impl Fn(), held: bool) -> u32 {
        let mut seen = 0;
        self.forget();
        if Self::enable(self.timer, self.bdtr) {
            seen |= seen::ENABLED;
        }
        let other_enabled = Self::enable(self.other, self.bdtr);
        act();
        if wait_until(LOOKS, || !Self::enabled(self.timer)) {
            seen |= seen::CLEARED;
        }
        if self.timer.sr().read().bits() & BIF != 0 {
            seen |= seen::FLAG;
        }
        if held && !Self::enable(self.timer, self.bdtr) {
            seen |= seen::HELD;
        }
        if !other_enabled || Self::enabled(self.other) {
            seen |= seen::OTHER_STAYED;
        }
        undo();
        self.forget();
        if Self::enable(self.timer, self.bdtr) {
            seen |= seen::RECOVERED;
        }
        self.rest();
        seen
    }

    fn software(&self) -> u32 {
        const BG: u32 = 1 << 7;
        let act = || {
            // SAFETY: the register's bit for the break event (RM0440 29.6.7).
            self.timer.egr().write(|w| unsafe { w.bits(BG) });
        };
        self.try_source(act, || (), false)
    }

    /// By the DACs: to the bottom, and if that does not trip it, to the top: a comparator may look for less than its
    /// threshold.
    fn comparator(&self) -> u32 {
        let [low, high] = [0, 4095].map(|counts| {
            let act = || {
                set_threshold(counts);
                pause(10);
            };
            self.try_source(act, restore_threshold, true)
        });
        if low & seen::CLEARED != 0 { low } else { high }
    }

    /// By the pull resistor. If the line is at its fault level already, the output cannot be enabled, which shows the same.
    fn pin(&self, pin: &super::pins::Pulled) -> u32 {
        self.try_source(|| pin.pull_active(), || pin.pull_back(), true)
    }
}
