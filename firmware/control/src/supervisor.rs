//! What the drive is doing and may do next.
//!
//! | from | to | when |
//! | --- | --- | --- |
//! | `Boot` | `SelfTest` | at once: the bridges are off, so no current flows |
//! | `SelfTest` | `Aligning` | both motors' current zeros are measured |
//! | `SelfTest` | `Ready` | and both rotors' angles are known |
//! | `Aligning` | `Ready` | both rotors are found: see [`alignment`](crate::alignment) |
//! | `Ready` | `Running` | run is asked |
//! | `Running` | `Holding` | the command is rest, or a [`brake`](crate::brake) has yet to let go, and both references are there: both motors hold the table |
//! | `Holding` | `Running` | it is not any more |
//! | `Running`, `Holding` | `Stopping` | run is no longer asked |
//! | `Stopping` | `Running` | run is asked again |
//! | `Stopping` | `Ready` | both references have come to rest, and the brake holds |
//! | `Ready`, `Stopping` | `Fault` | both references have come to rest for a fault that [rests](crate::fault::Reaction) |
//! | any but `Fault` | `Fault` | a fault |
//! | `Fault` | `Boot` | the fault's cause is gone and a reset is asked while run is not |
//!
//! No other transition exists: [`State::may_become`] is this table, and a step that would leave it stays where it is.

use crate::alignment::Progress;
use crate::current_loop::{Calibration, Mode};
use crate::exchange::MotorStatus;
use crate::fault::{self, Fault, FaultSet};
use crate::interlock::Inputs;

/// What the drive is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    /// Just started; bridges off.
    #[default]
    Boot,
    /// Bridges off, current zeros being measured.
    SelfTest,
    /// Bridges on for small motion: both rotors being found.
    Aligning,
    /// Bridges off, all is known that running needs; the current zeros are measured again and again.
    Ready,
    /// Bridges on, following the command.
    Running,
    /// Bridges on, both references at rest as is commanded: both motors hold the table.
    Holding,
    /// Bridges on, references going to rest.
    Stopping,
    /// Bridges off until the cause is gone and a reset is asked.
    Fault(Fault),
}

impl State {
    /// Its code in the debug view, where a fault has a word of its own.
    #[must_use]
    pub const fn word(self) -> u32 {
        match self {
            Self::Boot => 0,
            Self::SelfTest => 1,
            Self::Ready => 2,
            Self::Running => 3,
            Self::Stopping => 4,
            Self::Aligning => 6,
            Self::Holding => 7,
            Self::Fault(_) => Self::FAULT_WORD,
        }
    }

    /// The code of every fault.
    pub const FAULT_WORD: u32 = 5;

    /// The fault's word in the debug view: 0 is none.
    #[must_use]
    pub const fn fault_word(self) -> u32 {
        fault::word(self.fault())
    }

    /// The state of two words of the debug view; `None` if there is no such.
    #[must_use]
    pub const fn of_words(state: u32, fault: u32) -> Option<Self> {
        Some(match state {
            0 => Self::Boot,
            1 => Self::SelfTest,
            2 => Self::Ready,
            3 => Self::Running,
            4 => Self::Stopping,
            6 => Self::Aligning,
            7 => Self::Holding,
            Self::FAULT_WORD => match Fault::of_word(fault) {
                Some(fault) => Self::Fault(fault),
                None => return None,
            },
            _ => return None,
        })
    }

    /// The fault that has stopped it.
    #[must_use]
    pub const fn fault(self) -> Option<Fault> {
        match self {
            Self::Fault(fault) => Some(fault),
            _ => None,
        }
    }

    /// Both motors follow their references.
    #[must_use]
    #[inline(always)]
    pub const fn is_driven(self) -> bool {
        matches!(self, Self::Running | Self::Holding | Self::Stopping)
    }

    /// A bridge may be closed.
    #[must_use]
    pub const fn has_bridges_on(self) -> bool {
        self.is_driven() || matches!(self, Self::Aligning)
    }

