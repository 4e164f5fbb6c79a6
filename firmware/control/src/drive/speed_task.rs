//! The speed task: supervisor, coordinator and both speed loops in one step.

use crate::base::fault::{self, Fault, FaultSet};
use crate::base::format::{
    Angle, Current, MechanicalSpeed, Speed, SpeedChange, TableVelocity, narrow,
};
use crate::base::rates::STEPS_PER_LOOK;
use crate::base::tolerance::Tally;
use crate::current::current_loop::{CurrentLoopConfig, CurrentReference, Mode};
use crate::current::exchange::{MotorExchange, MotorStatus};
use crate::current::observer::EncoderAlignment;
use crate::drive::rejection::{Rejected, Rejection};
use crate::drive::supervisor::{Demand, Request, State, faults};
use crate::plate::DriveConfig;
use crate::speed::alignment::{Alignment, AlignmentStep, Misalignment, MotorSeen, Progress};
use crate::speed::brake::Brake;
use crate::speed::compensation::{Compensation, Turning};
use crate::speed::coordinator::{Command, CommandError, Coordinator, Following};
use crate::speed::current_limit::CurrentRange;
use crate::speed::speed_loop::{SpeedLoop, SpeedLoopOutput, SpeedReference};
use crate::speed::table_speed::Reading;
use crate::speed::thermal::Heat;
use crate::speed::torque::TorqueCommand;
use crate::watch::active_limit::{ActiveLimits, Limit};
use crate::watch::follow::{Follow, Followed};
use crate::watch::interlock::{self, Interlock};
use crate::watch::runaway::{CurrentSum, Motion, Runaway, RunawayConfig, Sign, sum_events};
use core::hint::cold_path;

/// What the speed task decided in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpeedTaskOutput {
    /// For the current loops: screw, nut.
    pub current: [CurrentReference; 2],
    /// What the motors shall do: screw, nut.
    pub speed: [SpeedReference; 2],
    /// What the drive is doing.
    pub state: State,
}

/// What is asked, and what of it is followed.
#[derive(Clone, Copy, Debug)]
struct Commands {
    /// What is asked, and what of it may be followed.
    asked_for: Command,
    command: Command,
    /// The table may not go on forwards, backwards.
    blocked: [bool; 2],
    /// What the coordinator was last told.
    followed: Command,
    /// The torque that is asked, and the one that is followed.
    torque_asked: Option<TorqueCommand>,
    torque: Option<TorqueCommand>,
    /// Which way the table is asked to go, or goes by a torque.
    heading: TableVelocity,
    /// What the motor of a torque was last asked for, A.
    pushed: Current,
    /// The torque limit cut what a speed loop asked.
    torque_limited: [bool; 2],
}

/// The alignment, and what goes to and from it.
#[derive(Clone, Copy, Debug)]
struct Aligning {
    alignment: Alignment,
    /// What it shall see in its next step, and what it has asked in its last.
    seen: Option<([MotorSeen; 2], Option<u32>)>,
    asked: AlignmentStep,
    /// What the alignment last asked the current loops to take over.
    alignments: [Option<EncoderAlignment>; 2],
    aligned: Progress,
}

/// What watches motors and bridges, and what it has found.
#[derive(Clone, Copy, Debug)]
struct Watches {
    runaway: [Runaway; 2],
    sums: [CurrentSum; 2],
    /// How long a motor at its torque limit has not moved the table.
    pressed: Tally,
    /// What the watch found in the last step.
    found: Option<Fault>,
    /// Heat of windings and bridges, running or not.
    heat: [Heat; 2],
    /// What the heat leaves of the torque currents.
    current_max: [Current; 2],
    too_hot: [bool; 2],
    /// What the drive comes to rest for.
    rests_for: Option<Fault>,
    /// What was found since the drive last left a fault, the first cause among them.
    latched: FaultSet,
}

/// State of the speed task. The configuration comes with each step, as a current loop's does.
#[derive(Clone, Copy, Debug)]
pub struct SpeedTask {
    speed_loops: [SpeedLoop; 2],
    coordinator: Coordinator,
    commands: Commands,
    state: State,
    /// What [`decide`](Self::decide) sees to has come from this task itself: a command to follow, or something found. Kept as one word,
    /// as to ask each of them took 19 cycles of each step.
    due: bool,
    aligning: Aligning,
    watches: Watches,
    interlock: Interlock,
    brake: Brake,
    /// The motor that brings the table to rest in a fault, and what the table moves in a period by its scale.
    follow: Option<Follow>,
    table_step: Option<i32>,
    rejection: Rejection,
    /// How the encoders lie to their rotors: screw, nut.
    frames: [RotorFrame; 2],
    /// A fault has doubted the angles that are stored.
    stored_doubted: bool,
    /// Which of the [`Look`]s is due.
    look: u8,
}

impl SpeedTask {
    /// A task at rest.
    #[must_use]
    pub const fn new(config: &DriveConfig) -> Self {
        let [screw_heat, nut_heat] = &config.heat;
        let [screw_loop, nut_loop] = &config.speed_loops;
        Self {
            speed_loops: [SpeedLoop::new(), SpeedLoop::new()],
            coordinator: Coordinator::new(),
            commands: Commands {
                asked_for: Command::rest(),
                command: Command::rest(),
                blocked: [false; 2],
                followed: Command::rest(),
                torque_asked: None,
                torque: None,
                heading: TableVelocity::ZERO,
                pushed: Current::ZERO,
                torque_limited: [false; 2],
            },
            state: State::Boot,
            due: false,
            aligning: Aligning {
                alignment: Alignment::new(),
                seen: None,
                asked: AlignmentStep::new(),
                alignments: [None; 2],
                aligned: Progress::Working,
            },
            watches: Watches {
                runaway: [Runaway::new(); 2],
                sums: [CurrentSum::new(); 2],
                pressed: Tally::new(),
                found: None,
                heat: [Heat::starting(screw_heat), Heat::starting(nut_heat)],
                current_max: [screw_loop.i_max, nut_loop.i_max],
                too_hot: [false; 2],
                rests_for: None,
                latched: FaultSet::EMPTY,
            },
            interlock: Interlock::new(),
            brake: Brake::new(),
            follow: None,
            table_step: None,
            rejection: Rejection::new(config),
            frames: [RotorFrame::ENCODER; 2],
            stored_doubted: false,
            look: 0,
        }
    }

    /// What is compensated, with what was learned.
    #[must_use]
    pub const fn compensation(&self) -> &Compensation {
        &self.rejection.compensation
    }

    /// Takes a new command, to be followed while running.
    ///
    /// # Errors
    /// [`CommandError`] if the feed or a motor may not move that fast; the old command stays.
    pub fn command(&mut self, config: &DriveConfig, command: Command) -> Result<(), CommandError> {
        Coordinator::new().command(&config.coordinator, command)?;
        self.commands.asked_for = command;
        self.commands.command = command.within(self.commands.blocked);
        self.commands.heading = self.commands.command.velocity;
        self.commands.torque_asked = None;
        self.due = true;
        Ok(())
    }

    /// Takes a torque for one motor, to be followed while running, and a base speed for the other.
    ///
    /// # Errors
    /// [`CommandError`] if a motor or the feed does not allow it; the old command stays.
    #[cold]
    #[inline(never)]
    pub fn command_torque(
        &mut self,
        config: &DriveConfig,
        torque: TorqueCommand,
        base: MechanicalSpeed,
    ) -> Result<(), CommandError> {
        torque.allowed(&config.coordinator, &config.speed_loops, base)?;
        let velocity = TableVelocity::ZERO;
        self.command(config, Command { velocity, base })?;
        self.commands.torque_asked = Some(torque);
        self.end_at_limit();
        Ok(())
    }

