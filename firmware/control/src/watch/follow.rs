//! The motor that is left brings the table to rest, once the other's bridge is open for a fault of its own.
//!
//! Left alone the two coast apart, and the table moves by the difference: `J omega^2 / 2` over each one's own friction. A shaft that seizes is
//! the worst of it, a dead encoder looks the same at first, and holding the healthy motor would make the table move by all that the
//! other coasts. The [table's speed](crate::speed::table_speed) needs to know neither: the healthy motor's speed loop is asked to leave no velocity
//! of the table, so it brakes beside a shaft that stands and slows down with one that coasts. Its own angle, currents and bridge are not in
//! doubt.
//!
//! A stop of both may be on its way, for a contact that opened: the motor that is left brings it to its end.
//!
//! It ends, and this bridge opens too, when all is at rest, after [`LONGEST`], with any fault of this motor or the bus (its own
//! currents and their sum are watched as before), and where the scale says nothing. A scale that died together with the first
//! motor says that the table rests, whatever the table does, and the shaft keeps its speed beside one that slows down. Beside a shaft
//! that stands, the worst of all, the table goes by a lead each time this one has turned once: so the scale is taken for dead, and the
//! bridge opens, where the shaft has turned by [`BLIND_M`] of the table and the scale has not counted once. One that is late makes the
//! loop swing: it ends where the table turns round more than [`SWINGS`] times. One that counts the wrong way makes the
//! shaft run away: it ends where that is faster than either was, for both only slow down, but for what an axis that was pressed gives back.

use crate::base::fault::{Fault, FaultSet, Reaction};
use crate::base::format::Speed;
use crate::speed::table_speed::{Reading, Table, TableSpeed};

/// Furthest that the table may go, m, beside a shaft that stands, while its scale does not count: half of what no fault may move it by.
/// Beside one that coasts the scale counts long before: a count of 0.1 um needs `sqrt(2 count / r a)`, 0.8 ms with the 350 rad/s^2 of the
/// mains board's motors, and this motor turns by so much in 15 ms at 800 rpm.
pub(crate) const BLIND_M: f64 = 1e-3;

/// Steps of the speed task that it takes at most: 5 s at 5 kHz, twice what the longest coasts.
const LONGEST: u32 = 25_000;
/// Steps in a row in which all has to be at rest.
const RESTED: u32 = 250;
/// Times that the table may turn round while it is fast: a loop that is stable overshoots once or twice.
const SWINGS: u8 = 3;
/// By so much of what is slow the shaft may be faster than either was at the start: what the axis and a stop have stored of a press.
const FASTER: i32 = 4;

/// A motor that brings the table to rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Follow {
    /// Which: 0 is the screw's, 1 the nut's.
    motor: usize,
    left: u32,
    rested: u32,
    /// What may be latched beside it.
    known: FaultSet,
    /// What its shaft has turned since the scale last counted, 2^-32 turn.
    blind: u32,
    /// Which way the table last went while it was fast, and how often it turned round.
    way: i32,
    swings: u8,
    /// What the table's speed is taken from.
    table: TableSpeed,
    /// The fastest that its shaft may turn: what it and the table did at the start together, which is at least what the other did.
    fastest: Option<Speed>,
}

/// What a step of following sees.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Followed {
    /// What is latched.
    pub(crate) latched: FaultSet,
    /// The speed of the shaft and the table's, as one of the same shaft.
    pub(crate) speeds: [Speed; 2],
    /// What is slow.
    pub(crate) slow: Speed,
    /// What the shaft has turned since the last step, 2^-32 turn.
    pub(crate) turned: u32,
    /// Its three currents add up.
    pub(crate) adds_up: bool,
    /// The table's speed is the encoders', or the scale has counted in its last look.
    pub(crate) counted: bool,
    /// Furthest that the shaft may turn while it does not, 2^-32 turn.
    pub(crate) blind_max: u32,
}

