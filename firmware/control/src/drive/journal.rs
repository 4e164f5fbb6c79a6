//! What happened, in order, kept across a reset: the last starts, changes of state and faults, each with its time and values.
//!
//! A ring of events that each bear a number and a check, so that it needs no other order: after a reset the newest whole event
//! is found again, and one that the reset cut short is left out. In RAM that no start clears; after power was off its words are
//! noise, which the checks refuse: a false one in 2^32.

use crate::base::fault::{Fault, FaultSet};
use crate::codes;
use crate::drive::supervisor::State;
use crate::plate::{BrakePlate, BridgePlate, MotorPlate};

/// Events that are kept.
pub const EVENTS: usize = 32;

codes! {
    /// What an event is.
    Kind {
        Start = 1, "start", "The drive has started: the code is the reason of its reset.";
        State = 2, "state", "The drive does something else: the code is its state.";
        Fault = 3, "fault", "The first cause of a fault, or of a stop: the code is the fault.";
        Settings = 6, "settings", "Which settings it runs on: the code says which, the value the number of a stored setting that does not fit.";
        Further = 4, "further fault", "What was found besides, after the first cause: the code is the fault.";
        Warning = 5, "warning", "What the drive's settings do not provide for: the code is the warning.";
    }
}

codes! {
    /// What the settings of a drive do not provide for.
    Warning {
        NoBrake = 1, "no brake", "The settings say that the load drives the table back, and that there is no brake: it falls whenever the bridges are off. Fit one (setting brake.fitted), or a counterweight (brake.load_drives_back).";
        ScrewTorque = 2, "screw torque", "The largest torque of the screw motor takes a peak phase current above the one at which its bridge opens: the torque ends in the fault over-current. Lower the setting screw.torque_max_nm, or raise bridge.over_current_a if the board bears it.";
        NutTorque = 3, "nut torque", "The largest torque of the nut motor takes a peak phase current above the one at which its bridge opens: the torque ends in the fault over-current. Lower the setting nut.torque_max_nm, or raise bridge.over_current_a if the board bears it.";
    }
}

impl Warning {
    /// Those of a drive with these motors, screw's and nut's.
    pub fn of(
        motors: [&MotorPlate; 2],
        bridge: &BridgePlate,
        brake: &BrakePlate,
    ) -> impl Iterator<Item = Self> + Clone + use<> {
        let [screw, nut] = motors.map(|motor| motor.phase_current_max() > bridge.over_current_a);
        [
            brake.is_missing().then_some(Self::NoBrake),
            screw.then_some(Self::ScrewTorque),
            nut.then_some(Self::NutTorque),
        ]
        .into_iter()
        .flatten()
    }
}

/// Something that happened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Event {
    /// Counts up from event to event, modulo 2^32.
    pub number: u32,
    /// Since the start, ms.
    pub uptime_ms: u32,
    /// A [`Kind`]'s word.
    pub kind: u32,
    /// What its kind says.
    pub code: u32,
    /// A fault's value and its limit, in the unit of [`Fault::unit`]; 0 where it has none.
    pub values: [i32; 2],
}

impl Event {
    /// FNV-1a over its words, begun with a number that noise in RAM does not have by itself.
    const fn check(&self) -> u32 {
        let [value, limit] = self.values;
        let words = [
            self.number,
            self.uptime_ms,
            self.kind,
            self.code,
            value.cast_unsigned(),
            limit.cast_unsigned(),
        ];
        let (mut hash, mut k) = (0x811c_9dc5u32, 0);
        while k < words.len() {
            #[allow(clippy::indexing_slicing, clippy::arithmetic_side_effects)]
            {
                hash = (hash ^ words[k]).wrapping_mul(0x0100_0193);
                hash ^= hash >> 15;
                k += 1;
            }
        }
        hash
    }
}

/// An event and its check.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
struct Kept {
    event: Event,
    check: u32,
}

/// The ring. All bit patterns are valid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct Journal {
    kept: [Kept; EVENTS],
    /// Number of the next event, once it has been taken up.
    next: u32,
}