    /// What the table's share turns the screw by against the nut by its plan, mechanical rad/s, and the change of that a step.
    #[must_use]
    #[inline(always)]
    pub fn planned(&self) -> (Speed, SpeedChange) {
        self.coordinator.planned()
    }

    /// The brake is commanded to open.
    #[must_use]
    #[inline(always)]
    pub const fn releases_brake(&self) -> bool {
        self.brake.is_released()
    }

    /// The references are at the command.
    #[must_use]
    pub fn arrived(&self) -> bool {
        self.coordinator.arrived()
    }

    /// What limits a drive that does what it is asked. Asked for now and then: within each step it would take registers from what is
    /// computed there.
    #[must_use]
    #[cold]
    #[inline(never)]
    pub fn limits(&self, config: &DriveConfig, exchanges: [&MotorExchange; 2]) -> ActiveLimits {
        let driven = self.state.is_driven();
        let mut limits = ActiveLimits::NONE
            .with(
                None,
                Limit::Travel,
                self.interlock.at_an_end() || driven && self.commands.blocked.contains(&true),
            )
            .with(None, Limit::Speed, driven && self.coordinator.gives_way())
            .with(
                None,
                Limit::Acceleration,
                driven && !self.coordinator.arrived() && self.commands.torque.is_none(),
            );
        let motors = exchanges.into_iter().zip(self.commands.torque_limited);
        let most = self
            .watches
            .current_max
            .into_iter()
            .zip(&config.speed_loops);
        let motors = motors.zip(most).zip(&config.regeneration).zip(0..);
        for ((((exchange, limited), (most, speed_loop)), regeneration), k) in motors {
            let warm = most < speed_loop.i_max;
            let full = regeneration.braking_max(most, exchange.bus(), exchange.theta_step()) < most;
            limits = limits
                .with(Some(k), Limit::Temperature, warm)
                .with(Some(k), Limit::Regeneration, driven && full)
                .with(Some(k), Limit::Current, driven && limited && !warm && !full)
                .with(
                    Some(k),
                    Limit::Voltage,
                    driven && exchange.voltage_limited(),
                );
        }
        limits
    }

    /// What was found since the drive last left a fault, the first cause among them; empty where it has none and does not come
    /// to rest for one.
    #[must_use]
    pub const fn latched(&self) -> FaultSet {
        self.watches.latched
    }

    /// After a step that began a fault: which gate drivers' fault lines are pulled, screw's and nut's, and whether the controller itself
    /// has broken the timers. A break is distinguished by it.
    #[cold]
    #[inline(never)]
    pub fn tell_lines(&mut self, pulled: [bool; 2], controller: bool) -> State {
        if let State::Fault(fault) = self.state {
            let named = fault.by_line(pulled, controller);
            self.watches.latched = self
                .watches
                .latched
                .without(FaultSet::EMPTY.with(fault))
                .with(named);
            self.state = State::Fault(named);
        }
        self.state
    }

    /// Why the last alignment failed; `None` if it did not.
    #[must_use]
    pub const fn misalignment(&self) -> Option<Misalignment> {
        match self.aligning.aligned {
            Progress::Failed(failed) => Some(failed),
            Progress::Working | Progress::Done | Progress::Interrupted => None,
        }
    }

    /// The next step looks at the request's inputs and heartbeat; the others do not.
    #[must_use]
    #[inline(always)]
    pub const fn looks_at_inputs(&self) -> bool {
        matches!(Look::of(self.look), Look::Interlock)
    }

    /// One step: what the current loops found, and the fault that the board or its guard has found -> what they are asked
    /// next.
    #[inline(always)]
    pub fn step(
        &mut self,
        config: &DriveConfig,
        request: Request,
        exchanges: [&MotorExchange; 2],
        found: Option<Fault>,
    ) -> SpeedTaskOutput {
        let look = Look::of(self.look);
        self.look = self.look.wrapping_add(1);
        match look {
            Look::ScrewHeat | Look::NutHeat => self.warm(config, look, exchanges),
            Look::Interlock => {
                self.interlock(config, request);
                self.look_at_table(config, exchanges);
            }
            Look::ScrewMotion | Look::NutMotion => (),
        }
        let [screw, nut] = exchanges;
        // What `decide` would leave as it is. All that may have come in one word, as each branch would cost more than its look.
        let came = u32::from(self.due) | fault::word(found) | screw.faults() | nut.faults();
        let goes_on = self.state == State::Running
            && !(look == Look::Interlock && self.holds())
            && request.demand == Demand::Run
            && came == 0;
        if !goes_on {
            if let Some(undriven) = self.decide(config, request.demand, exchanges, found) {
                return SpeedTaskOutput {
                    current: self.stand(config, undriven, request.scale, exchanges),
                    state: self.state,
                    ..SpeedTaskOutput::default()
                };
            }
            if self.commands.torque.is_some() {
                let (current, speed) = self.drive_torque(config, request.scale, exchanges, look);
                return SpeedTaskOutput {
                    current,
                    speed,
                    state: self.state,
                };
            }
        }
        let output = self.drive::<false>(config, request.scale, exchanges, look);
        self.expect_bus(config, exchanges);
        output
    }

    /// A division for each motor: one a step.
    #[inline(always)]
    fn expect_bus(&self, config: &DriveConfig, [screw, nut]: [&MotorExchange; 2]) {
        let [screw_loop, nut_loop] = &config.current_loops;
        if self.look & 1 == 0 {
            screw.expect_bus(screw_loop);
        } else {
            nut.expect_bus(nut_loop);
        }
    }

