//! Conditions for motion: somebody commands, the enable contacts are closed, no end switch is ahead.
//!
//! | condition | violated when | fault |
//! | --- | --- | --- |
//! | command | motion is demanded, and the heartbeat word has not changed for the configured time (a host that hangs, a line that is cut) | `CommandLost` |
//! | enable | motion is demanded, and one of the switch's two contacts is open | `Disabled` |
//! | end switch, run | the table's commanded velocity points towards an open switch; away from it the drive runs | `EndForward`, `EndBackward` |
//! | end switch, alignment | a switch opens that was closed when the alignment began | `EndForward`, `EndBackward` |
//!
//! Each ends in a stop category 1 (IEC 60204-1, 9.2.2): both motors come to rest within their limits, then the bridges open and
//! the fault is reported. Running again takes a reset, so nothing restarts by itself. An end switch must stand as far before
//! the mechanical end as the stop takes: `v^2 / (2 a)` and `v a / (2 j)` with the feed's largest velocity, acceleration and
//! jerk.
//!
//! An alignment moves the table by less than its travel limit in either direction. A table that stands on a switch may therefore be
//! aligned, and then be moved off.
//!
//! While [`homing`](crate::homing) looks for a switch, that switch is not a fault, for homing stops at it. The other one is.
//!
//! The end switches and the enable contacts are normally closed, so that a broken wire stops too (IEC 60204-1, 9.4.3; ISO 13850).
//! A level counts once [`SETTLED`] looks in a row have seen it.

use crate::base::fault::Fault;
use crate::base::format::TableVelocity;

/// Looks in which an input must be seen, 0.8 ms from first to last at 5 kHz: relays bounce that long, and bridges disturb.
pub const SETTLED: u8 = 2;

/// What the inputs say now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Inputs {
    /// The enable switch's two contacts are closed: either that is open forbids to move.
    pub enabled: [bool; 2],
    /// The end switch ahead of positive table velocity is open.
    pub end_forward: bool,
    /// The end switch ahead of negative table velocity is open.
    pub end_backward: bool,
    /// The table may not go on forwards, backwards, for a soft limit is near: it comes to rest before.
    pub blocked: [bool; 2],
    /// An end switch is looked for, forwards, backwards: ahead it is not a fault.
    pub homing: [bool; 2],
    /// What the table moves in a PWM period by its scale, as a turn of screw against nut, 2^-32 turn; `None`: nobody knows.
    pub table_step: Option<i32>,
}

impl Inputs {
    /// All is well: a board without inputs.
    pub const CLEAR: Self = Self {
        enabled: [true; 2],
        end_forward: false,
        end_backward: false,
        blocked: [false; 2],
        homing: [false; 2],
        table_step: None,
    };
}

impl Default for Inputs {
    fn default() -> Self {
        Self::CLEAR
    }
}

/// Motion that the interlock is asked about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Small motion that finds the rotor angles.
    Alignment,
    /// The table follows this velocity.
    Table(TableVelocity),
}

/// State of the interlock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interlock {
    heartbeat: u32,
    /// Looks since it changed.
    silent: u32,
    /// Looks in a row in which each input was against moving: enable, forward end, backward end.
    against: [u8; 3],
    /// An end switch is looked for, forwards, backwards.
    homing: [bool; 2],
    /// End switches that an alignment may find open, forwards, backwards: they were open before it began.
    left_open: [bool; 2],
}

impl Interlock {
    /// Nothing seen yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            heartbeat: 0,
            silent: 0,
            against: [0; 3],
            homing: [false; 2],
            left_open: [false; 2],
        }
    }

    /// An alignment begins: end switches that are open now do not forbid it.
    pub fn begin_alignment(&mut self) {
        let [_, forward, backward] = self.settled();
        self.left_open = [forward, backward];
    }

    /// Each level that has been against motion long enough: enable, forward end, backward end.
    #[inline(always)]
    fn settled(&self) -> [bool; 3] {
        self.against.map(|looks| looks >= SETTLED)
    }

    /// One look: `heartbeat` changes while someone commands.
    #[inline(always)]
    pub fn look(&mut self, heartbeat: u32, inputs: Inputs) {
        self.silent = if heartbeat == self.heartbeat {
            self.silent.saturating_add(1)
        } else {
            self.heartbeat = heartbeat;
            0
        };
        self.homing = inputs.homing;
        let [one, other] = inputs.enabled;
        let levels = [!(one & other), inputs.end_forward, inputs.end_backward];
        for (looks, against) in self.against.iter_mut().zip(levels) {
            *looks = if against {
                looks.saturating_add(1).min(SETTLED)
            } else {
                0
            };
        }
    }

    /// An end switch is open.
    #[must_use]
    pub fn at_an_end(&self) -> bool {
        let [_, forward, backward] = self.against;
        forward.max(backward) >= SETTLED
    }

    /// The condition of `motion` that the last look found violated. The command must be renewed within `heartbeat_looks`.
    #[inline(always)]
    #[must_use]
    pub fn forbids(&self, heartbeat_looks: u32, motion: Motion) -> Option<Fault> {
        let [disabled, forward, backward] = self.settled();
        let [forward_ahead, backward_ahead] = match motion {
            Motion::Alignment => self.left_open.map(|left_open| !left_open),
            Motion::Table(velocity) => {
                let [seeks_forward, seeks_backward] = self.homing;
                [
                    velocity > TableVelocity::ZERO && !seeks_forward,
                    velocity < TableVelocity::ZERO && !seeks_backward,
                ]
            }
        };
        if disabled {
            Some(Fault::Disabled)
        } else if self.silent > heartbeat_looks {
            Some(Fault::CommandLost)
        } else if forward && forward_ahead {
            Some(Fault::EndForward)
        } else if backward && backward_ahead {
            Some(Fault::EndBackward)
        } else {
            None
        }
    }
}

