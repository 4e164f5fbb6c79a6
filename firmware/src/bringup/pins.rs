//! Each claimed digital pin by its pull resistors, as an input.
//!
//! All are pulled down and let go but one, which is pulled up; then the other way round. What goes with that one is
//! connected to it. A pin that is held from outside reads the same both times. No pin is driven, until the timers drive the
//! bridges' to their idle level.

use super::{pause, put};
use crate::board::{Claimed, Claims};
use core::sync::atomic::Ordering::Relaxed;
use link::bringup::{Owner, PINS, PinReading, PinUse, level};
use stm32g4xx_hal::stm32::{GPIOB, gpiob};

const INPUT: u32 = 0;
const ALTERNATE: u32 = 2;
const NONE: u32 = 0;
const UP: u32 = 1;
const DOWN: u32 = 2;
/// 50 kohm into 100 pF of cable take 25 us to settle to 1 %.
const SETTLE_US: u32 = 50;

/// One pin, by its number.
#[derive(Clone, Copy)]
struct Pin {
    port: &'static gpiob::RegisterBlock,
    index: u32,
}

impl Pin {
    fn of(claimed: &Claimed) -> Self {
        // Ports follow each other by 0x400 and are alike in the registers used here (RM0440 9.4, table 3).
        let at = GPIOB::ptr() as u32 + 0x400 * u32::from(claimed.port) - 0x400;
        Self {
            // SAFETY: a port of the chip; interrupts are masked, so nobody else is at it.
            port: unsafe { &*(at as *const gpiob::RegisterBlock) },
            index: claimed.pin.into(),
        }
    }

    fn mode(self) -> u32 {
        self.port.moder().read().bits() >> (2 * self.index) & 3
    }

    fn set_mode(self, mode: u32) {
        let at = 2 * self.index;
        // SAFETY: a value of this pin's field.
        self.port
            .moder()
            .modify(|r, w| unsafe { w.bits(r.bits() & !(3 << at) | mode << at) });
    }

    fn pull(self) -> u32 {
        self.port.pupdr().read().bits() >> (2 * self.index) & 3
    }

    fn set_pull(self, pull: u32) {
        let at = 2 * self.index;
        // SAFETY: a value of this pin's field.
        self.port
            .pupdr()
            .modify(|r, w| unsafe { w.bits(r.bits() & !(3 << at) | pull << at) });
    }

    fn is_high(self) -> bool {
        self.port.idr().read().bits() >> self.index & 1 != 0
    }
}

fn all(claims: &Claims) -> impl Iterator<Item = (u32, Claimed, Pin)> + Clone {
    claims
        .iter()
        .zip(0..)
        .take(PINS)
        .map(|(claimed, index)| (index, claimed, Pin::of(&claimed)))
}

/// The level of all, bit by bit.
fn levels(claims: &Claims) -> u32 {
    all(claims).fold(0, |bits, (index, _, pin)| {
        bits | u32::from(pin.is_high()) << index
    })
}

pub(super) fn read(claims: &Claims, words: &[PinReading; PINS]) {
    let mut kept = [[0; 2]; PINS];
    for ((_, _, pin), kept) in all(claims).zip(&mut kept) {
        *kept = [pin.mode(), pin.pull()];
        pin.set_mode(INPUT);
    }
    for pull in [UP, DOWN] {
        for (((index, claimed, pin), entry), [_, idle]) in all(claims).zip(words).zip(kept) {
            let opposite = if pull == UP { DOWN } else { UP };
            for (_, _, other) in all(claims) {
                other.set_pull(opposite);
            }
            pause(SETTLE_US);
            // An open pin keeps its charge; one that is connected to this one goes with it.
            for (other, _, neighbour) in all(claims) {
                if other != index {
                    neighbour.set_pull(NONE);
                }
            }
            let before = levels(claims);
            pin.set_pull(pull);
            pause(SETTLE_US);
            let with = levels(claims);
            let high = with >> index & 1;
            let followed = (with ^ before) & !(1 << index);
            if pull == UP {
                let idle = u32::from(idle == UP) * level::IDLE_HIGH;
                put(
                    &entry.pin,
                    u32::from(claimed.port) << 8 | u32::from(claimed.pin),
                );
                put(&entry.owner, claimed.owner.word());
                put(&entry.levels, (high * level::PULLED_UP) | idle);
                put(&entry.raised, followed);
                put(&entry.function, claimed.function.word());
            } else {
                let levels = entry.levels.load(Relaxed);
                put(&entry.levels, levels | (high * level::PULLED_DOWN));
                put(&entry.lowered, followed);
            }
        }
    }
    for ((_, _, pin), [mode, pull]) in all(claims).zip(kept) {
        pin.set_pull(pull);
        pin.set_mode(mode);
    }
}

fn is_gate(function: PinUse) -> bool {
    matches!(
        function,
        PinUse::HighA | PinUse::HighB | PinUse::HighC | PinUse::LowA | PinUse::LowB | PinUse::LowC
    )
}

fn gates(claims: &Claims) -> impl Iterator<Item = (u32, Claimed, Pin)> {
    all(claims).filter(|(_, claimed, _)| is_gate(claimed.function))
}

/// Takes the bridges' pins from the timers; `true` if they are inputs then, pulled down.
pub(super) fn gates_as_inputs(claims: &Claims) -> bool {
    for (_, _, pin) in gates(claims) {
        pin.set_pull(DOWN);
        pin.set_mode(INPUT);
    }
    gates(claims).all(|(_, _, pin)| pin.mode() == INPUT)
}

/// Gives the bridges' pins to the timers, whose outputs are off and drive them low: against the chip's own pull-up they
/// must read low. What is held high from outside is not driven.
pub(super) fn drive_idle(claims: &Claims, words: &[PinReading; PINS]) {
    let gates = all(claims).zip(words);
    for ((_, claimed, pin), entry) in gates {
        let levels = entry.levels.load(Relaxed);
        if !is_gate(claimed.function) || levels & level::PULLED_DOWN != 0 {
            continue;
        }
        pin.set_mode(ALTERNATE);
        pin.set_pull(UP);
        pause(SETTLE_US);
        let high = if pin.is_high() { level::DRIVEN_HIGH } else { 0 };
        pin.set_pull(DOWN);
        put(&entry.levels, levels | level::DRIVEN | high);
    }
}

/// A pin whose pull resistor makes a fault.
pub(super) struct Pulled(Pin, u32);

impl Pulled {
    /// To the level that is a fault: the other way than the drive pulls it.
    pub(super) fn pull_active(&self) {
        self.0.set_pull(if self.1 == UP { DOWN } else { UP });
        pause(SETTLE_US);
    }

    /// As the drive has it.
    pub(super) fn pull_back(&self) {
        self.0.set_pull(self.1);
        pause(SETTLE_US);
    }
}

/// The gate driver's fault input of a motor.
pub(super) fn fault_pin(claims: &Claims, owner: Owner) -> Option<Pulled> {
    all(claims)
        .find(|(_, claimed, _)| claimed.function == PinUse::Fault && claimed.owner == owner)
        .map(|(_, _, pin)| Pulled(pin, pin.pull()))
}