    /// The next state, and the coordinator's command where that state drives. It takes the demand by itself: the compiler would
    /// write a whole request to memory in each step, for this call alone.
    #[cold]
    #[inline(never)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    fn decide(
        &mut self,
        config: &DriveConfig,
        demand: Demand,
        exchanges: [&MotorExchange; 2],
        found: Option<Fault>,
    ) -> Option<Undriven> {
        let [screw, nut] = exchanges;
        let motors = [screw.status(), nut.status()];
        let sums = self.add_up(config, exchanges);
        let seen = [found, self.watches.found.take(), sums, self.heat_fault()];
        let says = screw.says_fault() || nut.says_fault() || seen.iter().any(Option::is_some);
        let found = if says {
            self.judge(config, exchanges, motors, seen)
        } else {
            None
        };
        // What the last look saw forbids a start too, which need not wait for the next.
        self.ask_interlock(config, demand);
        let before = self.state;
        let demand = self.permitted(config, demand);
        if before == State::Aligning && demand != Demand::Align {
            self.aligning.alignment.interrupt();
        }
        // The motors hold until the brake does.
        let held = before != State::Stopping || self.brake.is_closed(&config.brake);
        let at_rest = self.coordinator.at_rest() && held && self.commands.torque.is_none();
        self.state = before.next(demand, motors, found, self.aligning.aligned, at_rest);
        if config.brake.fitted {
            self.step_brake(exchanges);
        }
        if let (State::Fault(first), Some(later)) = (self.state, found)
            && later.corrects(first)
        {
            self.state = State::Fault(later);
        }
        if self.watches.rests_for.is_some() || matches!(self.state, State::Fault(_)) {
            self.settle(before, config, exchanges);
        } else {
            let doubted = self.watches.latched.has_any(FaultSet::DOUBTS_ANGLE);
            if self.follow.take().is_some() && doubted {
                self.forget_angles(config, exchanges);
            }
            self.watches.latched = FaultSet::EMPTY;
        }
        let target = match self.state {
            State::Running | State::Holding if self.brake.is_open(&config.brake) => {
                self.commands.command
            }
            State::Running | State::Holding | State::Stopping => Command::rest(),
            _ => {
                self.commands.torque = None;
                return Some(Undriven {
                    mode: self.state.mode(demand),
                    entered: self.state != before,
                    aligned: before == State::Aligning && self.state == State::Ready,
                });
            }
        };
        let [screw_loop, nut_loop] = &config.current_loops;
        self.frames = [
            RotorFrame::of(screw.alignment(), screw_loop.observer.pole_pairs),
            RotorFrame::of(nut.alignment(), nut_loop.observer.pole_pairs),
        ];
        if self.commands.torque_asked.is_some() || self.commands.torque.is_some() {
            self.look_at_torque(config, exchanges);
        }
        if target != self.commands.followed {
            // Checked when it was given, and rest is always allowed; a refusal would leave the old target.
            let _ = self.coordinator.command(&config.coordinator, target);
            self.commands.followed = target;
        }
        self.due = self.commands.command.differs(self.commands.followed) != 0
            || self.watches.rests_for.is_some()
            // A torque is looked at in each step, so that one without it need not ask.
            || self.commands.torque.is_some()
            || self.watches.too_hot != [false; 2];
        None
    }

    /// Releases the brake once both motors hold, and closes it when they are at rest.
    #[inline(always)]
    fn step_brake(&mut self, [screw, nut]: [&MotorExchange; 2]) {
        self.brake.step(match self.state {
            State::Running | State::Holding => {
                self.brake.is_released() || screw.is_closed() && nut.is_closed()
            }
            State::Stopping => self.brake.is_released() && !self.coordinator.at_rest(),
            _ => false,
        });
    }

    /// Goes over to a torque, to another one, or back to speeds.
    #[cold]
    #[inline(never)]
    fn look_at_torque(&mut self, config: &DriveConfig, exchanges: [&MotorExchange; 2]) {
        self.end_at_limit();
        let runs = matches!(self.state, State::Running | State::Holding);
        let follows = runs && self.brake.is_open(&config.brake);
        let torque = self.commands.torque_asked.filter(|_| follows);
        if torque == self.commands.torque {
            return;
        }
        let same = |one: TorqueCommand, other: TorqueCommand| {
            one.motor == other.motor && one.backwards() == other.backwards()
        };
        let goes_on =
            matches!((self.commands.torque, torque), (Some(one), Some(other)) if same(one, other));
        if let (Some(before), false) = (self.commands.torque, goes_on) {
            let loops = exchanges.into_iter().zip(&config.current_loops);
            let mut speeds = [Speed::ZERO; 2];
            for (speed, (exchange, current_loop)) in speeds.iter_mut().zip(loops) {
                *speed = current_loop.observer.omega_e(exchange.theta_step());
            }
            let gained = (self.coordinator).end_torque(&config.coordinator, before.motor, speeds);
            let mut motors = self.speed_loops.iter_mut().zip(&config.speed_loops);
            if let Some((state, config)) = motors.nth(before.motor) {
                // What of the torque did not accelerate the motor is its load.
                let inertial: Current = narrow(config.inertia.wide_mul(gained));
                *state = SpeedLoop::holding(self.commands.pushed.saturating_sub(inertial), config);
            }
        }
        if let (Some(torque), false) = (torque, goes_on) {
            self.coordinator.begin_torque();
            if let Some(state) = self.speed_loops.get_mut(torque.motor) {
                *state = SpeedLoop::new();
            }
        }
        self.commands.torque = torque;
    }

    /// A torque does not push the table on to a limit: it is held there until something else is asked.
    #[cold]
    fn end_at_limit(&mut self) {
        let Some(torque) = self.commands.torque_asked else {
            return;
        };
        let [forwards, backwards] = self.commands.blocked;
        let heading = torque.heading(self.coordinator.relative());
        if forwards && heading > TableVelocity::ZERO || backwards && heading < TableVelocity::ZERO {
            self.commands.torque_asked = None;
            self.commands.heading = TableVelocity::ZERO;
        } else {
            self.commands.heading = heading;
        }
    }

    /// A step in which one motor follows a torque. It gives the parts of an output: a whole one would be written to memory in each step.
    #[cold]
    #[inline(never)]
    fn drive_torque(
        &mut self,
        config: &DriveConfig,
        scale: Option<u32>,
        exchanges: [&MotorExchange; 2],
        look: Look,
    ) -> ([CurrentReference; 2], [SpeedReference; 2]) {
        let output = self.drive::<true>(config, scale, exchanges, look);
        self.expect_bus(config, exchanges);
        (output.current, output.speed)
    }

    /// A step in which the pair is not driven. Not a part of [`decide`](Self::decide), after which it may be: the longest way through
    /// a step is then that of the one or of the other.
    #[cold]
    #[inline(never)]
    fn stand(
        &mut self,
        config: &DriveConfig,
        undriven: Undriven,
        scale: Option<u32>,
        exchanges: [&MotorExchange; 2],
    ) -> [CurrentReference; 2] {
        match self.follow {
            Some(follow) => self.bring_to_rest(config, undriven.mode, exchanges, follow),
            None => self.rest(config, undriven, scale, exchanges),
        }
    }

    /// A step in which nothing is driven, or only by the alignment.
    fn rest(
        &mut self,
        config: &DriveConfig,
        undriven: Undriven,
        scale: Option<u32>,
        exchanges: [&MotorExchange; 2],
    ) -> [CurrentReference; 2] {
        // First of all, so that the next period of either loop sees it.
        let current = if self.state == State::Aligning {
            self.align(config, scale, exchanges)
        } else {
            [CurrentReference {
                mode: undriven.mode,
                ..CurrentReference::default()
            }; 2]
        };
        for ((exchange, reference), current_loop) in exchanges
            .into_iter()
            .zip(current)
            .zip(&config.current_loops)
        {
            exchange.ask(reference, current_loop);
            exchange.expect_bus(current_loop);
        }
        self.speed_loops = [SpeedLoop::new(), SpeedLoop::new()];
        self.coordinator = Coordinator::new();
        self.commands.followed = Command::rest();
        self.rejection.compensation.rest();
        if undriven.aligned {
            self.rejection.compensation.forget(&config.compensation);
        }
        self.rejection.rest();
        self.commands.torque_limited = [false; 2];
        self.watches.runaway = [Runaway::new(); 2];
        self.watches.pressed = Tally::new();
        self.watches.found = None;
        // After the currents are asked, for it takes as long as a current loop.
        match self.state {
            State::SelfTest if undriven.entered => self.restore_angles(config, exchanges),
            State::Unaligned if undriven.entered => self.prepare_alignment(config),
            _ => {}
        }
        if self.aligning.seen.is_some() {
            self.compute_alignment(config);
        }
        current
    }

    /// A step in a fault of one motor, in which the other brings the table to rest.
    #[cold]
    #[inline(never)]
    fn bring_to_rest(
        &mut self,
        config: &DriveConfig,
        mode: Mode,
        exchanges: [&MotorExchange; 2],
        follow: Follow,
    ) -> [CurrentReference; 2] {
        let rests = CurrentReference {
            mode,
            ..CurrentReference::default()
        };
        let mut asked = [rests; 2];
        let current = self.follow_table(config, exchanges, follow);
        if let (Some(i_q), Some(asked)) = (current, asked.get_mut(follow.motor())) {
            *asked = CurrentReference {
                mode: Mode::Drive,
                i_q,
                ..CurrentReference::default()
            };
        }
        let loops = exchanges.into_iter().zip(&config.current_loops);
        for ((exchange, current_loop), asked) in loops.zip(asked) {
            exchange.ask(asked, current_loop);
            exchange.expect_bus(current_loop);
        }
        asked
    }

    /// The current of the motor that brings the table to rest, while it does.
    #[inline(always)]
    fn follow_table(
        &mut self,
        config: &DriveConfig,
        exchanges: [&MotorExchange; 2],
        mut follow: Follow,
    ) -> Option<Current> {
        self.watches.found = None;
        let motors = exchanges.into_iter().zip(&config.current_loops);
        let motors = motors.zip(&config.speed_loops).zip(&config.regeneration);
        let motors = motors.zip(&config.runaway).zip(self.watches.current_max);
        let states = self.speed_loops.iter_mut().zip(&mut self.watches.runaway);
        let motor = motors.zip(states).nth(follow.motor());
        let adds_up = Self::adds_up(config, exchanges, follow.motor());
        self.follow = None;
        let [screw_step, nut_step] = exchanges.map(MotorExchange::theta_step);
        let (motor, (state, watch)) = motor?;
        let (((((exchange, current_loop), speed_loop), regeneration), runaway), most) = motor;
        let theta_step = exchange.theta_step();
        let omega_e = current_loop.observer.omega_e(theta_step);
        let as_speed = |step: i32| current_loop.observer.omega_e(step);
        let table = follow.table(&Reading {
            scale: self.table_step.map(as_speed),
            encoders: as_speed(screw_step.wrapping_sub(nut_step)),
            shaft: omega_e,
            doubted: self.watches.latched.has_any(FaultSet::DOUBTS_ANGLE),
            slow: runaway.stall,
        });
        let speed = table.map_or(Speed::ZERO, |table| table.speed);
        self.follow = table.and_then(|table| {
            follow.goes_on(&Followed {
                latched: self.watches.latched,
                speeds: [omega_e, table.speed],
                slow: runaway.stall,
                turned: theta_step
                    .unsigned_abs()
                    .saturating_mul(config.speed_divider),
                adds_up,
                counted: !table.by_scale || self.table_step != Some(0),
                blind_max: config.blind_max,
            })
        });
        let reference = SpeedReference {
            omega_e: follow.reference(omega_e, speed),
            ..SpeedReference::default()
        };
        let voltage_limited = exchange.voltage_limited();
        let wanted = state.wanted(speed_loop, reference, omega_e);
        let range = regeneration.range(most, exchange.bus(), theta_step);
        let output = state.limit(speed_loop, wanted, voltage_limited, range);
        // It has no reference of its own to follow.
        let motion = Motion {
            reference: omega_e,
            omega_e,
            torque_limited: false,
            theta_step,
            voltage_limited,
        };
        // As often as that of a drive that runs.
        if u32::from(self.look).is_multiple_of(STEPS_PER_LOOK) {
            let induced = &current_loop.regulator.induced;
            let sign = watch.step(runaway, induced, exchange, motion);
            self.watches.found = sign.map(|sign| match follow.motor() {
                0 => sign.of_screw(),
                _ => sign.of_nut(),
            });
        }
        self.follow.is_some().then_some(output.i_q)
    }

    /// A step of the coordinator and both speed loops; of `TORQUE` one motor follows a torque.
    #[inline(always)]
    fn drive<const TORQUE: bool>(
        &mut self,
        config: &DriveConfig,
        scale: Option<u32>,
        exchanges: [&MotorExchange; 2],
        look: Look,
    ) -> SpeedTaskOutput {
        let torque = if TORQUE { self.commands.torque } else { None };
        let turns = Turns::of(config, exchanges);
        let torque_limited = self.commands.torque_limited;
        let following = turns.following(torque_limited);
        let speed = match torque {
            None => self.coordinator.step(&config.coordinator, following),
            Some(torque) => self.torque_references(config, torque, following),
        };
        let mut reference = speed;
        if config.compensation.active {
            let [screw_voltage, nut_voltage] = turns.voltage_limited;
            let [screw_torque, nut_torque] = torque_limited;
            // Of one it is asked that both are.
            let limited = screw_voltage | screw_torque | nut_voltage | nut_torque;
            let steady = self.coordinator.steady() && !limited && !TORQUE;
            let given = self.compensated(config, scale, exchanges, turns, speed, steady);
            for (reference, given) in reference.iter_mut().zip(given) {
                reference.omega_e = reference.omega_e.saturating_add(given);
            }
        }
        let asked = self.correct(config, torque, exchanges, turns, speed, reference);
        let current = asked.map(|output| CurrentReference {
            mode: Mode::Drive,
            i_q: output.i_q,
            ..CurrentReference::default()
        });
        let mut limited = asked.map(|output| output.limited);
        if let Some(torque) = torque {
            // A motor that has its set-point has no reference of its own to follow.
            let [screw_asked, nut_asked] = asked.map(|output| output.i_q);
            let [screw_reference, nut_reference] = &mut reference;
            let [screw_omega_e, nut_omega_e] = turns.omega_e;
            let [screw_limited, nut_limited] = &mut limited;
            if torque.motor == 0 {
                (self.commands.pushed, *screw_limited) = (screw_asked, false);
                screw_reference.omega_e = screw_omega_e;
            } else {
                (self.commands.pushed, *nut_limited) = (nut_asked, false);
                nut_reference.omega_e = nut_omega_e;
            }
        }
        self.commands.torque_limited = limited;
        let ask = || {
            let [to_screw, to_nut] = current;
            let [screw_exchange, nut_exchange] = exchanges;
            let [screw_loop, nut_loop] = &config.current_loops;
            screw_exchange.ask_on(to_screw.i_q, screw_loop);
            nut_exchange.ask_on(to_nut.i_q, nut_loop);
        };
        let motion = turns.motion(reference, limited);
        let sign = self.watch(config, look, ask, exchanges, motion);
        if sign.is_some() {
            cold_path();
            self.watches.found = sign;
            self.due = true;
        }
        SpeedTaskOutput {
            current,
            speed,
            state: self.state,
        }
    }

    /// What is added to the references `asked`, to compensate what is known of the machine.
    #[inline(always)]
    fn compensated(
        &mut self,
        config: &DriveConfig,
        scale: Option<u32>,
        exchanges: [&MotorExchange; 2],
        turns: Turns,
        asked: [SpeedReference; 2],
        steady: bool,
    ) -> [Speed; 2] {
        let [screw_exchange, nut_exchange] = exchanges;
        let [screw_loop, nut_loop] = &config.current_loops;
        let [screw_frame, nut_frame] = self.frames;
        let [screw_step, nut_step] = turns.theta_step;
        let [screw_omega_e, nut_omega_e] = turns.omega_e;
        let [screw_asked, nut_asked] = asked.map(|reference| reference.omega_e);
        let [screw_state, nut_state] = &self.speed_loops;
        self.rejection.compensation.references(
            &config.compensation,
            [
                Turning {
                    theta: screw_frame.rotor_angle(screw_exchange, screw_loop),
                    theta_step: screw_step,
                    omega_e: screw_omega_e,
                    asked: screw_asked,
                    steady,
                },
                Turning {
                    theta: nut_frame.rotor_angle(nut_exchange, nut_loop),
                    theta_step: nut_step,
                    omega_e: nut_omega_e,
                    asked: nut_asked,
                    steady,
                },
            ],
            scale,
            self.coordinator.relative(),
            || [screw_state.load(), nut_state.load()],
        )
    }

    /// Both speed loops: what they ask to follow `reference`, where `asked` is the same without compensation.
    #[inline(always)]
    fn correct(
        &mut self,
        config: &DriveConfig,
        torque: Option<TorqueCommand>,
        exchanges: [&MotorExchange; 2],
        turns: Turns,
        asked: [SpeedReference; 2],
        reference: [SpeedReference; 2],
    ) -> [SpeedLoopOutput; 2] {
        let [screw_config, nut_config] = &config.speed_loops;
        let [screw_asked, nut_asked] = asked;
        let has_slack = screw_config.slack | nut_config.slack != 0;
        let rests = has_slack && (screw_asked.is_rest() || nut_asked.is_rest());
        let seen = if rests {
            self.seen_at_rest(config, asked, turns.theta_step)
        } else {
            turns.omega_e
        };
        let [screw_seen, nut_seen] = seen;
        let [screw_reference, nut_reference] = reference;
        let [screw_loop, nut_loop] = &mut self.speed_loops;
        let wanted = [
            screw_loop.wanted(screw_config, screw_reference, screw_seen),
            nut_loop.wanted(nut_config, nut_reference, nut_seen),
        ];
        let Rejected { wanted, fed_back } = self.rejection.step(
            config,
            wanted,
            seen,
            [screw_reference.omega_e, nut_reference.omega_e],
            self.coordinator.relative(),
        );
        let [screw_wanted, nut_wanted] = wanted;
        let [screw_voltage, nut_voltage] = turns.voltage_limited;
        let [screw_range, nut_range] = self.ranges(config, torque, exchanges, turns, reference);
        let [screw_loop, nut_loop] = &mut self.speed_loops;
        let asked = [
            screw_loop.limit(screw_config, screw_wanted, screw_voltage, screw_range),
            nut_loop.limit(nut_config, nut_wanted, nut_voltage, nut_range),
        ];
        self.rejection.keep(config, asked, wanted, fed_back);
        asked
    }

    /// The currents that both loops may ask: what heat and bus leave, and a torque.
    #[inline(always)]
    fn ranges(
        &self,
        config: &DriveConfig,
        torque: Option<TorqueCommand>,
        exchanges: [&MotorExchange; 2],
        turns: Turns,
        reference: [SpeedReference; 2],
    ) -> [CurrentRange; 2] {
        let [screw_exchange, nut_exchange] = exchanges;
        let [screw_regeneration, nut_regeneration] = &config.regeneration;
        let [screw_max, nut_max] = self.watches.current_max;
        let [screw_step, nut_step] = turns.theta_step;
        let screw = screw_regeneration.range(screw_max, screw_exchange.bus(), screw_step);
        let nut = nut_regeneration.range(nut_max, nut_exchange.bus(), nut_step);
        let [screw_config, nut_config] = &config.speed_loops;
        let [screw_reference, nut_reference] = reference.map(|motor| motor.omega_e);
        let [screw_omega_e, nut_omega_e] = turns.omega_e;
        match torque {
            None => [screw, nut],
            Some(torque) if torque.motor == 0 => {
                let left = torque.range(screw_config, screw, screw_reference, screw_omega_e);
                [left, nut]
            }
            Some(torque) => {
                let left = torque.range(nut_config, nut, nut_reference, nut_omega_e);
                [screw, left]
            }
        }
    }

    /// The speeds that the loops correct where a motor is asked to stand: its own has slack.
    #[inline(never)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    fn seen_at_rest(
        &mut self,
        config: &DriveConfig,
        asked: [SpeedReference; 2],
        mut steps: [i32; 2],
    ) -> [Speed; 2] {
        let loops = self.speed_loops.iter_mut().zip(&config.speed_loops);
        for ((state, config), (asked, step)) in loops.zip(asked.iter().zip(&mut steps)) {
            if asked.is_rest() {
                *step = state.beyond_slack(config, *step);
            }
        }
        let [screw, nut] = steps;
        let [screw_loop, nut_loop] = &config.current_loops;
        [
            screw_loop.observer.omega_e(screw),
            nut_loop.observer.omega_e(nut),
        ]
    }

    /// The references where one motor follows a torque.
    #[inline(never)]
    fn torque_references(
        &mut self,
        config: &DriveConfig,
        torque: TorqueCommand,
        following: [Following; 2],
    ) -> [SpeedReference; 2] {
        let [screw, nut] = following;
        let speeds = following.map(|motor| motor.omega_e);
        let [screw_pairs, nut_pairs] = config.coordinator.pole_pairs;
        let coordinator = &mut self.coordinator;
        if torque.motor == 0 {
            let held = coordinator.step_torque(&config.coordinator, 1, nut.limited, speeds);
            [torque.reference(screw_pairs), held]
        } else {
            let held = coordinator.step_torque(&config.coordinator, 0, screw.limited, speeds);
            [held, torque.reference(nut_pairs)]
        }
    }

    /// Latches what was found, and says what of it opens the bridges: what does not is what the drive comes to rest for.
    #[cold]
    #[inline(never)]
    fn judge(
        &mut self,
        config: &DriveConfig,
        exchanges: [&MotorExchange; 2],
        motors: [MotorStatus; 2],
        seen: [Option<Fault>; 4],
    ) -> Option<Fault> {
        self.watches.latched = self.watches.latched.and(faults(motors));
        let rests_for = self.rests(config, exchanges, seen);
        let mut opens = None;
        for fault in seen.into_iter().flatten() {
            self.watches.latched = self.watches.latched.with(fault);
            if rests_for.has(fault) {
                self.watches.rests_for.get_or_insert(fault);
            } else if opens.is_none() {
                opens = Some(fault);
            }
        }
        opens
    }

    /// What the pair comes to rest for, where `seen` begins with what the board's guard found.
    #[inline(always)]
    fn rests(
        &self,
        config: &DriveConfig,
        exchanges: [&MotorExchange; 2],
        [of_board, ..]: [Option<Fault>; 4],
    ) -> FaultSet {
        let at_speed = of_board.is_some_and(|fault| FaultSet::RESTS_AT_SPEED.has(fault));
        // A stop for it goes on below the speed at which it begins.
        let in_hand = || self.watches.rests_for == of_board || an_angle_shows(config, exchanges);
        if self.state == State::Aligning {
            FaultSet::RESTS
        } else if !self.state.is_driven() {
            FaultSet::EMPTY
        } else if at_speed && in_hand() {
            FaultSet::RESTS.and(FaultSet::RESTS_AT_SPEED)
        } else {
            FaultSet::RESTS
        }
    }

    /// Names the first cause of a fault, also where another did not let the drive come to rest for it.
    #[cold]
    #[inline(never)]
    fn settle(&mut self, before: State, config: &DriveConfig, exchanges: [&MotorExchange; 2]) {
        if before.has_bridges_on() {
            self.state = likelier(self.state, config, exchanges);
        }
        // What opens a bridge need not be the first cause: a stop for that may be on its way.
        let opens = self.state.fault();
        let first = match (self.watches.rests_for, self.state) {
            (Some(fault), State::Ready | State::Unaligned | State::Fault(_))
            | (None, State::Fault(fault)) => {
                self.watches.rests_for = None;
                self.state = State::Fault(fault);
                fault
            }
            (Some(fault), _) => fault,
            (None, _) => return,
        };
        self.watches.latched = self.watches.latched.with(first);
        if before.is_driven() && matches!(self.state, State::Fault(_)) {
            let adds_up = |follow: &Follow| Self::adds_up(config, exchanges, follow.motor());
            let (planned, _) = self.planned();
            let planned = |motor: usize| {
                let pole_pairs = config
                    .runaway
                    .get(motor)
                    .map_or(0, |limits| limits.pole_pairs);
                planned.saturating_mul_int(pole_pairs)
            };
            let follow =
                opens.and_then(|fault| Follow::after(fault, self.watches.latched, planned));
            self.follow = follow.filter(adds_up);
        }
        let doubted = self.watches.latched.has_any(FaultSet::DOUBTS_ANGLE) && self.follow.is_none();
        // An alignment that did not end has found its angles in part.
        let unfinished = before == State::Aligning;
        if (doubted || unfinished) && matches!(self.state, State::Fault(_)) {
            self.forget_angles(config, exchanges);
        }
    }

    /// What of the demand may begin or go on. A drive that comes to rest for a fault takes no motion; an alignment waits for the brake to
    /// hold.
    fn permitted(&self, config: &DriveConfig, demand: Demand) -> Demand {
        let moves = matches!(demand, Demand::Align | Demand::Run);
        let brake_opens = self.state == State::Unaligned && !self.brake.is_closed(&config.brake);
        if moves && (self.watches.rests_for.is_some() || brake_opens) {
            Demand::Rest
        } else {
            demand
        }
    }

    /// The next alignment begins with nothing known.
    #[cold]
    #[inline(never)]
    fn prepare_alignment(&mut self, config: &DriveConfig) {
        self.aligning.alignment = Alignment::begin(&config.alignment);
        (self.aligning.asked, self.aligning.seen) = (AlignmentStep::default(), None);
        self.aligning.aligned = Progress::Working;
    }

    /// Absolute encoders whose angles are stored tell where both rotors stand: no motion is needed. After a fault that doubts an
    /// angle, an alignment verifies them first.
    #[cold]
    #[inline(never)]
    fn restore_angles(&mut self, config: &DriveConfig, exchanges: [&MotorExchange; 2]) {
        let [screw, nut] = &config.alignment.motors;
        if let (Some(screw), Some(nut), false) = (screw.stored, nut.stored, self.stored_doubted) {
            let [of_screw, of_nut] = exchanges;
            if of_screw.alignment().is_none() || of_nut.alignment().is_none() {
                of_screw.align(None, Some(screw));
                of_nut.align(None, Some(nut));
            }
        }
    }

    /// What alignment has found is not true any more.
    #[cold]
    fn forget_angles(&mut self, config: &DriveConfig, exchanges: [&MotorExchange; 2]) {
        self.stored_doubted = true;
        let last = self
            .aligning
            .alignments
            .iter_mut()
            .zip(&config.current_loops);
        for (exchange, (last, current_loop)) in exchanges.into_iter().zip(last) {
            if current_loop.alignment.is_none() && exchange.alignment().is_some() {
                *last = None;
                exchange.align(exchange.alignment(), None);
            }
        }
    }

    /// A step of the alignment.
    #[cold]
    #[inline(never)]
    fn compute_alignment(&mut self, config: &DriveConfig) {
        if let Some((seen, scale)) = self.aligning.seen.take() {
            self.aligning.asked = self.aligning.alignment.step(&config.alignment, seen, scale);
        }
    }

    /// Rest is commanded, and both references are there.
    #[inline(always)]
    fn holds(&self) -> bool {
        self.commands.followed == Command::rest() && self.coordinator.at_rest()
    }

    /// Looks at inputs and heartbeat.
    #[inline(always)]
    fn interlock(&mut self, config: &DriveConfig, request: Request) {
        self.interlock.look(request.heartbeat, request.inputs);
        self.table_step = request.inputs.table_step;
        if request.inputs.blocked != self.commands.blocked {
            cold_path();
            self.commands.blocked = request.inputs.blocked;
            self.commands.command = self.commands.asked_for.within(self.commands.blocked);
            self.commands.heading = self.commands.command.velocity;
            self.end_at_limit();
            self.due = true;
        }
        self.ask_interlock(config, request.demand);
    }

    /// Every closed bridge passes here: each state says which motion it may have, and the interlock is asked about that. A drive that
    /// violates a condition comes to rest for it.
    #[inline(never)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    fn ask_interlock(&mut self, config: &DriveConfig, demand: Demand) {
        use interlock::Motion::{Alignment, Table};
        let motion = match self.state {
            // Open bridges, which no demand closes. In a fault a motor may bring the table to rest: see `follow`.
            State::Boot | State::SelfTest | State::Fault(_) => return,
            State::Unaligned => {
                self.interlock.begin_alignment();
                (demand == Demand::Align).then_some(Alignment)
            }
            State::Aligning => (demand == Demand::Align).then_some(Alignment),
            State::Ready | State::Running | State::Holding | State::Stopping => {
                (demand == Demand::Run).then_some(Table(self.commands.heading))
            }
        };
        if let (Some(motion), None) = (motion, self.watches.rests_for) {
            let forbidden = self.interlock.forbids(config.heartbeat_looks, motion);
            if forbidden.is_some() {
                cold_path();
                self.watches.rests_for = forbidden;
                self.due = true;
            }
        }
    }

    /// Looks at one motor's motion, or adds up currents, and asks the new currents. A motion is compared with the currents that were asked
    /// before. All else comes after them: at 40 kHz the nut's loop takes them in less than half a period.
    #[inline(always)]
    fn watch(
        &mut self,
        config: &DriveConfig,
        look: Look,
        ask: impl Fn(),
        exchanges: [&MotorExchange; 2],
        motion: [Motion; 2],
    ) -> Option<Fault> {
        let [screw_exchange, nut_exchange] = exchanges;
        let [screw_limits, nut_limits] = &config.runaway;
        let [screw_loop, nut_loop] = &config.current_loops;
        let [screw_motion, nut_motion] = motion;
        // The currents are asked in two places, for CCM has no room for four.
        if matches!(look, Look::ScrewMotion | Look::NutMotion) {
            let [screw_watch, nut_watch] = &mut self.watches.runaway;
            let sign = if look == Look::ScrewMotion {
                let induced = &screw_loop.regulator.induced;
                let sign = screw_watch.step(screw_limits, induced, screw_exchange, screw_motion);
                sign.map(Sign::of_screw)
            } else {
                let induced = &nut_loop.regulator.induced;
                let sign = nut_watch.step(nut_limits, induced, nut_exchange, nut_motion);
                sign.map(Sign::of_nut)
            };
            ask();
            return sign;
        }
        ask();
        // A runaway grows e-fold in about 0.25 ms: each look that has time for it adds up, but for one of the nut.
        let screw = self.add_up_screw(config, exchanges);
        if screw.is_some() || look == Look::NutHeat {
            return screw;
        }
        self.add_up_nut(config, exchanges)
    }

    /// Adds up the screw's currents.
    #[inline(always)]
    fn add_up_screw(
        &mut self,
        config: &DriveConfig,
        [exchange, _]: [&MotorExchange; 2],
    ) -> Option<Fault> {
        let ([sum, _], [limits, _]) = (&mut self.watches.sums, &config.runaway);
        let [current_loop, _] = &config.current_loops;
        let found = sum.step(limits, &current_loop.sense, exchange);
        found.then_some(Fault::ScrewCurrentSum)
    }

    /// Adds up the nut's currents.
    #[inline(always)]
    fn add_up_nut(
        &mut self,
        config: &DriveConfig,
        [_, exchange]: [&MotorExchange; 2],
    ) -> Option<Fault> {
        let ([_, sum], [_, limits]) = (&mut self.watches.sums, &config.runaway);
        let [_, current_loop] = &config.current_loops;
        let found = sum.step(limits, &current_loop.sense, exchange);
        found.then_some(Fault::NutCurrentSum)
    }

    /// Counts how long a motor at its torque limit has not moved the table, where there is something to count.
    #[inline(always)]
    fn look_at_table(&mut self, config: &DriveConfig, exchanges: [&MotorExchange; 2]) {
        let [screw_limited, nut_limited] = self.commands.torque_limited;
        if screw_limited | nut_limited | (self.watches.pressed != Tally::new()) {
            self.press(config, exchanges);
        }
    }

    /// A table that stands although it is asked to move, with a motor at its torque limit, is stalled: both motors may turn on together.
    #[cold]
    #[inline(never)]
    fn press(&mut self, config: &DriveConfig, exchanges: [&MotorExchange; 2]) {
        if !self.state.is_driven() {
            self.watches.pressed = Tally::new();
            return;
        }
        let [screw_loop, _] = &config.current_loops;
        let [screw_watch, _] = &config.runaway;
        let [.., patience] = screw_watch.tolerances;
        let [screw, nut] = exchanges.map(MotorExchange::theta_step);
        let goes = screw_loop.observer.omega_e(screw.wrapping_sub(nut));
        let (planned, _) = self.planned();
        let asked = planned.saturating_mul_int(screw_watch.pole_pairs);
        let stands = goes.saturating_abs().saturating_mul_int(STANDS) < asked.saturating_abs();
        let [screw_limited, nut_limited] = self.commands.torque_limited;
        let events = u32::from(stands && (screw_limited || nut_limited));
        if self.watches.pressed.step(patience, events) {
            self.watches.found = Some(if screw_limited {
                Fault::ScrewStalled
            } else {
                Fault::NutStalled
            });
            self.due = true;
        }
    }

    /// One motor's current warms its winding and its bridge for a look.
    #[inline(always)]
    fn warm(&mut self, config: &DriveConfig, look: Look, exchanges: [&MotorExchange; 2]) {
        let [screw_exchange, nut_exchange] = exchanges;
        let [screw_heat, nut_heat] = &mut self.watches.heat;
        let [screw_config, nut_config] = &config.heat;
        let [screw_loop, nut_loop] = &config.speed_loops;
        let [screw_max, nut_max] = &mut self.watches.current_max;
        let [screw_hot, nut_hot] = &mut self.watches.too_hot;
        if look == Look::ScrewHeat {
            screw_heat.step(
                screw_config,
                screw_exchange.current(),
                screw_exchange.theta_step(),
            );
            *screw_max = screw_loop.i_max.min(screw_heat.current_max(screw_config));
            *screw_hot = screw_heat.trips(screw_config);
            self.due |= *screw_hot;
        } else {
            nut_heat.step(
                nut_config,
                nut_exchange.current(),
                nut_exchange.theta_step(),
            );
            *nut_max = nut_loop.i_max.min(nut_heat.current_max(nut_config));
            *nut_hot = nut_heat.trips(nut_config);
            self.due |= *nut_hot;
        }
    }

    /// Adds up the currents of motors that are aligned or come to rest, in each step. While they run, the [`Look`]s have time for it that
    /// do not look at motion.
    fn add_up(&mut self, config: &DriveConfig, exchanges: [&MotorExchange; 2]) -> Option<Fault> {
        match self.state {
            State::Aligning | State::Stopping => {
                let screw = self.add_up_screw(config, exchanges);
                screw.or_else(|| self.add_up_nut(config, exchanges))
            }
            State::Running | State::Holding => None,
            _ => {
                self.watches.sums = [CurrentSum::new(); 2];
                None
            }
        }
    }

    /// The three currents of a motor add up, but for noise: in this sample.
    #[cold]
    fn adds_up(config: &DriveConfig, exchanges: [&MotorExchange; 2], motor: usize) -> bool {
        let loops = exchanges.into_iter().zip(&config.current_loops);
        let mut loops = loops.zip(&config.runaway);
        loops
            .nth(motor)
            .is_some_and(|((exchange, current_loop), limits)| {
                sum_events(limits, &current_loop.sense, exchange.codes_of_one_period()) < 2
            })
    }

    #[inline(always)]
    fn heat_fault(&self) -> Option<Fault> {
        match self.watches.too_hot {
            [false, false] => None,
            [true, _] => Some(Fault::ScrewHeat),
            [false, true] => Some(Fault::NutHeat),
        }
    }

    /// What the alignment asks, and what it shall see: it takes its step after that, for the next one. It may take longer than
    /// until the nut's next current loop, and would else be heard a period later now and then.
    #[cold]
    #[inline(never)]
    fn align(
        &mut self,
        config: &DriveConfig,
        scale: Option<u32>,
        exchanges: [&MotorExchange; 2],
    ) -> [CurrentReference; 2] {
        let [screw, nut] = exchanges;
        let [screw_loop, nut_loop] = &config.current_loops;
        let motors = [
            MotorSeen::of(screw, screw_loop, config.speed_divider),
            MotorSeen::of(nut, nut_loop, config.speed_divider),
        ];
        self.aligning.seen = Some((motors, scale));
        let held = exchanges.map(MotorExchange::alignment);
        let asked = self.aligning.asked;
        let aligned = self
            .aligning
            .alignments
            .iter_mut()
            .zip(held)
            .zip(asked.alignment);
        for (exchange, ((last, held), alignment)) in exchanges.into_iter().zip(aligned) {
            // What was asked before the current loop passed the index is not true any more: the next step has seen it too.
            let awaits = |at: Option<EncoderAlignment>| at.is_some_and(|at| at.index_awaited);
            let before_index = held.is_some() && !awaits(held) && awaits(alignment);
            if *last != alignment && !before_index {
                *last = alignment;
                exchange.align(held, alignment);
            }
        }
        self.aligning.aligned = asked.progress;
        asked.current
    }
}

