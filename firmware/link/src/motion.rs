//! What the link asks of a drive's motion, step by step: one body for the firmware and the simulated drive.
//!
//! A step is made at a fixed rate: that of the speed task, or slower.

use crate::codes::{Run, State};
use crate::message::Travel;
use control::table_move::{MovePlan, MoveProgress, TableMove};

/// How long a reset is asked at most, s: a fault whose cause goes later stays, and so does the next one.
const RESET_S: f64 = 0.1;

/// What the drive is asked in a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Asked {
    /// Run, rest, or leave a fault.
    pub run: Run,
    /// New speeds: table velocity, 2^-28 m/s, and base speed, 2^-18 rad/s.
    pub speeds: Option<[i32; 2]>,
}

/// A move under way.
#[derive(Clone, Copy, Debug)]
struct Underway {
    plan: MovePlan,
    motion: TableMove,
    base: i32,
    /// What was last asked.
    velocity: i32,
    /// A stop or a fault has ended it.
    ended: bool,
}

/// What is asked of the drive's motion, and how far that is.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// Steps until a run is asked, and of a reset.
    start_steps: u32,
    reset_steps: u32,
    run: Run,
    /// Steps that are left of the two.
    left: u32,
    underway: Option<Underway>,
}

impl Motion {
    /// Of a drive at rest. A run is asked `start_s` after it was commanded: the interlock forbids a start by its last look,
    /// which must have seen the heartbeat that came with the command.
    #[must_use]
    #[allow(
        clippy::float_arithmetic,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss
    )]
    pub const fn new(step_s: f64, start_s: f64) -> Self {
        Self {
            start_steps: (start_s / step_s + 0.5) as u32,
            reset_steps: (RESET_S / step_s) as u32,
            run: Run::Rest,
            left: 0,
            underway: None,
        }
    }

    /// Runs, comes to rest, or leaves a fault.
    pub fn run(&mut self, run: Run) {
        // A drive that runs goes on.
        if run == Run::Run && self.run == Run::Run && self.left == 0 {
            return;
        }
        self.run = run;
        self.left = match run {
            Run::Run => self.start_steps,
            Run::Rest => 0,
            Run::Reset => self.reset_steps,
        };
    }

    /// The drive follows speeds from now on: a move that is not done has ended.
    pub fn follow(&mut self) {
        if let Some(underway) = &mut self.underway {
            underway.ended |= underway.motion.progress() != MoveProgress::Done;
        }
    }

    /// Moves the table from where its scale counts `scale`, at a base speed of `base`, 2^-18 rad/s, which it was asked with no
    /// velocity.
    pub fn travel(&mut self, plan: MovePlan, scale: i32, base: i32) {
        self.underway = Some(Underway {
            plan,
            motion: TableMove::new(scale),
            base,
            velocity: 0,
            ended: false,
        });
    }

    /// How the move is going.
    #[must_use]
    pub fn progress(&self) -> Travel {
        match &self.underway {
            None => Travel::None,
            Some(underway) if underway.ended => Travel::Ended,
            Some(underway) => match underway.motion.progress() {
                MoveProgress::Starting | MoveProgress::Moving => Travel::Moving,
                MoveProgress::Settling => Travel::Settling,
                MoveProgress::Done => Travel::Done,
                MoveProgress::NotSettled => Travel::NotSettled,
            },
        }
    }

    /// A move needs to know whether the references have arrived.
    #[must_use]
    pub fn moves(&self) -> bool {
        self.underway.is_some_and(|underway| !underway.ended)
    }

    /// One step: what the drive is doing, the count of the table's scale, and whether the references are at the command.
    pub fn step(&mut self, state: State, scale: i32, arrived: bool) -> Asked {
        let run = match self.run {
            Run::Run if self.left > 0 => Run::Rest,
            Run::Reset if self.left == 0 || !matches!(state, State::Fault(_)) => {
                self.run = Run::Rest;
                Run::Rest
            }
            run => run,
        };
        self.left = self.left.saturating_sub(1);
        Asked {
            run,
            speeds: self.travel_on(state, scale, arrived),
        }
    }

    fn travel_on(&mut self, state: State, scale: i32, arrived: bool) -> Option<[i32; 2]> {
        let underway = self.underway.as_mut()?;
        match state {
            State::Running | State::Holding => {}
            // It has not begun.
            State::Ready if underway.motion.progress() == MoveProgress::Starting => return None,
            _ => {
                underway.ended |= underway.motion.progress() != MoveProgress::Done;
                return None;
            }
        }
        if underway.ended {
            return None;
        }
        let velocity = underway
            .motion
            .step(&underway.plan, scale, arrived)
            .to_bits();
        if velocity == underway.velocity {
            return None;
        }
        underway.velocity = velocity;
        Some([velocity, underway.base])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codes::Fault;

    fn steps(motion: &mut Motion, state: State, count: u32) -> u32 {
        let asks = |motion: &mut Motion| motion.step(state, 0, true).run != Run::Rest;
        (0..count).map(|_| u32::from(asks(motion))).sum()
    }

    #[test]
    fn a_run_waits_for_the_interlock_s_look_and_a_reset_ends() {
        let mut motion = Motion::new(1e-3, 3e-3);
        motion.run(Run::Run);
        assert_eq!(steps(&mut motion, State::Ready, 10), 7);
        // A drive that runs is not asked to rest by a second command.
        motion.run(Run::Run);
        assert_eq!(steps(&mut motion, State::Running, 10), 10);
        motion.run(Run::Reset);
        let fault = State::Fault(Fault::OverVoltage);
        assert_eq!(steps(&mut motion, fault, 300), 100);
        motion.run(Run::Reset);
        assert_eq!(steps(&mut motion, State::Ready, 10), 0);
    }
}