impl Journal {
    /// Of a drive's memory, whose words `next` gives in their order.
    #[must_use]
    pub fn of_words(mut next: impl FnMut() -> u32) -> Self {
        let mut journal = Self::new();
        for kept in &mut journal.kept {
            *kept = Kept {
                event: Event {
                    number: next(),
                    uptime_ms: next(),
                    kind: next(),
                    code: next(),
                    values: [next().cast_signed(), next().cast_signed()],
                },
                check: next(),
            };
        }
        journal.take_up();
        journal
    }
}

impl Default for Journal {
    fn default() -> Self {
        Self::new()
    }
}

impl Journal {
    /// Nothing happened yet.
    #[must_use]
    pub const fn new() -> Self {
        const NONE: Kept = Kept {
            event: Event {
                number: 0,
                uptime_ms: 0,
                kind: 0,
                code: 0,
                values: [0; 2],
            },
            check: 0,
        };
        Self {
            kept: [NONE; EVENTS],
            next: 0,
        }
    }

    /// Goes on after a start, with whatever RAM held: what is whole stays.
    pub fn take_up(&mut self) {
        let newest = self
            .whole()
            .map(|event| event.number)
            .reduce(|newest, number| {
                let later = number.wrapping_sub(newest).cast_signed() > 0;
                if later { number } else { newest }
            });
        self.next = newest.map_or(0, |newest| newest.wrapping_add(1));
    }

    /// Adds an event, over the oldest.
    pub fn add(&mut self, uptime_ms: u32, kind: Kind, code: u32, values: [i32; 2]) {
        let event = Event {
            number: self.next,
            uptime_ms,
            kind: kind.word(),
            code,
            values,
        };
        if let Some(slot) = self.kept.get_mut(slot(self.next)) {
            *slot = Kept {
                event,
                check: event.check(),
            };
        }
        self.next = self.next.wrapping_add(1);
    }

    /// The event of that number, if it is still there.
    #[must_use]
    pub fn event(&self, number: u32) -> Option<Event> {
        let kept = self.kept.get(slot(number))?;
        (kept.event.number == number && kept.check == kept.event.check()).then_some(kept.event)
    }

    /// All that are there, the latest first.
    pub fn latest(&self) -> impl Iterator<Item = Event> {
        let back = 1..=EVENTS as u32;
        back.filter_map(|back| self.event(self.next.wrapping_sub(back)))
    }

    fn whole(&self) -> impl Iterator<Item = Event> {
        let kept = self.kept.iter().zip(0..);
        kept.filter(|(kept, at)| slot(kept.event.number) == *at && kept.check == kept.event.check())
            .map(|(kept, _)| kept.event)
    }
}

const fn slot(number: u32) -> usize {
    // EVENTS is a power of two, so that the numbers' wrap leaves no gap.
    number as usize & (EVENTS - 1)
}

const _: () = assert!(EVENTS.is_power_of_two());

/// Writes down what a drive does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Recorder {
    state: Option<u32>,
    written: FaultSet,
}

