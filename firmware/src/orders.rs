//! What the link asks of the drive's motion: the supervision tells the speed task, once a millisecond.

use crate::config::{PLATE, configured};
use crate::debug_view::{DRIVE_VIEW, count};
use control::fault::{Fault, FaultSet};
use control::format::{Speed, SpeedChange, TableVelocity};
use control::homing::HomePlan;
use control::interlock;
use control::rates::STEPS_PER_LOOK;
use control::table_move::MovePlan;
use control::travel::{Travel, TravelLook};
use core::sync::atomic::{AtomicBool, AtomicI32, AtomicU32, Ordering::Relaxed};
use link::codes::{Demand, State};
use link::motion::{Motion, Seen};

/// Time from one step to the next, s.
pub(crate) const STEP_S: f64 = 1e-3;

/// The commander's words, from the code below the tasks to the speed task. Each word has one writer: the supervision's lock orders
/// those of the speeds and the demand.
pub(crate) struct Commanded {
    /// Table velocity, 2^-28 m/s.
    pub(crate) velocity: AtomicI32,
    /// Common speed, 2^-18 rad/s, mechanical.
    pub(crate) base: AtomicI32,
    /// Counts new speeds: the speed task takes the two words above with each.
    pub(crate) sequence: AtomicU32,
    /// A [`Demand`]'s word.
    pub(crate) demand: AtomicU32,
    /// Changes while the commander is there.
    pub(crate) heartbeat: AtomicU32,
}

/// See [`Commanded`].
pub(crate) static COMMANDED: Commanded = Commanded {
    velocity: AtomicI32::new(0),
    base: AtomicI32::new(0),
    sequence: AtomicU32::new(0),
    demand: AtomicU32::new(Demand::Rest.word()),
    heartbeat: AtomicU32::new(0),
};

/// The references are at the command; the speed task says so when it looks at its inputs, in less than a millisecond.
pub(crate) static ARRIVED: AtomicBool = AtomicBool::new(false);
/// The table's reference and its change a step, as it is planned; the speed task says them with that.
pub(crate) static PLANNED: [AtomicI32; 2] = [const { AtomicI32::new(0) }; 2];
/// What the speed task hears of the table's way: it may not go forwards, backwards; an end switch is looked for,
/// forwards, backwards.
static WAY: [[AtomicBool; 2]; 2] = [const { [const { AtomicBool::new(false) }; 2] }; 2];
/// How the last move or homing is going: a [`Travel`](link::message::Travel)'s word.
pub(crate) static TRAVEL: AtomicU32 = AtomicU32::new(0);

/// What the table moves in a period by its scale; see [`interlock::Inputs::table_step`]. The least word: nobody knows.
static TABLE_STEP: AtomicI32 = AtomicI32::new(i32::MIN);

/// What the supervision sees of the table.
pub(crate) fn tell_table(step: Option<i32>) {
    TABLE_STEP.store(step.unwrap_or(i32::MIN), Relaxed);
}

/// What the contacts say, with what the orders say of the table's way.
#[inline(always)]
pub(crate) fn with_way(inputs: interlock::Inputs) -> interlock::Inputs {
    let [blocked, homing] = WAY
        .each_ref()
        .map(|both| both.each_ref().map(|way| way.load(Relaxed)));
    interlock::Inputs {
        blocked,
        homing,
        table_step: Some(TABLE_STEP.load(Relaxed)).filter(|step| *step != i32::MIN),
        ..inputs
    }
}

/// The link's motion and the soft limits.
pub struct Orders {
    motion: Motion,
    travel: Travel,
}

impl Orders {
    pub(crate) const fn new() -> Self {
        Self {
            motion: Motion::new(STEP_S, 2.0 * STEPS_PER_LOOK as f64 * PLATE.speed_step()),
            travel: Travel::new(),
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

    /// Home by that plan.
    pub(crate) fn home(&mut self, plan: HomePlan, base: i32) {
        tell_speeds(0, base);
        self.motion.home(plan, base);
        TRAVEL.store(self.motion.progress().word(), Relaxed);
    }

    /// Takes a demand. Rest acts at once, and so does what a reset ends.
    pub(crate) fn demand(&mut self, demand: Demand) {
        self.motion.demand(demand);
        if matches!(demand, Demand::Rest | Demand::Reset) {
            tell(Demand::Rest);
        }
    }

    /// Once a millisecond, with what the contacts say: a table that is past its soft limit.
    pub(crate) fn step(&mut self, inputs: interlock::Inputs) -> Option<Fault> {
        let view = &DRIVE_VIEW;
        let state = State::of_words(view.state.load(Relaxed), view.fault.load(Relaxed));
        let seen = Seen {
            state: state.unwrap_or_default(),
            latched: FaultSet::of_words(view.latched.each_ref().map(|word| word.load(Relaxed))),
            scale: view.scale.load(Relaxed),
            arrived: ARRIVED.load(Relaxed),
            ends_open: [inputs.end_forward, inputs.end_backward],
        };
        let asked = self.motion.step(&seen);
        tell(asked.demand);
        if let Some([velocity, base]) = asked.speeds {
            tell_speeds(velocity, base);
        }
        TRAVEL.store(self.motion.progress().word(), Relaxed);

        let origin = self.motion.origin();
        view.homed.store(origin.is_some().into(), Relaxed);
        view.origin.store(origin.unwrap_or_default(), Relaxed);
        let [speed, change] = PLANNED.each_ref().map(|word| word.load(Relaxed));
        let look = TravelLook {
            scale: seen.scale,
            origin,
            driven: seen.state.is_driven(),
            reference: (Speed::from_bits(speed), SpeedChange::from_bits(change)),
            asked: TableVelocity::from_bits(COMMANDED.velocity.load(Relaxed)),
        };
        let travel = self.travel.step(&configured().travel, &look);
        let ways = WAY.as_flattened().iter();
        for (word, value) in ways.zip([travel.blocked, asked.homing].as_flattened()) {
            word.store(*value, Relaxed);
        }
        travel.fault
    }
}

fn tell(demand: Demand) {
    COMMANDED.demand.store(demand.word(), Relaxed);
}

fn tell_speeds(velocity: i32, base: i32) {
    COMMANDED.velocity.store(velocity, Relaxed);
    COMMANDED.base.store(base, Relaxed);
    count(&COMMANDED.sequence);
}
