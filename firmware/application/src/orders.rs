//! What is asked of the drive's motion, and the soft limits: the speed task hears of it once a millisecond.

use crate::configured::{Configured, STEP_S};
use crate::exchange::{DriveExchange, state};
use control::fault::Fault;
use control::format::{Speed, SpeedChange};
use control::homing::{HomePlan, HomeProgress, Homing};
use control::interlock;
use control::plate::DrivePlate;
use control::rates::STEPS_PER_LOOK;
use control::stream::{Followed, SetPoint, SetPointError, Stream, StreamConfig, StreamProgress};
use control::table_move::{MovePlan, MoveProgress, TableMove};
use control::torque::TorqueCommand;
use control::travel::{Travel as Limits, TravelLook};
use core::sync::atomic::Ordering::Relaxed;
use link::codes::{Demand, FaultSet, State};
use link::message::{Refusal, Travel};
use link::view::DriveView;

/// How long a reset is asked at most, s: a fault whose cause goes later stays, and so does the next one.
const RESET_S: f64 = 0.1;

/// What the drive is asked in a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Asked {
    /// Demanded motion.
    demand: Demand,
    /// New speeds: table velocity, 2^-28 m/s, and base speed, 2^-18 rad/s.
    speeds: Option<[i32; 2]>,
    /// An end switch is looked for, forwards, backwards: it is not a fault.
    homing: [bool; 2],
}

/// What is seen of the drive in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Seen {
    /// What it is doing.
    state: State,
    /// What was found since it last left a fault.
    latched: FaultSet,
    /// The table's scale, counts.
    scale: i32,
    /// The references are at the command.
    arrived: bool,
    /// The end switches are open: ahead of positive velocity, and of negative.
    ends_open: [bool; 2],
}

/// What leads the table.
#[derive(Clone, Copy, Debug)]
enum Lead {
    Move(MovePlan, TableMove),
    Home(HomePlan, Homing),
    Stream(StreamConfig, StreamProgress),
}

impl Lead {
    /// It has yet to begin.
    fn starts(&self) -> bool {
        match self {
            Self::Move(_, motion) => motion.progress() == MoveProgress::Starting,
            Self::Home(_, homing) => homing.progress() == HomeProgress::Starting,
            Self::Stream(_, progress) => *progress == StreamProgress::Waiting,
        }
    }

    /// A stop does not end it any more.
    fn is_over(&self) -> bool {
        match self {
            Self::Move(_, motion) => motion.progress() == MoveProgress::Done,
            Self::Home(_, homing) => !homing.progress().is_underway(),
            Self::Stream(_, progress) => *progress == StreamProgress::Ended,
        }
    }

    fn progress(&self) -> Travel {
        match self {
            Self::Move(_, motion) => match motion.progress() {
                MoveProgress::Starting | MoveProgress::Moving => Travel::Moving,
                MoveProgress::Settling => Travel::Settling,
                MoveProgress::Done => Travel::Done,
                MoveProgress::NotSettled => Travel::NotSettled,
            },
            Self::Home(_, homing) => match homing.progress() {
                HomeProgress::Done(_) => Travel::Homed,
                HomeProgress::NotFound => Travel::SwitchNotFound,
                HomeProgress::NotLeft => Travel::SwitchNotLeft,
                HomeProgress::ScaleStands => Travel::ScaleStands,
                _ => Travel::Homing,
            },
            Self::Stream(_, progress) => match progress {
                StreamProgress::Waiting => Travel::Awaiting,
                StreamProgress::Following => Travel::Following,
                StreamProgress::Ended => Travel::StreamEnded,
            },
        }
    }
}

/// A move, a homing or a stream under way.
#[derive(Clone, Copy, Debug)]
struct Underway {
    lead: Lead,
    base: i32,
    /// What was last asked.
    velocity: i32,
    /// A stop or a fault has ended it.
    ended: bool,
}

/// What is asked of the drive's motion, how far that is, and the soft limits.
#[derive(Clone, Debug)]
pub struct Orders {
    /// Steps until motion is demanded, and of a reset.
    start_steps: u32,
    reset_steps: u32,
    demand: Demand,
    /// Steps that are left of the two.
    left: u32,
    underway: Option<Underway>,
    stream: Stream,
    /// The scale's count at position zero; `None`: the drive is not homed.
    origin: Option<i32>,
    limits: Limits,
}

impl Orders {
    /// Of a drive at rest with that plate. Motion is demanded two looks of the interlock after its command: it forbids a start by its last
    /// look, which must have seen the heartbeat that came with the command.
    #[must_use]
    pub const fn new(plate: &DrivePlate) -> Self {
        Self::every(STEP_S, 2.0 * STEPS_PER_LOOK as f64 * plate.speed_step())
    }