impl Follow {
    /// After `first`, with these faults latched: the motor that is left, if there is one that is healthy. `planned` is the table's
    /// planned speed as an electrical speed of a motor.
    pub(crate) fn after(
        first: Fault,
        latched: FaultSet,
        planned: impl FnOnce(usize) -> Speed,
    ) -> Option<Self> {
        let faulty = first.motor()?;
        let motor = 1usize.checked_sub(faulty)?;
        let [screw, nut] = FaultSet::OF_MOTOR;
        let others = if motor == 0 { nut } else { screw };
        let follow = Self {
            motor,
            left: LONGEST,
            rested: 0,
            // An encoder that is wrong is apart from the scale too.
            known: if first.doubts_angle() {
                others.with(Fault::Scale)
            } else {
                others
            }
            .and(FaultSet::RESTS),
            blind: 0,
            way: 0,
            swings: 0,
            table: TableSpeed::after(first, planned(motor)),
            fastest: None,
        };
        (first.reaction() == Reaction::Follow && follow.is_healthy(latched)).then_some(follow)
    }

    /// Which motor: 0 is the screw's, 1 the nut's.
    #[inline(always)]
    pub(crate) const fn motor(self) -> usize {
        self.motor
    }

    /// The table's speed; `None`: nobody knows it.
    pub(crate) fn table(&mut self, reading: &Reading) -> Option<Table> {
        self.table.step(reading)
    }

    /// All that is latched is the other motor's, or what both would come to rest for.
    fn is_healthy(self, latched: FaultSet) -> bool {
        latched.without(self.known).is_empty()
    }

    /// A step: it goes on.
    pub(crate) fn goes_on(self, seen: &Followed) -> Option<Self> {
        let slow = |speed: &Speed| speed.saturating_abs() < seen.slow;
        let rests = seen.speeds.iter().all(slow);
        let [shaft, table] = seen.speeds;
        let more = seen.slow.saturating_mul_int(FASTER);
        let fastest = self.fastest.unwrap_or_else(|| {
            let both = shaft
                .saturating_abs()
                .saturating_add(table.saturating_abs());
            both.saturating_add(more)
        });
        let way = if slow(&table) {
            self.way
        } else {
            table.signum().to_bits()
        };
        let turned_round = self.way != 0 && way != self.way;
        let next = Self {
            left: self.left.checked_sub(1)?,
            rested: if rests {
                self.rested.saturating_add(1)
            } else {
                0
            },
            blind: if seen.counted {
                0
            } else {
                self.blind.saturating_add(seen.turned)
            },
            fastest: Some(fastest),
            way,
            swings: self.swings.saturating_add(turned_round.into()),
            ..self
        };
        let slows = next.swings <= SWINGS && shaft.saturating_abs() <= fastest;
        let sees = seen.adds_up && next.blind <= seen.blind_max && slows;
        (sees && next.rested < RESTED && self.is_healthy(seen.latched)).then_some(next)
    }

    /// What its shaft is asked, electrical rad/s, so that the table rests: it turns with the other.
    pub(crate) fn reference(self, omega_e: Speed, table: Speed) -> Speed {
        // The table goes with the screw, and against the nut.
        if self.motor == 0 {
            omega_e.saturating_sub(table)
        } else {
            omega_e.saturating_add(table)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(shaft: f64, table: f64) -> Followed {
        Followed {
            latched: FaultSet::EMPTY.with(Fault::ScrewEncoder),
            speeds: [shaft, table].map(Speed::from_num),
            slow: Speed::ONE,
            turned: 0,
            adds_up: true,
            counted: true,
            blind_max: 0,
        }
    }

    /// A scale that counts the wrong way asks for more and more speed; with one that is right, both slow down.
    #[test]
    fn a_shaft_that_gets_faster_than_both_were_is_let_go() {
        let latched = FaultSet::EMPTY.with(Fault::ScrewEncoder);
        let begun = Follow::after(Fault::ScrewEncoder, latched, |_| Speed::ZERO).unwrap();
        let begun = begun.goes_on(&seen(100.0, 20.0)).unwrap();

        let last_of = |change: f64| {
            let (mut follow, mut shaft) = (begun, 100.0);
            for _ in 0..1000 {
                shaft += change;
                match follow.goes_on(&seen(shaft, 20.0)) {
                    Some(next) => follow = next,
                    None => return Some(shaft),
                }
            }
            None
        };
        let fastest = 100.0 + 20.0 + f64::from(FASTER);
        assert_eq!(last_of(0.5), Some(fastest + 0.5));
        assert_eq!(last_of(-0.05), None);
    }
}
