//! The drive's states and the transitions between them.
//!
//! | from | to | when |
//! | --- | --- | --- |
//! | `Boot` | `SelfTest` | at once: the bridges are open, so no current flows |
//! | `SelfTest` | `Unaligned` | both motors' current zeros are measured |
//! | `SelfTest` | `Ready` | and both rotor angles are known |
//! | `Unaligned` | `Aligning` | alignment is demanded |
//! | `Unaligned` | `Ready` | both rotor angles are known |
//! | `Aligning` | `Ready` | both rotors are found: see [`alignment`](crate::alignment) |
//! | `Aligning` | `Unaligned` | the alignment was interrupted, and both motors have stopped |
//! | `Ready` | `Running` | run is demanded |
//! | `Running` | `Holding` | the command is rest or the [`brake`](crate::brake) is not open yet, and both references are there |
//! | `Holding` | `Running` | the command is not rest any more |
//! | `Running`, `Holding` | `Stopping` | run is not demanded any more |
//! | `Stopping` | `Running` | run is demanded again |
//! | `Stopping` | `Ready` | both references are at rest, and the brake holds |
//! | `Ready`, `Unaligned`, `Stopping` | `Fault` | both references have come to rest for a fault that [rests](crate::base::fault::Reaction) |
//! | any but `Fault` | `Fault` | a fault |
//! | `Fault` | `Boot` | the cause of the fault is gone, and a reset is demanded |
//!
//! No other transition exists. [`State::may_become`] is this table. A step that would leave the table stays where it is.
//!
//! No state closes a bridge without a [`Demand`]: after power-up, a reset or an encoder fault the drive waits in `Unaligned` or `Ready`
//! with open bridges (protection against unexpected start-up, ISO 14118). The speed task asks the [`interlock`](crate::interlock)
//! before each of these transitions and while a bridge is closed.

use crate::base::fault::{self, Fault, FaultSet};
use crate::current::current_loop::{Calibration, Mode};
use crate::current::exchange::MotorStatus;
use crate::speed::alignment::Progress;
use crate::watch::interlock::Inputs;

/// What the drive is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    /// Just started; bridges off.
    #[default]
    Boot,
    /// Bridges open, current zeros being measured.
    SelfTest,
    /// Bridges open. The angle of a rotor is not known: alignment must be demanded before a motor can run.
    Unaligned,
    /// Bridges closed for small motion: the rotor angles are being found.
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
            Self::Unaligned => 8,
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
            8 => Self::Unaligned,
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
        use State::{
            Aligning, Boot, Fault, Holding, Ready, Running, SelfTest, Stopping, Unaligned,
        };
        match self {
            Boot => matches!(next, Boot | SelfTest | Fault(_)),
            SelfTest => matches!(next, SelfTest | Unaligned | Ready | Fault(_)),
            Unaligned => matches!(next, Unaligned | Aligning | Ready | Fault(_)),
            Aligning => matches!(next, Aligning | Unaligned | Ready | Fault(_)),
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
            Self::Unaligned => "unaligned",
            Self::Aligning => "aligning",
            Self::Ready => "ready",
            Self::Running => "running",
            Self::Holding => "holding",
            Self::Stopping => "stopping",
            Self::Fault(_) => "fault",
        }
    }
}

/// What the commander demands of the drive's motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum Demand {
    /// Come to rest and open the bridges.
    #[default]
    Rest,
    /// Find the rotor angles. A drive that knows them does nothing.
    Align,
    /// Follow the commanded speeds. A drive that is not aligned does nothing.
    Run,
    /// Come to rest, and leave a fault whose cause is gone.
    Reset,
}

impl Demand {
    /// Its word between two tasks.
    #[must_use]
    #[inline(always)]
    pub const fn word(self) -> u32 {
        self as u32
    }

    /// The demand of a word. A word that is none demands rest.
    #[must_use]
    #[inline(always)]
    pub const fn of_word(word: u32) -> Self {
        match word {
            1 => Self::Align,
            2 => Self::Run,
            3 => Self::Reset,
            _ => Self::Rest,
        }
    }
}