impl Recorder {
    /// Nothing seen yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            state: None,
            written: FaultSet::EMPTY,
        }
    }

    /// A look at the drive: its state, and what is latched. `values` says what is known of a fault: value and limit.
    pub fn look(
        &mut self,
        journal: &mut Journal,
        uptime_ms: u32,
        state: State,
        latched: FaultSet,
        values: impl Fn(Fault) -> [i32; 2],
    ) {
        // A current loop names its fault itself where the speed task cannot.
        let latched = match state {
            State::Fault(first) => latched.with(first),
            _ => latched,
        };
        let new = latched.without(self.written);
        let begun = !self.written.is_empty();
        self.written = latched;
        if !new.is_empty() {
            let first = match state {
                State::Fault(first) if new.has(first) => Some(first),
                _ => new.iter().next(),
            };
            let first = first.filter(|_| !begun);
            if let Some(first) = first {
                journal.add(uptime_ms, Kind::Fault, first.word(), values(first));
            }
            for fault in new.iter().filter(|fault| Some(*fault) != first) {
                journal.add(uptime_ms, Kind::Further, fault.word(), values(fault));
            }
        }
        let word = state.word();
        if self.state != Some(word) {
            self.state = Some(word);
            journal.add(uptime_ms, Kind::State, word, [0; 2]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn numbers(journal: &Journal) -> Vec<u32> {
        journal.latest().map(|event| event.number).collect()
    }

    proptest! {
        /// However many events there were, after a reset at any of them the last are there and it goes on.
        #[test]
        fn a_reset_loses_nothing(events in 0u32..200, start in any::<u32>()) {
            let mut journal = Journal { next: start, ..Journal::new() };
            for k in 0..events {
                journal.add(k, Kind::State, k, [1, 2]);
            }
            let mut after = Journal { next: 0x5555_5555, ..journal };
            after.take_up();
            prop_assert_eq!(numbers(&after), numbers(&journal));
            prop_assert_eq!(numbers(&after).len(), events.min(EVENTS as u32) as usize);
            if events > 0 {
                prop_assert_eq!(after.next, journal.next);
            }
        }

        /// What RAM holds after power was off is no event, and neither is one that a reset cut short.
        #[test]
        fn noise_is_no_event(words in prop::collection::vec(any::<u32>(), EVENTS), spoiled in 0usize..EVENTS) {
            let mut journal = Journal::new();
            for (kept, word) in journal.kept.iter_mut().zip(words) {
                kept.event = Event { number: word, uptime_ms: word >> 3, kind: 2, code: word & 7, values: [0; 2] };
                kept.check = word;
            }
            journal.take_up();
            prop_assert!(numbers(&journal).is_empty());
            for k in 0..EVENTS as u32 {
                journal.add(k, Kind::State, k, [0; 2]);
            }
            journal.kept[spoiled].event.code ^= 1;
            journal.take_up();
            prop_assert_eq!(numbers(&journal).len(), EVENTS - 1);
        }
    }

    #[test]
    fn the_first_cause_and_the_rest_are_written_in_order() {
        let (mut journal, mut recorder) = (Journal::new(), Recorder::new());
        let first = State::Fault(Fault::ScrewVoltage);
        let one = FaultSet::EMPTY.with(Fault::ScrewVoltage);
        let two = one.with(Fault::OverVoltage);
        let values = |fault| [i32::from(fault == Fault::OverVoltage), 7];
        for (ms, state, latched) in [
            (0, State::Boot, FaultSet::EMPTY),
            (1, State::Running, FaultSet::EMPTY),
            (2, State::Running, FaultSet::EMPTY),
            (3, first, one),
            (4, first, two),
            (5, State::Boot, FaultSet::EMPTY),
            (6, State::Stopping, FaultSet::EMPTY.with(Fault::Disabled)),
            (
                7,
                State::Fault(Fault::Disabled),
                FaultSet::EMPTY.with(Fault::Disabled),
            ),
        ] {
            recorder.look(&mut journal, ms, state, latched, values);
        }
        let mut seen: Vec<_> = journal
            .latest()
            .map(|event| (event.uptime_ms, event.kind, event.code, event.values[0]))
            .collect();
        seen.reverse();
        let (kind, state) = (Kind::word, State::word);
        assert_eq!(
            seen,
            [
                (0, kind(Kind::State), state(State::Boot), 0),
                (1, kind(Kind::State), state(State::Running), 0),
                (3, kind(Kind::Fault), Fault::ScrewVoltage.word(), 0),
                (3, kind(Kind::State), State::FAULT_WORD, 0),
                (4, kind(Kind::Further), Fault::OverVoltage.word(), 1),
                (5, kind(Kind::State), state(State::Boot), 0),
                (6, kind(Kind::Fault), Fault::Disabled.word(), 0),
                (6, kind(Kind::State), state(State::Stopping), 0),
                (7, kind(Kind::State), State::FAULT_WORD, 0),
            ]
        );
    }
}