    /// What one motor does (0 the screw's, 1 the nut's) where the pair does this: a motor is in a fault where one of those that
    /// are latched is its own; the other, whose bridge is open too, is ready.
    #[must_use]
    pub fn of_motor(self, motor: usize, latched: FaultSet) -> Self {
        let own = |fault: &Fault| fault.motor() == Some(motor);
        match self {
            Self::Fault(first) if own(&first) => self,
            Self::Fault(_) => match latched.iter().find(own) {
                Some(fault) => Self::Fault(fault),
                None => Self::Ready,
            },
            other => other,
        }
    }

    /// The table of transitions. A fault is one state, whichever it is; a state may stay.
    #[must_use]
    pub const fn may_become(self, next: Self) -> bool {
        use State::{Aligning, Boot, Fault, Holding, Ready, Running, SelfTest, Stopping};
        match self {
            Boot => matches!(next, Boot | SelfTest | Fault(_)),
            SelfTest => matches!(next, SelfTest | Aligning | Ready | Fault(_)),
            Aligning => matches!(next, Aligning | Ready | Fault(_)),
            Ready => matches!(next, Ready | Running | Fault(_)),
            Running => matches!(next, Running | Holding | Stopping | Fault(_)),
            Holding => matches!(next, Holding | Running | Stopping | Fault(_)),
            Stopping => matches!(next, Stopping | Running | Ready | Fault(_)),
            Fault(_) => matches!(next, Fault(_) | Boot),
        }
    }

    /// `next`, or where it is if the table does not have that transition.
    #[must_use]
    pub const fn become_if_it_may(self, next: Self) -> Self {
        if self.may_become(next) { next } else { self }
    }

    /// Its name in a few words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Boot => "boot",
            Self::SelfTest => "self-test",
            Self::Aligning => "aligning",
            Self::Ready => "ready",
            Self::Running => "running",
            Self::Holding => "holding",
            Self::Stopping => "stopping",
            Self::Fault(_) => "fault",
        }
    }
}

/// What is asked of the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Request {
    /// Run, or come to rest.
    pub run: bool,
    /// Leave a fault.
    pub reset: bool,
    /// Changes while someone commands.
    pub heartbeat: u32,
    /// What the board's inputs say.
    pub inputs: Inputs,
    /// Count of the table's scale, which wraps; `None` where there is none.
    pub scale: Option<u32>,
}

impl State {
    /// The next state, with the fault that the board or its guard has found.
    #[must_use]
    #[inline(always)]
    pub fn next(
        self,
        request: Request,
        motors: [MotorStatus; 2],
        found: Option<Fault>,
        alignment: Progress,
        at_rest: impl Fn() -> bool,
    ) -> Self {
        let fault = fault(motors).or(found);
        let next = match (self, fault) {
            (Self::Fault(_), None) if request.reset && !request.run => Self::Boot,
            (Self::Fault(first), _) => Self::Fault(first),
            (_, Some(fault)) => Self::Fault(fault),
            (Self::Boot, None) => Self::SelfTest,
            (Self::SelfTest, None) if motors.iter().all(|m| m.calibration == Calibration::Done) => {
                if motors.iter().all(|m| m.angle_known) {
                    Self::Ready
                } else {
                    Self::Aligning
                }
            }
            (Self::Aligning, None) => match alignment {
                Progress::Working => Self::Aligning,
                Progress::Failed(failed) => Self::Fault(Fault::misaligned(failed.part)),
                Progress::Done if motors.iter().all(|m| m.angle_known) => Self::Ready,
                Progress::Done => Self::Aligning,
            },
            (Self::Ready | Self::Stopping, None) if request.run => Self::Running,
            (Self::Running | Self::Holding, None) if !request.run => Self::Stopping,
            (Self::Running | Self::Holding, None) if at_rest() => Self::Holding,
            (Self::Holding, None) => Self::Running,
            (Self::Stopping, None) if at_rest() => Self::Ready,
            (same, None) => same,
        };
        self.become_if_it_may(next)
    }