/// Inputs of a step of the speed task.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Request {
    /// Demanded motion.
    pub demand: Demand,
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
        demand: Demand,
        motors: [MotorStatus; 2],
        found: Option<Fault>,
        alignment: Progress,
        at_rest: bool,
    ) -> Self {
        let fault = fault(motors).or(found);
        let angles_known = || motors.iter().all(|motor| motor.angle_known);
        let next = match (self, fault) {
            (Self::Fault(_), None) if demand == Demand::Reset => Self::Boot,
            (Self::Fault(first), _) => Self::Fault(first),
            (_, Some(fault)) => Self::Fault(fault),
            (Self::Boot, None) => Self::SelfTest,
            (Self::SelfTest, None) if motors.iter().all(|m| m.calibration == Calibration::Done) => {
                if angles_known() {
                    Self::Ready
                } else {
                    Self::Unaligned
                }
            }
            (Self::Unaligned, None) if angles_known() => Self::Ready,
            (Self::Unaligned, None) if demand == Demand::Align => Self::Aligning,
            (Self::Aligning, None) => match alignment {
                Progress::Working => Self::Aligning,
                Progress::Interrupted => Self::Unaligned,
                Progress::Failed(failed) => Self::Fault(Fault::misaligned(failed.part)),
                Progress::Done if angles_known() => Self::Ready,
                Progress::Done => Self::Aligning,
            },
            (Self::Ready | Self::Stopping, None) if demand == Demand::Run => Self::Running,
            (Self::Running | Self::Holding, None) if demand != Demand::Run => Self::Stopping,
            (Self::Running | Self::Holding | Self::Stopping, None) => match (self, at_rest) {
                (Self::Stopping, true) => Self::Ready,
                (Self::Stopping, false) => Self::Stopping,
                (_, true) => Self::Holding,
                (_, false) => Self::Running,
            },
            (same, None) => same,
        };
        self.become_if_it_may(next)
    }

    /// What the current loops do in this state.
    #[must_use]
    pub const fn mode(self, demand: Demand) -> Mode {
        match self {
            Self::Fault(_) if matches!(demand, Demand::Reset) => Mode::Reset,
            // So each start has zeros that were just measured.
            Self::SelfTest | Self::Unaligned | Self::Ready => Mode::Calibrate,
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
    use crate::base::fault::Part;
    use crate::speed::alignment::{Misalignment, Reason};
    use std::collections::HashSet;

    const FAULT: State = State::Fault(Fault::NutBreak);

    #[test]
    fn a_motor_is_in_the_fault_that_is_its_own() {
        let of = |first: Fault, latched: &[Fault]| {
            let all = latched
                .iter()
                .fold(FaultSet::EMPTY.with(first), |all, fault| all.with(*fault));
            [0, 1].map(|motor| State::Fault(first).of_motor(motor, all))
        };
        let (screw, nut) = (Fault::ScrewEncoder, Fault::NutBreak);
        assert_eq!(of(screw, &[]), [State::Fault(screw), State::Ready]);
        assert_eq!(of(screw, &[nut]), [State::Fault(screw), State::Fault(nut)]);
        let alone = FaultSet::EMPTY.with(nut);
        assert_eq!(State::Running.of_motor(1, alone), State::Running);
        // Of the pair's faults none is a motor's.
        assert_eq!(of(Fault::CommandLost, &[]), [State::Ready; 2]);
    }

    #[test]
    fn only_the_transitions_of_the_table_exist() {
        use State::{Aligning, Boot, Holding, Ready, Running, SelfTest, Stopping, Unaligned};
        let table = HashSet::from(
            [
                (Boot, SelfTest),
                (SelfTest, Ready),
                (SelfTest, Unaligned),
                (Unaligned, Aligning),
                (Unaligned, Ready),
                (Unaligned, FAULT),
                (Aligning, Unaligned),
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
        let all = [
            Boot, SelfTest, Unaligned, Aligning, Ready, Running, Holding, Stopping, FAULT,
        ];
        for from in all {
            for bits in 0..=u8::MAX {
                let on = |n: u8| bits >> n & 1 == 1;
                let demand = match (on(2), on(3)) {
                    (false, false) => Demand::Rest,
                    (false, true) => Demand::Align,
                    (true, false) => Demand::Run,
                    (true, true) => Demand::Reset,
                };
                let calibration = if on(0) {
                    Calibration::Done
                } else {
                    Calibration::Pending
                };
                let alignment = match (on(5), on(6)) {
                    (false, false) => Progress::Working,
                    (false, true) => Progress::Interrupted,
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
                let to = from.next(demand, [healthy, nut], None, alignment, on(4));
                if to != from {
                    seen.insert(std::format!("{:?}", (from, to)));
                }
            }
        }
        assert_eq!(seen, table);

        // And each that is not among them is refused.
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
        assert_eq!(refused, 72 - 23, "of 72 pairs the table has 23");
    }

    #[test]
    fn the_first_fault_is_kept_and_the_bridges_are_off() {
        let broken = MotorStatus {
            broken: true,
            ..MotorStatus::default()
        };
        let state = State::Running.next(
            Demand::Run,
            [MotorStatus::default(), broken],
            Some(Fault::OverVoltage),
            Progress::Working,
            false,
        );
        assert_eq!(state, FAULT);
        assert_eq!(state.mode(Demand::Rest), Mode::Off);
        for demand in [Demand::Rest, Demand::Align, Demand::Run] {
            let healthy = [MotorStatus::default(); 2];
            let next = state.next(demand, healthy, None, Progress::Working, false);
            assert_eq!(next, FAULT, "only a reset leaves a fault, not {demand:?}");
        }
        let zero = MotorStatus {
            calibration: Calibration::OutOfRange,
            ..MotorStatus::default()
        };
        let rest = Demand::Rest;
        assert_eq!(
            state.next(rest, [zero, broken], None, Progress::Working, true),
            FAULT
        );
        assert_eq!(
            State::SelfTest.next(
                rest,
                [zero, MotorStatus::default()],
                None,
                Progress::Working,
                true
            ),
            State::Fault(Fault::ScrewCurrentZero)
        );
    }

    #[test]
    fn what_the_guard_finds_is_a_fault_until_it_is_gone() {
        let healthy = [MotorStatus::default(); 2];
        let hot = Some(Fault::NutTemperature);
        let state = State::Running.next(Demand::Rest, healthy, hot, Progress::Working, false);
        assert_eq!(state, State::Fault(Fault::NutTemperature));
        let reset = Demand::Reset;
        assert_eq!(
            state.next(reset, healthy, hot, Progress::Working, true),
            state
        );
        assert_eq!(
            state.next(reset, healthy, None, Progress::Working, true),
            State::Boot
        );
    }

    #[test]
    fn words_are_those_of_the_states() {
        use State::{Aligning, Boot, Holding, Ready, Running, SelfTest, Stopping, Unaligned};
        for (word, state) in [
            Boot, SelfTest, Ready, Running, Stopping, FAULT, Aligning, Holding, Unaligned,
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
        assert_eq!(State::of_words(9, 0), None);
    }
}
