//! The motor that is left brings the table to rest, once the other's bridge is open for a fault of its own.
//!
//! Left alone the two coast apart, and the table moves by the difference: `J omega^2 / 2` over each one's own friction. A shaft that seizes is
//! the worst of it, a dead encoder looks the same at first, and holding the healthy motor would make the table move by all that the
//! other coasts. The table's scale needs to know neither: the healthy motor's speed loop is asked to leave no velocity of the table,
//! so it brakes beside a shaft that stands and slows down with one that coasts. Its own angle, currents and bridge are not in doubt.
//!
//! It ends, and this bridge opens too, when all is at rest, after [`LONGEST`], with any fault that is not the first motor's, and where the
//! scale says nothing.

use crate::fault::{Fault, FaultSet, Reaction};
use crate::format::Speed;

/// Steps of the speed task that it takes at most: 5 s at 5 kHz, twice what the longest coasts.
const LONGEST: u32 = 25_000;
/// Steps in a row in which all has to be at rest.
const RESTED: u32 = 250;

/// A motor that brings the table to rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Follow {
    /// Which: 0 is the screw's, 1 the nut's.
    motor: usize,
    left: u32,
    rested: u32,
}

impl Follow {
    /// After `first`, with these faults latched: the motor that is left, if there is one that is healthy.
    pub(crate) fn after(first: Fault, latched: FaultSet) -> Option<Self> {
        let faulty = first.motor()?;
        let motor = 1usize.checked_sub(faulty)?;
        let follow = Self {
            motor,
            left: LONGEST,
            rested: 0,
        };
        (first.reaction() == Reaction::Follow && follow.is_healthy(latched)).then_some(follow)
    }

    /// Which motor: 0 is the screw's, 1 the nut's.
    #[inline(always)]
    pub(crate) const fn motor(self) -> usize {
        self.motor
    }

    /// All that is latched is the other motor's.
    fn is_healthy(self, latched: FaultSet) -> bool {
        let [screw, nut] = FaultSet::OF_MOTOR;
        let others = if self.motor == 0 { nut } else { screw };
        latched.without(others).is_empty()
    }

    /// A step, with the speed of its shaft and the table's, as one of the same shaft, and what is slow: it goes on.
    pub(crate) fn goes_on(
        self,
        latched: FaultSet,
        speeds: [Speed; 2],
        slow: Speed,
    ) -> Option<Self> {
        let rests = speeds.iter().all(|speed| speed.saturating_abs() < slow);
        let next = Self {
            left: self.left.checked_sub(1)?,
            rested: if rests {
                self.rested.saturating_add(1)
            } else {
                0
            },
            ..self
        };
        (next.rested < RESTED && self.is_healthy(latched)).then_some(next)
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