    /// What the current loops do in this state.
    #[must_use]
    pub const fn mode(self, request: Request) -> Mode {
        match self {
            Self::Fault(_) if request.reset && !request.run => Mode::Reset,
            // So each start has zeros that were just measured.
            Self::SelfTest | Self::Ready => Mode::Calibrate,
            Self::Aligning | Self::Running | Self::Holding | Self::Stopping => Mode::Drive,
            Self::Boot | Self::Fault(_) => Mode::Off,
        }
    }
}

/// The first fault, in the order of what is likelier to be the cause of the others.
fn fault([screw, nut]: [MotorStatus; 2]) -> Option<Fault> {
    // All flags of both at once: they are bits of two words, and nearly always there is none.
    let any = |motor: MotorStatus| {
        motor.broken
            | motor.over_current
            | (motor.calibration == Calibration::OutOfRange)
            | motor.encoder_stuck
            | motor.reference_stale
    };
    if any(screw) | any(nut) {
        first_fault([screw, nut])
    } else {
        None
    }
}

#[cold]
#[inline(never)]
fn first_fault(motors: [MotorStatus; 2]) -> Option<Fault> {
    said(motors).find_map(|(said, fault)| said.then_some(fault))
}

/// All that the current loops say.
#[must_use]
pub fn faults(motors: [MotorStatus; 2]) -> FaultSet {
    said(motors).fold(
        FaultSet::EMPTY,
        |set, (said, fault)| {
            if said { set.with(fault) } else { set }
        },
    )
}