/// How both motors turn in a step, read once from their exchanges: screw, nut.
#[derive(Clone, Copy, Debug)]
struct Turns {
    theta_step: [i32; 2],
    omega_e: [Speed; 2],
    voltage_limited: [bool; 2],
}

impl Turns {
    #[inline(always)]
    fn of(config: &DriveConfig, [screw, nut]: [&MotorExchange; 2]) -> Self {
        let [screw_loop, nut_loop] = &config.current_loops;
        let (screw_step, nut_step) = (screw.theta_step(), nut.theta_step());
        Self {
            theta_step: [screw_step, nut_step],
            omega_e: [
                screw_loop.observer.omega_e(screw_step),
                nut_loop.observer.omega_e(nut_step),
            ],
            voltage_limited: [screw.voltage_limited(), nut.voltage_limited()],
        }
    }

    /// How they follow their references, where the torque limit has cut what was last asked of them.
    #[inline(always)]
    fn following(self, [screw_torque, nut_torque]: [bool; 2]) -> [Following; 2] {
        let [screw_omega_e, nut_omega_e] = self.omega_e;
        let [screw_voltage, nut_voltage] = self.voltage_limited;
        [
            Following {
                omega_e: screw_omega_e,
                limited: screw_voltage || screw_torque,
            },
            Following {
                omega_e: nut_omega_e,
                limited: nut_voltage || nut_torque,
            },
        ]
    }