impl Default for Interlock {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOOKS: u32 = 2500;
    const FORWARDS: TableVelocity = TableVelocity::from_bits(1 << 20);
    const BACKWARDS: TableVelocity = TableVelocity::from_bits(-(1 << 20));

    #[test]
    fn a_heartbeat_must_come_while_motion_is_demanded() {
        let mut interlock = Interlock::new();
        let mut step = |beat: u32| {
            interlock.look(beat, Inputs::CLEAR);
            interlock.forbids(LOOKS, Motion::Alignment)
        };
        // Renewed at the last moment, over the word's wrap.
        for beat in (0..6u32).map(|k| k.wrapping_sub(3)) {
            for _ in 0..=LOOKS {
                assert_eq!(step(beat), None);
            }
        }
        assert_eq!(step(2), Some(Fault::CommandLost));
        assert_eq!(step(3), None, "someone is there again");
    }

    #[test]
    fn an_input_counts_once_it_has_settled_and_a_switch_in_its_direction() {
        let well = Inputs::CLEAR;
        let torn = Inputs {
            enabled: [true, false],
            end_forward: true,
            end_backward: true,
            ..Inputs::CLEAR
        };
        for (inputs, velocity, expected) in [
            (torn, TableVelocity::ZERO, Some(Fault::Disabled)),
            (
                Inputs {
                    end_forward: true,
                    ..well
                },
                FORWARDS,
                Some(Fault::EndForward),
            ),
            (
                Inputs {
                    end_forward: true,
                    ..well
                },
                BACKWARDS,
                None,
            ),
            (
                Inputs {
                    end_backward: true,
                    ..well
                },
                BACKWARDS,
                Some(Fault::EndBackward),
            ),
            (
                Inputs {
                    end_backward: true,
                    ..well
                },
                FORWARDS,
                None,
            ),
            (
                Inputs {
                    end_backward: true,
                    ..well
                },
                TableVelocity::ZERO,
                None,
            ),
            (
                Inputs {
                    end_backward: true,
                    homing: [false, true],
                    ..well
                },
                BACKWARDS,
                None,
            ),
            (
                Inputs {
                    end_forward: true,
                    homing: [false, true],
                    ..well
                },
                FORWARDS,
                Some(Fault::EndForward),
            ),
        ] {
            let mut interlock = Interlock::new();
            let mut step = |inputs| {
                interlock.look(0, inputs);
                interlock.forbids(LOOKS, Motion::Table(velocity))
            };
            for _ in 0..10 {
                // It bounces.
                for _ in 1..SETTLED {
                    assert_eq!(step(inputs), None);
                }
                assert_eq!(step(well), None);
            }
            for _ in 1..SETTLED {
                assert_eq!(step(inputs), None);
            }
            assert_eq!(step(inputs), expected, "{inputs:?} at {velocity}");
        }
    }

    #[test]
    fn an_end_switch_that_opens_during_an_alignment_forbids_it() {
        let open = |forward, backward| Inputs {
            end_forward: forward,
            end_backward: backward,
            ..Inputs::CLEAR
        };
        let mut interlock = Interlock::new();
        let mut look = |inputs, begins: bool| {
            for _ in 0..SETTLED {
                interlock.look(0, inputs);
            }
            if begins {
                interlock.begin_alignment();
            }
            interlock.forbids(LOOKS, Motion::Alignment)
        };
        assert_eq!(
            look(open(true, false), true),
            None,
            "it stood on the switch"
        );
        assert_eq!(look(open(false, false), false), None);
        assert_eq!(look(open(true, true), false), Some(Fault::EndBackward));
        assert_eq!(look(open(false, false), true), None);
        assert_eq!(look(open(true, false), false), Some(Fault::EndForward));
    }
}
