//! What the link asks of a drive's motion, step by step: one body for the firmware and the simulated drive.
//!
//! A step is made at a fixed rate: that of the speed task, or slower.

use control::homing::{HomePlan, HomeProgress, Homing};
use control::stream::{Stream, StreamConfig, StreamProgress};
use control::table_move::{MovePlan, MoveProgress, TableMove};
use link::codes::{Demand, FaultSet, State};
use link::message::Travel;

/// How long a reset is asked at most, s: a fault whose cause goes later stays, and so does the next one.
const RESET_S: f64 = 0.1;

/// What the drive is asked in a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Asked {
    /// Demanded motion.
    pub demand: Demand,
    /// New speeds: table velocity, 2^-28 m/s, and base speed, 2^-18 rad/s.
    pub speeds: Option<[i32; 2]>,
    /// An end switch is looked for, forwards, backwards: it is not a fault.
    pub homing: [bool; 2],
}

/// What is seen of the drive in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// What it is doing.
    pub state: State,
    /// What was found since it last left a fault.
    pub latched: FaultSet,
    /// The table's scale, counts.
    pub scale: i32,
    /// The references are at the command.
    pub arrived: bool,
    /// The end switches are open: ahead of positive velocity, and of negative.
    pub ends_open: [bool; 2],
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

/// What is asked of the drive's motion, and how far that is.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Steps until motion is demanded, and of a reset.
    start_steps: u32,
    reset_steps: u32,
    demand: Demand,
    /// Steps that are left of the two.
    left: u32,
    underway: Option<Underway>,
    stream: Stream,
    /// The scale's count at position zero.
    origin: Option<i32>,
}

impl Motion {
    /// Of a drive at rest. Motion is demanded `start_s` after its command: the interlock forbids a start by its last look,
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
            demand: Demand::Rest,
            left: 0,
            underway: None,
            stream: Stream::closed(),
            origin: None,
        }
    }

    /// Takes a demand from the commander.
    pub fn demand(&mut self, demand: Demand) {
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

    /// The drive follows speeds from now on: a move that is not done has ended.
    pub fn follow(&mut self) {
        if let Some(underway) = &mut self.underway {
            underway.ended |= !underway.lead.is_over();
        }
    }

    /// Moves the table from where its scale counts `scale`, at a base speed of `base`, 2^-18 rad/s, which it was asked with no
    /// velocity.
    pub fn travel(&mut self, plan: MovePlan, scale: i32, base: i32) {
        self.lead(Lead::Move(plan, TableMove::new(scale)), base);
    }

    /// Homes the table, at a base speed of `base`, which it was asked with no velocity. It is homed no longer until that is done.
    pub fn home(&mut self, plan: HomePlan, base: i32) {
        self.origin = None;
        self.lead(Lead::Home(plan, Homing::default()), base);
    }

    /// Follows a stream of positions from where the scale counts `zero`, at a base speed of `base`, which it was asked with no velocity.
    pub fn stream(&mut self, config: StreamConfig, zero: i32, delay_ms: u16, base: i32) {
        self.lead(Lead::Stream(config, StreamProgress::Waiting), base);
        self.stream.open(zero, delay_ms);
    }

    /// The stream; `None`: none is open.
    pub fn open_stream(&mut self) -> Option<&mut Stream> {
        match &self.underway {
            Some(Underway {
                lead: Lead::Stream(..),
                ended: false,
                ..
            }) => Some(&mut self.stream),
            _ => None,
        }
    }

    fn lead(&mut self, lead: Lead, base: i32) {
        self.underway = Some(Underway {
            lead,
            base,
            velocity: 0,
            ended: false,
        });
    }

    /// The scale's count at position zero; `None`: the drive is not homed.
    #[must_use]
    pub const fn origin(&self) -> Option<i32> {
        self.origin
    }

    /// How the move is going.
    #[must_use]
    pub fn progress(&self) -> Travel {
        match &self.underway {
            None => Travel::None,
            Some(underway) if underway.ended => Travel::Ended,
            Some(underway) => underway.lead.progress(),
        }
    }

    /// One step.
    pub fn step(&mut self, seen: &Seen) -> Asked {
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

    fn steps(motion: &mut Motion, state: State, count: u32) -> u32 {
        let seen = Seen {
            state,
            arrived: true,
            ..Seen::default()
        };
        let asks = |motion: &mut Motion| motion.step(&seen).demand != Demand::Rest;
        (0..count).map(|_| u32::from(asks(motion))).sum()
    }

    #[test]
    fn a_run_waits_for_the_interlock_s_look_and_a_reset_ends() {
        let mut motion = Motion::new(1e-3, 3e-3);
        motion.demand(Demand::Run);
        assert_eq!(steps(&mut motion, State::Ready, 10), 7);
        // A drive that runs is not asked to rest by a second command.
        motion.demand(Demand::Run);
        assert_eq!(steps(&mut motion, State::Running, 10), 10);
        motion.demand(Demand::Reset);
        let fault = State::Fault(Fault::OverVoltage);
        assert_eq!(steps(&mut motion, fault, 300), 100);
        motion.demand(Demand::Reset);
        assert_eq!(steps(&mut motion, State::Ready, 10), 0);
    }

    #[test]
    fn an_alignment_is_demanded_until_it_ends_and_a_fault_takes_each_demand() {
        let mut motion = Motion::new(1e-3, 3e-3);
        motion.demand(Demand::Align);
        assert_eq!(steps(&mut motion, State::Unaligned, 10), 7);
        assert_eq!(steps(&mut motion, State::Aligning, 10), 10);
        assert_eq!(steps(&mut motion, State::Ready, 10), 0);
        let fault = State::Fault(Fault::Disabled);
        for (demand, state) in [
            (Demand::Align, State::Aligning),
            (Demand::Run, State::Running),
        ] {
            motion.demand(demand);
            assert!(steps(&mut motion, state, 10) > 0);
            assert_eq!(steps(&mut motion, fault, 10), 0);
            assert_eq!(steps(&mut motion, State::Unaligned, 10), 0, "{demand:?}");
            assert_eq!(steps(&mut motion, State::Ready, 10), 0, "{demand:?}");
        }
    }
}