    /// What the watch of a runaway compares with the currents.
    #[inline(always)]
    fn motion(self, reference: [SpeedReference; 2], torque_limited: [bool; 2]) -> [Motion; 2] {
        let [screw_reference, nut_reference] = reference;
        let [screw_omega_e, nut_omega_e] = self.omega_e;
        let [screw_limited, nut_limited] = torque_limited;
        let [screw_step, nut_step] = self.theta_step;
        let [screw_voltage, nut_voltage] = self.voltage_limited;
        [
            Motion {
                reference: screw_reference.omega_e,
                omega_e: screw_omega_e,
                torque_limited: screw_limited,
                theta_step: screw_step,
                voltage_limited: screw_voltage,
            },
            Motion {
                reference: nut_reference.omega_e,
                omega_e: nut_omega_e,
                torque_limited: nut_limited,
                theta_step: nut_step,
                voltage_limited: nut_voltage,
            },
        ]
    }
}

/// What a step asks in which the pair is not driven.
#[derive(Clone, Copy, Debug)]
struct Undriven {
    /// What the current loops do.
    mode: Mode,
    /// The state is a new one.
    entered: bool,
    /// An alignment has just found the rotors.
    aligned: bool,
}

/// A motor turns so fast that its voltage would show a wrong angle. If the other's encoder is wrong, its voltage shows it once that
/// motor is as fast, and a stop with it costs less than a fast motor that coasts.
#[inline(always)]
fn an_angle_shows(config: &DriveConfig, [screw, nut]: [&MotorExchange; 2]) -> bool {
    let [screw_loop, nut_loop] = &config.current_loops;
    let [screw_limits, nut_limits] = &config.runaway;
    let shows = |limits: &RunawayConfig, current_loop: &CurrentLoopConfig, theta_step: i32| {
        let theta_e_step = theta_step.wrapping_mul(limits.pole_pairs);
        let emf = current_loop.regulator.induced.back_emf(theta_e_step);
        emf.unsigned_abs() > limits.emf_floor
    };
    shows(screw_limits, screw_loop, screw.theta_step())
        || shows(nut_limits, nut_loop, nut.theta_step())
}

