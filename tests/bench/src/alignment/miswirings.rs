//! What a person may connect wrongly, and what the drive must say of it.

use super::drawn;
use control::alignment::{Misalignment, Reason};
use control::fault::Part;
use control::sense::Shunts;
use hal_sim::start::Start;
use hal_sim::wiring::{MotorWiring, Wiring};

/// Something connected wrongly, on a machine that is otherwise as drawn.
#[derive(Clone, Debug)]
pub struct Miswiring {
    /// What is wrong, for a person.
    pub name: String,
    /// The drive before it is switched on.
    pub start: Start,
    /// What the drive must find; `None`: harmless by construction, and it must be ready with the right angle.
    pub expected: Option<Misalignment>,
}

/// Every swap and rotation of phases and of current channels, each sign and all, each open phase, encoders reversed and exchanged,
/// and other pole pairs than the plate's: on the screw, on the nut, on machines drawn from `seed` on.
///
/// Harmless is an even permutation of the phases behind the bridge's shunts: a third of an electrical turn, which the
/// offset takes. A permutation of phases and channels together is the same.
#[must_use]
pub fn miswirings(seed: u64) -> Vec<Miswiring> {
    let mut list = List {
        next: seed,
        all: Vec::new(),
    };
    for (k, (part, motor)) in [(Part::Screw, "screw"), (Part::Nut, "nut")]
        .into_iter()
        .enumerate()
    {
        let of = OfMotor { k, part, motor };
        list.add_phases(of);
        for shunts in [Shunts::Two, Shunts::Three] {
            list.add_channels(of, shunts);
        }
        for pairs in [4, 6] {
            list.add(
                format!("{motor}: {pairs} pole pairs on the plate"),
                of.found(Reason::PolePairs),
                |start| start.plate.motors[k].pole_pairs = pairs,
            );
        }
    }
    list.add(
        "encoders exchanged".to_owned(),
        Some(Misalignment {
            part: Part::Pair,
            reason: Reason::Exchanged,
        }),
        |start| start.board.wiring.encoders_exchanged = true,
    );
    list.all
}

/// The motor that is connected wrongly.
#[derive(Clone, Copy)]
struct OfMotor {
    k: usize,
    part: Part,
    motor: &'static str,
}

impl OfMotor {
    fn found(self, reason: Reason) -> Option<Misalignment> {
        let part = self.part;
        Some(Misalignment { part, reason })
    }
}

/// What is wrong so far, each on the machine of the next seed.
struct List {
    next: u64,
    all: Vec<Miswiring>,
}

impl List {
    fn add(
        &mut self,
        name: String,
        expected: Option<Misalignment>,
        change: impl FnOnce(&mut Start),
    ) {
        let mut start = drawn(self.next);
        self.next += 1;
        declare(&mut start);
        change(&mut start);
        self.all.push(Miswiring {
            name,
            start,
            expected,
        });
    }

    /// Phases and encoder, the same with two shunts and three.
    fn add_phases(&mut self, of: OfMotor) {
        let OfMotor { k, motor, .. } = of;
        for (legs, name, expected) in [
            ([1, 0, 2], "a and b swapped", of.found(Reason::Reversed)),
            ([0, 2, 1], "b and c swapped", of.found(Reason::Reversed)),
            ([2, 1, 0], "c and a swapped", of.found(Reason::Reversed)),
            ([1, 2, 0], "one leg on", None),
            ([2, 0, 1], "one leg back", None),
        ] {
            self.add(format!("{motor}: phases {name}"), expected, |start| {
                cables(start, k).legs = legs;
            });
        }
        self.add(
            format!("{motor}: encoder reversed"),
            of.found(Reason::Reversed),
            |start| {
                let cables = cables(start, k);
                cables.encoder_reversed = !cables.encoder_reversed;
            },
        );
    }

    /// Signs and places of the current channels, and open phases.
    fn add_channels(&mut self, of: OfMotor, shunts: Shunts) {
        let OfMotor { k, motor, .. } = of;
        for (signs, name, reason) in [
            ([-1.0, 1.0, 1.0], "sign of a", Reason::SignA),
            ([1.0, -1.0, 1.0], "sign of b", Reason::SignB),
            ([1.0, 1.0, -1.0], "sign of c", Reason::SignC),
            ([-1.0; 3], "all signs", Reason::SignAll),
        ] {
            if shunts == Shunts::Two && reason == Reason::SignC {
                continue;
            }
            self.add(
                format!("{motor}: {name}, {shunts:?} shunts"),
                of.found(reason),
                |start| {
                    measure(start, shunts);
                    cables(start, k).signs = signs;
                },
            );
        }
        for (channels, name, reason) in [
            ([1, 0, 2], "a and b", Reason::ChannelsAb),
            ([0, 2, 1], "b and c", Reason::ChannelsBc),
            ([2, 1, 0], "c and a", Reason::ChannelsCa),
            ([1, 2, 0], "one on", Reason::ChannelsRotated),
            ([2, 0, 1], "one back", Reason::ChannelsRotated),
        ] {
            if shunts == Shunts::Two && reason != Reason::ChannelsAb {
                continue;
            }
            self.add(
                format!("{motor}: current channels {name}, {shunts:?} shunts"),
                of.found(reason),
                |start| {
                    measure(start, shunts);
                    cables(start, k).channels = channels;
                },
            );
        }
        for (open, reason) in [Reason::OpenPhaseA, Reason::OpenPhaseB, Reason::OpenPhaseC]
            .into_iter()
            .enumerate()
        {
            self.add(
                format!("{motor}: phase {open} open, {shunts:?} shunts"),
                of.found(reason),
                |start| {
                    measure(start, shunts);
                    cables(start, k).open = Some(open);
                },
            );
        }
    }
}

/// Everything in its place, and the encoders' directions declared.
fn declare(start: &mut Start) {
    start.board.wiring = Wiring::right();
    for motor in &mut start.plate.motors {
        motor.encoder.reversed = Some(false);
    }
}

/// Both reverse the motor: what the drive has of it fits together, but it turns against the other.
#[must_use]
pub fn turned_round(seed: u64, motor: usize) -> Start {
    let mut start = drawn(seed);
    declare(&mut start);
    let cables = cables(&mut start, motor);
    cables.legs = [1, 0, 2];
    cables.encoder_reversed = !cables.encoder_reversed;
    start
}

fn cables(start: &mut Start, motor: usize) -> &mut MotorWiring {
    &mut start.board.wiring.motors[motor]
}

fn measure(start: &mut Start, shunts: Shunts) {
    start.board.shunts = shunts;
    start.plate.board.shunts = shunts;
}
