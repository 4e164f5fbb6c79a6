//! What is asked of the drive's motion, and the soft limits: the speed task hears of it once a millisecond.

use crate::configured::{Configured, STEP_S};
use crate::exchange::{DriveExchange, state};
use crate::motion::{Motion, Seen};
use control::fault::{Fault, FaultSet};
use control::format::{Speed, SpeedChange};
use control::homing::HomePlan;
use control::interlock;
use control::plate::DrivePlate;
use control::rates::STEPS_PER_LOOK;
use control::stream::{Followed, SetPoint, SetPointError, StreamConfig};
use control::table_move::MovePlan;
use control::torque::TorqueCommand;
use control::travel::{Travel, TravelLook};
use core::sync::atomic::Ordering::Relaxed;
use link::codes::Demand;
use link::message::Refusal;
use link::view::DriveView;

/// The motion and the soft limits.
#[derive(Clone, Debug)]
pub struct Orders {
    motion: Motion,
    travel: Travel,
}

impl Orders {
    /// Of a drive at rest with that plate.
    #[must_use]
    pub const fn new(plate: &DrivePlate) -> Self {
        Self {
            motion: Motion::new(STEP_S, 2.0 * STEPS_PER_LOOK as f64 * plate.speed_step()),
            travel: Travel::new(),
        }
    }

    /// Follow these speeds, which the drive allows.
    pub(crate) fn follow(&mut self, words: &DriveExchange, velocity: i32, base: i32) {
        self.motion.follow();
        words.ask_speeds(velocity, base);
    }

    /// Push by this torque, which the drive allows.
    pub(crate) fn push(&mut self, words: &DriveExchange, torque: TorqueCommand, base: i32) {
        self.motion.follow();
        words.ask_torque(torque, base);
    }

    /// Move by that plan from where the scale counts `scale`.
    pub(crate) fn travel(&mut self, words: &DriveExchange, plan: MovePlan, scale: i32, base: i32) {
        words.ask_speeds(0, base);
        self.motion.travel(plan, scale, base);
        words.travel.store(self.motion.progress().word(), Relaxed);
    }

    /// Home by that plan.
    pub(crate) fn home(&mut self, words: &DriveExchange, plan: HomePlan, base: i32) {
        words.ask_speeds(0, base);
        self.motion.home(plan, base);
        words.travel.store(self.motion.progress().word(), Relaxed);
    }

    /// Follow a stream of positions from where the scale counts `zero`.
    pub(crate) fn stream(
        &mut self,
        words: &DriveExchange,
        config: StreamConfig,
        zero: i32,
        delay_ms: u16,
        base: i32,
    ) {
        words.ask_speeds(0, base);
        self.motion.stream(config, zero, delay_ms, base);
        words.travel.store(self.motion.progress().word(), Relaxed);
    }

    /// Takes a set-point that `allows` of the stream's zero, while the scale counts `scale`.
    pub(crate) fn set_point(
        &mut self,
        config: &StreamConfig,
        point: SetPoint,
        scale: i32,
        allows: impl FnOnce(i32) -> bool,
    ) -> Result<Followed, Refusal> {
        let stream = self.motion.open_stream().ok_or(Refusal::NoStream)?;
        if !allows(stream.zero()) {
            return Err(Refusal::SoftLimit);
        }
        stream
            .push(config, point, scale)
            .map_err(|error| match error {
                SetPointError::Closed => Refusal::NoStream,
                SetPointError::Full => Refusal::StreamFull,
                SetPointError::Spacing => Refusal::Spacing,
                SetPointError::Step => Refusal::Step,
                SetPointError::Velocity => Refusal::Velocity,
            })
    }

    /// Takes a demand. Rest acts at once, and so does what a reset ends.
    pub(crate) fn demand(&mut self, words: &DriveExchange, demand: Demand) {
        self.motion.demand(demand);
        if matches!(demand, Demand::Rest | Demand::Reset) {
            words.ask(Demand::Rest);
        }
    }

    /// Once a millisecond, with what the contacts say: a table that is past its soft limit.
    pub fn step(
        &mut self,
        configured: &Configured,
        words: &DriveExchange,
        view: &DriveView,
        contacts: interlock::Inputs,
    ) -> Option<Fault> {
        let seen = Seen {
            state: state(view),
            latched: FaultSet::of_words(view.latched.each_ref().map(|word| word.load(Relaxed))),
            scale: view.scale.load(Relaxed),
            arrived: words.arrived.load(Relaxed),
            ends_open: [contacts.end_forward, contacts.end_backward],
        };
        let asked = self.motion.step(&seen);
        words.ask(asked.demand);
        if let Some([velocity, base]) = asked.speeds {
            words.ask_speeds(velocity, base);
        }
        words.travel.store(self.motion.progress().word(), Relaxed);

        let origin = self.motion.origin();
        view.homed.store(origin.is_some().into(), Relaxed);
        view.origin.store(origin.unwrap_or_default(), Relaxed);
        let [speed, change] = words.planned.each_ref().map(|word| word.load(Relaxed));
        let look = TravelLook {
            scale: seen.scale,
            origin,
            driven: seen.state.is_driven(),
            reference: (Speed::from_bits(speed), SpeedChange::from_bits(change)),
            asked: words.heading(Speed::from_bits(speed)),
        };
        let travel = self.travel.step(&configured.travel, &look);
        let ways = words.way.as_flattened().iter();
        for (word, value) in ways.zip([travel.blocked, asked.homing].as_flattened()) {
            word.store(*value, Relaxed);
        }
        travel.fault
    }
}