/// A bus that reads too little makes all voltages too large, and with them the currents: it is named in place of what found those, the
/// comparators among it.
fn likelier(state: State, config: &DriveConfig, exchanges: [&MotorExchange; 2]) -> State {
    let loops = exchanges.into_iter().zip(&config.current_loops);
    let mut read_nothing =
        loops.map(|(exchange, config)| exchange.bus() < config.modulation.bus_counts_min);
    match state {
        State::Fault(
            Fault::ScrewOverCurrent | Fault::NutOverCurrent | Fault::ScrewBreak | Fault::NutBreak,
        ) if read_nothing.any(|it| it) => State::Fault(Fault::UnderVoltage),
        state => state,
    }
}

/// How an encoder lies to its rotor: `rotor angle = (encoder angle, or minus that) + zero`.
///
/// The alignment gives the electrical zero. So the rotor angle is known but for whole turns by the pole pairs. Recordings have the
/// same angle (`Aligned::rotor_angle` of the link).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct RotorFrame {
    /// 1, or -1 modulo 2^32 where the encoder counts backwards: a product costs less than a branch.
    sense: u32,
    zero: Angle,
}

impl RotorFrame {
    /// The encoder's own angle.
    const ENCODER: Self = Self {
        sense: 1,
        zero: Angle(0),
    };