/// What the current loops say and do not, the likelier cause of the others first.
fn said([screw, nut]: [MotorStatus; 2]) -> impl Iterator<Item = (bool, Fault)> {
    let zero_is_off = |motor: MotorStatus| motor.calibration == Calibration::OutOfRange;
    [
        (screw.broken, Fault::ScrewBreak),
        (nut.broken, Fault::NutBreak),
        (screw.over_current, Fault::ScrewOverCurrent),
        (nut.over_current, Fault::NutOverCurrent),
        (zero_is_off(screw), Fault::ScrewCurrentZero),
        (zero_is_off(nut), Fault::NutCurrentZero),
        (screw.encoder_stuck, Fault::ScrewEncoder),
        (nut.encoder_stuck, Fault::NutEncoder),
        (
            screw.reference_stale || nut.reference_stale,
            Fault::SpeedTaskLate,
        ),
    ]
    .into_iter()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::alignment::{Misalignment, Part, Reason};
    use std::collections::HashSet;

    const FAULT: State = State::Fault(Fault::NutBreak);

    #[test]
    fn only_the_transitions_of_the_table_exist() {
        use State::{Aligning, Boot, Holding, Ready, Running, SelfTest, Stopping};
        let table = HashSet::from(
            [
                (Boot, SelfTest),
                (SelfTest, Ready),
                (SelfTest, Aligning),
                (Aligning, Ready),
                (Aligning, FAULT),
                (Aligning, State::Fault(Fault::ScrewAlignment)),
                (Ready, Running),
                (Running, Stopping),
                (Running, Holding),
                (Holding, Running),
                (Holding, Stopping),
                (Holding, FAULT),
                (Stopping, Running),
                (Stopping, Ready),
                (Boot, FAULT),
                (SelfTest, FAULT),
                (Ready, FAULT),
                (Running, FAULT),
                (Stopping, FAULT),
                (FAULT, Boot),
            ]
            .map(|pair| std::format!("{pair:?}")),
        );
        let mut seen = HashSet::new();
        for from in [
            Holding, Boot, SelfTest, Aligning, Ready, Running, Stopping, FAULT,
        ] {
            for bits in 0..=u8::MAX {
                let on = |n: u8| bits >> n & 1 == 1;
                let calibration = if on(0) {
                    Calibration::Done
                } else {
                    Calibration::Pending
                };
                let alignment = match (on(5), on(6)) {
                    (false, _) => Progress::Working,
                    (true, false) => Progress::Done,
                    (true, true) => Progress::Failed(Misalignment {
                        part: Part::Screw,
                        reason: Reason::Held,
                    }),
                };
                let healthy = MotorStatus {
                    calibration,
                    angle_known: on(7),
                    ..MotorStatus::default()
                };
                let nut = MotorStatus {
                    broken: on(1),
                    ..healthy
                };
                let to = from.next(
                    Request {
                        run: on(2),
                        reset: on(3),
                        ..Request::default()
                    },
                    [healthy, nut],
                    None,
                    alignment,
                    || on(4),
                );
                if to != from {
                    seen.insert(std::format!("{:?}", (from, to)));
                }
            }
        }
        assert_eq!(seen, table);

        // And each that is not among them is refused.
        let all = [
            Boot, SelfTest, Aligning, Ready, Running, Holding, Stopping, FAULT,
        ];
        let mut refused = 0;
        for from in all {
            for to in all.into_iter().filter(|to| *to != from) {
                let allowed = table.contains(&std::format!("{:?}", (from, to)));
                assert_eq!(from.may_become(to), allowed, "{from:?} to {to:?}");
                let then = from.become_if_it_may(to);
                assert_eq!(then, if allowed { to } else { from });
                refused += usize::from(!allowed);
            }
        }
        assert_eq!(refused, 56 - 19, "of 56 pairs the table has 19");
    }

    #[test]
    fn the_first_fault_is_kept_and_the_bridges_are_off() {
        let broken = MotorStatus {
            broken: true,
            ..MotorStatus::default()
        };
        let state = State::Running.next(
            Request {
                run: true,
                reset: true,
                ..Request::default()
            },
            [MotorStatus::default(), broken],
            Some(Fault::OverVoltage),
            Progress::Working,
            || false,
        );
        assert_eq!(state, FAULT);
        assert_eq!(state.mode(Request::default()), Mode::Off);
        let still_asked = Request {
            run: true,
            reset: true,
            ..Request::default()
        };
        assert_eq!(
            state.next(
                still_asked,
                [MotorStatus::default(); 2],
                None,
                Progress::Working,
                || false
            ),
            FAULT,
            "a reset while run is asked"
        );
        let zero = MotorStatus {
            calibration: Calibration::OutOfRange,
            ..MotorStatus::default()
        };
        let asked = Request::default();
        assert_eq!(
            state.next(asked, [zero, broken], None, Progress::Working, || true),
            FAULT
        );
        assert_eq!(
            State::SelfTest.next(
                asked,
                [zero, MotorStatus::default()],
                None,
                Progress::Working,
                || true
            ),
            State::Fault(Fault::ScrewCurrentZero)
        );
    }

    #[test]
    fn what_the_guard_finds_is_a_fault_until_it_is_gone() {
        let healthy = [MotorStatus::default(); 2];
        let hot = Some(Fault::NutTemperature);
        let state =
            State::Running.next(Request::default(), healthy, hot, Progress::Working, || {
                false
            });
        assert_eq!(state, State::Fault(Fault::NutTemperature));
        let reset = Request {
            run: false,
            reset: true,
            ..Request::default()
        };
        assert_eq!(
            state.next(reset, healthy, hot, Progress::Working, || true),
            state
        );
        assert_eq!(
            state.next(reset, healthy, None, Progress::Working, || true),
            State::Boot
        );
    }

    #[test]
    fn words_are_those_of_the_states() {
        use State::{Aligning, Boot, Holding, Ready, Running, SelfTest, Stopping};
        for (word, state) in [
            Boot, SelfTest, Ready, Running, Stopping, FAULT, Aligning, Holding,
        ]
        .into_iter()
        .enumerate()
        {
            assert_eq!(state.word() as usize, word);
            assert_eq!(
                State::of_words(state.word(), state.fault_word()),
                Some(state)
            );
        }
        assert_eq!(State::of_words(State::FAULT_WORD, 0), None);
        assert_eq!(State::of_words(8, 0), None);
    }
}