    /// The same with a step each `step_s`. Motion is demanded `start_s` after its command.
    #[allow(
        clippy::float_arithmetic,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss
    )]
    const fn every(step_s: f64, start_s: f64) -> Self {
        Self {
            start_steps: (start_s / step_s + 0.5) as u32,
            reset_steps: (RESET_S / step_s) as u32,
            demand: Demand::Rest,
            left: 0,
            underway: None,
            stream: Stream::closed(),
            origin: None,
            limits: Limits::new(),
        }
    }

    /// Follow these speeds, which the drive allows.
    pub(crate) fn follow(&mut self, words: &DriveExchange, velocity: i32, base: i32) {
        self.end_lead();
        words.ask_speeds(velocity, base);
    }

    /// Push by this torque, which the drive allows.
    pub(crate) fn push(&mut self, words: &DriveExchange, torque: TorqueCommand, base: i32) {
        self.end_lead();
        words.ask_torque(torque, base);
    }

    /// A move that is not done has ended.
    fn end_lead(&mut self) {
        if let Some(underway) = &mut self.underway {
            underway.ended |= !underway.lead.is_over();
        }
    }

    /// Move by that plan from where the scale counts `scale`.
    pub(crate) fn travel(&mut self, words: &DriveExchange, plan: MovePlan, scale: i32, base: i32) {
        self.lead(words, Lead::Move(plan, TableMove::new(scale)), base);
    }

    /// Home by that plan. The drive is homed no longer until that is done.
    pub(crate) fn home(&mut self, words: &DriveExchange, plan: HomePlan, base: i32) {
        self.origin = None;
        self.lead(words, Lead::Home(plan, Homing::default()), base);
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
        self.lead(words, Lead::Stream(config, StreamProgress::Waiting), base);
        self.stream.open(zero, delay_ms);
    }

    /// At a base speed of `base`, 2^-18 rad/s, with no velocity before it begins.
    fn lead(&mut self, words: &DriveExchange, lead: Lead, base: i32) {
        words.ask_speeds(0, base);
        self.underway = Some(Underway {
            lead,
            base,
            velocity: 0,
            ended: false,
        });
        words.travel.store(self.progress().word(), Relaxed);
    }

    /// Takes a set-point that `allows` of the stream's zero, while the scale counts `scale`.
    pub(crate) fn set_point(
        &mut self,
        config: &StreamConfig,
        point: SetPoint,
        scale: i32,
        allows: impl FnOnce(i32) -> bool,
    ) -> Result<Followed, Refusal> {
        match &self.underway {
            Some(Underway {
                lead: Lead::Stream(..),
                ended: false,
                ..
            }) => {}
            _ => return Err(Refusal::NoStream),
        }
        if !allows(self.stream.zero()) {
            return Err(Refusal::SoftLimit);
        }
        self.stream
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
        self.take(demand);
        if matches!(demand, Demand::Rest | Demand::Reset) {
            words.ask(Demand::Rest);
        }
    }

    fn take(&mut self, demand: Demand) {
        let moves = matches!(demand, Demand::Run | Demand::Align);
        // A drive that moves goes on.
        if moves && self.demand == demand && self.left == 0 {
            return;
        }
        self.demand = demand;
        self.left = match demand {
            Demand::Run | Demand::Align => self.start_steps,
            Demand::Rest => 0,
            Demand::Reset => self.reset_steps,
        };
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
        let asked = self.ask(&seen);
        words.ask(asked.demand);
        if let Some([velocity, base]) = asked.speeds {
            words.ask_speeds(velocity, base);
        }
        words.travel.store(self.progress().word(), Relaxed);

        view.homed.store(self.origin.is_some().into(), Relaxed);
        view.origin.store(self.origin.unwrap_or_default(), Relaxed);
        let [speed, change] = words.planned.each_ref().map(|word| word.load(Relaxed));
        let look = TravelLook {
            scale: seen.scale,
            origin: self.origin,
            driven: seen.state.is_driven(),
            reference: (Speed::from_bits(speed), SpeedChange::from_bits(change)),
            asked: words.heading(Speed::from_bits(speed)),
        };
        let travel = self.limits.step(&configured.travel, &look);
        let ways = words.way.as_flattened().iter();
        for (word, value) in ways.zip([travel.blocked, asked.homing].as_flattened()) {
            word.store(*value, Relaxed);
        }
        travel.fault
    }

    /// How the move is going.
    fn progress(&self) -> Travel {
        match &self.underway {
            None => Travel::None,
            Some(underway) if underway.ended => Travel::Ended,
            Some(underway) => underway.lead.progress(),
        }
    }

    /// What the drive is asked next.
    fn ask(&mut self, seen: &Seen) -> Asked {
        let state = seen.state;
        if seen.latched.has_any(FaultSet::DOUBTS_POSITION) {
            self.origin = None;
        }
        // A reset ends with the fault or after its time, an alignment with its end.
        let over = match self.demand {
            Demand::Reset => self.left == 0 || !matches!(state, State::Fault(_)),
            Demand::Align => !matches!(state, State::Unaligned | State::Aligning),
            // A fault takes the demand away: nothing moves again after a reset.
            Demand::Run => matches!(state, State::Fault(_)),
            Demand::Rest => false,
        };
        if over {
            self.demand = Demand::Rest;
        }
        let speeds = self.travel_on(seen);
        let starts = self.left > 0 && matches!(self.demand, Demand::Run | Demand::Align);
        let demand = if starts { Demand::Rest } else { self.demand };
        self.left = self.left.saturating_sub(1);
        let homing = match &self.underway {
            Some(Underway {
                lead: Lead::Home(plan, homing),
                ended: false,
                ..
            }) if homing.progress().is_underway() => plan.seeks(),
            _ => [false; 2],
        };
        Asked {
            demand,
            speeds,
            homing,
        }
    }

    fn travel_on(&mut self, seen: &Seen) -> Option<[i32; 2]> {
        let underway = self.underway.as_mut()?;
        match seen.state {
            State::Running | State::Holding => {}
            State::Ready if underway.lead.starts() => return None,
            _ => {
                underway.ended |= !underway.lead.is_over();
                self.stream.close();
                return None;
            }
        }
        if underway.ended {
            return None;
        }
        let (scale, arrived) = (seen.scale, seen.arrived);
        let velocity = match &mut underway.lead {
            Lead::Move(plan, motion) => motion.step(plan, scale, arrived),
            Lead::Home(plan, homing) => {
                let goes_on = homing.progress().is_underway();
                let velocity = homing.step(plan, scale, arrived, seen.ends_open);
                if let (true, HomeProgress::Done(origin)) = (goes_on, homing.progress()) {
                    self.origin = Some(origin);
                }
                velocity
            }
            Lead::Stream(config, progress) => {
                let goes_on = *progress != StreamProgress::Ended;
                let velocity = self.stream.step(config, scale, arrived);
                *progress = self.stream.progress();
                if goes_on && *progress == StreamProgress::Ended {
                    // The drive's normal stop.
                    self.demand = Demand::Rest;
                }
                velocity
            }
        }
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
    use link::codes::Fault;

    fn steps(orders: &mut Orders, state: State, count: u32) -> u32 {
        let seen = Seen {
            state,
            arrived: true,
            ..Seen::default()
        };
        let asks = |orders: &mut Orders| orders.ask(&seen).demand != Demand::Rest;
        (0..count).map(|_| u32::from(asks(orders))).sum()
    }

    #[test]
    fn a_run_waits_for_the_interlock_s_look_and_a_reset_ends() {
        let mut orders = Orders::every(1e-3, 3e-3);
        orders.take(Demand::Run);
        assert_eq!(steps(&mut orders, State::Ready, 10), 7);
        // A drive that runs is not asked to rest by a second command.
        orders.take(Demand::Run);
        assert_eq!(steps(&mut orders, State::Running, 10), 10);
        orders.take(Demand::Reset);
        let fault = State::Fault(Fault::OverVoltage);
        assert_eq!(steps(&mut orders, fault, 300), 100);
        orders.take(Demand::Reset);
        assert_eq!(steps(&mut orders, State::Ready, 10), 0);
    }

    #[test]
    fn an_alignment_is_demanded_until_it_ends_and_a_fault_takes_each_demand() {
        let mut orders = Orders::every(1e-3, 3e-3);
        orders.take(Demand::Align);
        assert_eq!(steps(&mut orders, State::Unaligned, 10), 7);
        assert_eq!(steps(&mut orders, State::Aligning, 10), 10);
        assert_eq!(steps(&mut orders, State::Ready, 10), 0);
        let fault = State::Fault(Fault::Disabled);
        for (demand, state) in [
            (Demand::Align, State::Aligning),
            (Demand::Run, State::Running),
        ] {
            orders.take(demand);
            assert!(steps(&mut orders, state, 10) > 0);
            assert_eq!(steps(&mut orders, fault, 10), 0);
            assert_eq!(steps(&mut orders, State::Unaligned, 10), 0, "{demand:?}");
            assert_eq!(steps(&mut orders, State::Ready, 10), 0, "{demand:?}");
        }
    }
}