    #[inline(always)]
    fn of(alignment: Option<EncoderAlignment>, pole_pairs: u32) -> Self {
        alignment.map_or(Self::ENCODER, |alignment| Self {
            sense: if alignment.reversed { u32::MAX } else { 1 },
            // Within half an electrical turn: an angle of zero is found a little above it or below.
            zero: Angle(
                alignment
                    .theta_e_at_zero
                    .0
                    .cast_signed()
                    .checked_div(pole_pairs.cast_signed())
                    .unwrap_or(0)
                    .cast_unsigned(),
            ),
        })
    }

    /// Where the rotor is by its encoder's last count.
    #[inline(always)]
    fn rotor_angle(self, exchange: &MotorExchange, config: &CurrentLoopConfig) -> Angle {
        let angle = config.observer.encoder.angle(exchange.encoder());
        Angle(angle.0.wrapping_mul(self.sense)).plus(self.zero)
    }
}

/// A table that goes by less than this part of what is asked stands.
const STANDS: i32 = 8;

/// What a step looks at beside its control: one thing of one motor, so that no step takes longer for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Look {
    ScrewMotion,
    NutMotion,
    ScrewHeat,
    NutHeat,
    /// Inputs and heartbeat.
    Interlock,
}

impl Look {
    #[inline(always)]
    const fn of(step: u8) -> Self {
        match step & 7 {
            0 | 4 => Self::ScrewMotion,
            1 | 5 => Self::NutMotion,
            2 => Self::ScrewHeat,
            6 => Self::NutHeat,
            _ => Self::Interlock,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::rates::STEPS_PER_HEAT;
    use crate::current::current_loop::Measured;
    use crate::current::sense::Shunts;
    use crate::current::transform::DirectQuadrature;
    use crate::plate::{ThermalPlate, test_plate};

    #[test]
    fn each_look_comes_as_often_as_it_says() {
        for (look, steps) in [
            (Look::ScrewMotion, STEPS_PER_LOOK),
            (Look::NutMotion, STEPS_PER_LOOK),
            (Look::Interlock, STEPS_PER_LOOK),
            (Look::ScrewHeat, STEPS_PER_HEAT),
            (Look::NutHeat, STEPS_PER_HEAT),
        ] {
            // Over the counter's wrap.
            let mut at = (0..512u32).filter(|step| Look::of(*step as u8) == look);
            let mut last = at.next().unwrap();
            for now in at {
                assert_eq!(now - last, steps, "{look:?} in steps {last} and {now}");
                last = now;
            }
            assert!(last > 0, "{look:?} comes once");
        }
    }

    /// One fast motor is enough: the voltage that its turning induces is more than the model may be wrong by. What comes to rest at
    /// speed does so only then.
    #[test]
    fn a_wrong_angle_shows_where_one_motor_is_fast() {
        let config = test_plate().config().unwrap();
        for (fast, shows) in [
            ([0, 0], false),
            ([1, 0], true),
            ([0, -1], true),
            ([1, 1], true),
        ] {
            let exchanges = config
                .current_loops
                .each_ref()
                .map(|config_of| MotorExchange::new(config_of, config.speed_divider));
            for (exchange, way) in exchanges.iter().zip(fast) {
                // A thousandth of a turn a period: 1200 rpm at 20 kHz.
                exchange.publish_shaft(None, way * 4_294_967);
            }
            let [screw, nut] = &exchanges;
            assert_eq!(an_angle_shows(&config, [screw, nut]), shows, "{fast:?}");
            let mut task = SpeedTask::new(&config);
            task.state = State::Running;
            let rests = task.rests(
                &config,
                [screw, nut],
                [Some(Fault::Scale), None, None, None],
            );
            assert_eq!(rests.has(Fault::Scale), shows, "{fast:?}");
            let without = task.rests(&config, [screw, nut], [None; 4]);
            assert_eq!(without, FaultSet::RESTS);
        }
    }

    /// A current that nobody asked, too small for the watch of its error, in a motor that stands.
    #[test]
    fn a_motor_that_gets_too_warm_stops_a_drive_that_runs() {
        let mut plate = test_plate();
        for motor in &mut plate.motors {
            motor.thermal = ThermalPlate {
                rated_rms_a: 0.8,
                seconds: 2.0,
            };
        }
        let config = plate.config().unwrap();
        for (hot, fault) in [(0, Fault::ScrewHeat), (1, Fault::NutHeat)] {
            let exchanges = config
                .current_loops
                .each_ref()
                .map(|config_of| MotorExchange::new(config_of, config.speed_divider));
            let scale = config.current_loops[hot].sense.scale;
            let measured = Measured {
                codes: [0; 3],
                current: DirectQuadrature {
                    d: scale.scaled(Current::ZERO),
                    q: scale.scaled(Current::from_num(1.2)),
                },
            };
            exchanges[hot].publish_currents(&measured, Shunts::Two);
            let mut task = SpeedTask::new(&config);
            task.state = State::Running;
            let mut beat = 0;
            let steps = (0..100_000).find(|_| {
                beat += 1;
                let request = Request {
                    demand: Demand::Run,
                    heartbeat: beat,
                    ..Request::default()
                };
                let [screw, nut] = &exchanges;
                let output = task.step(&config, request, [screw, nut], None);
                if let State::Fault(found) = output.state {
                    assert_eq!(found, fault);
                }
                output.state == State::Fault(fault)
            });
            // Twice the square stands against the rated one, from 0.8 of it to 1.1025.
            let square = 2.0 * 1.2 * 1.2 / (3.0 * 0.8 * 0.8);
            let expected = 2.0 * f64::ln((square - 0.8) / (square - 1.1025));
            let seconds = f64::from(steps.unwrap()) * plate.speed_step();
            assert!(
                (seconds / expected - 1.0).abs() < 0.02,
                "stopped after {seconds} s, expected {expected} s"
            );
        }
    }
}
