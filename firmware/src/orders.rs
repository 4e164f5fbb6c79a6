//! What the link asks of the drive's motion: the supervision tells the speed task, once a millisecond.

use crate::PLATE;
use crate::debug_view::{DRIVE_COMMAND, DRIVE_VIEW};
use control::speed_task::STEPS_PER_LOOK;
use control::table_move::MovePlan;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
use link::codes::{Run, State};
use link::motion::Motion;

/// Time from one step to the next, s.
pub(crate) const STEP_S: f64 = 1e-3;

/// The references are at the command; the speed task says so when it looks at its inputs, in less than a millisecond.
pub(crate) static ARRIVED: AtomicBool = AtomicBool::new(false);
/// How the last move is going: a [`Travel`](link::message::Travel)'s word.
pub(crate) static TRAVEL: AtomicU32 = AtomicU32::new(0);

/// The link's motion, and what of it the speed task was last told.
pub struct Orders {
    motion: Motion,
    told: Run,
}

impl Orders {
    pub(crate) const fn new() -> Self {
        Self {
            motion: Motion::new(STEP_S, 2.0 * STEPS_PER_LOOK as f64 * PLATE.speed_step()),
            told: Run::Rest,
        }
    }

    /// Follow these speeds, which the drive allows.
    pub(crate) fn follow(&mut self, velocity: i32, base: i32) {
        self.motion.follow();
        tell_speeds(velocity, base);
    }

    /// Move by that plan.
    pub(crate) fn travel(&mut self, plan: MovePlan, base: i32) {
        tell_speeds(0, base);
        self.motion
            .travel(plan, DRIVE_VIEW.scale.load(Relaxed), base);
        TRAVEL.store(self.motion.progress().word(), Relaxed);
    }

    /// Run, come to rest, or leave a fault.
    pub(crate) fn run(&mut self, run: Run) {
        self.motion.run(run);
        if run != Run::Run {
            // At once, whoever asked it to run.
            self.tell(Run::Rest);
        }
    }

    /// Once a millisecond.
    pub(crate) fn step(&mut self) {
        let view = &DRIVE_VIEW;
        let state = State::of_words(view.state.load(Relaxed), view.fault.load(Relaxed));
        let scale = view.scale.load(Relaxed);
        let asked = self
            .motion
            .step(state.unwrap_or_default(), scale, ARRIVED.load(Relaxed));
        // A debug probe's word stays as long as the link asks nothing new.
        if asked.run != self.told {
            self.tell(asked.run);
        }
        if let Some([velocity, base]) = asked.speeds {
            tell_speeds(velocity, base);
        }
        TRAVEL.store(self.motion.progress().word(), Relaxed);
    }

    fn tell(&mut self, run: Run) {
        self.told = run;
        DRIVE_COMMAND.run.store(run.word(), Relaxed);
    }
}

fn tell_speeds(velocity: i32, base: i32) {
    let command = &DRIVE_COMMAND;
    command.velocity.store(velocity, Relaxed);
    command.base.store(base, Relaxed);
    let next = command.sequence.load(Relaxed).wrapping_add(1);
    command.sequence.store(next, Relaxed);
}
