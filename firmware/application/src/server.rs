//! The drive's end of the link: who may say what, and what comes of it.
//!
//! A [`Server`] stands at each line (RTT, a serial port, a TCP connection); the [`Commander`] is one for all, so that only
//! one session moves the drive. What is asked is done by a [`Served`] drive, simulated or not.

use control::journal::Journal;
use control::stream::Followed;
use heapless::Vec;
use link::burst::{BurstRequest, BurstSample, BurstStatus, SAMPLES_A_FRAME};
use link::codes::{Demand, State};
use link::frame::{Decoder, FRAME_MAX, count, encode};
use link::message::{
    ARMED_MS, Command, DriveFrame, EVENTS_A_FRAME, Event, FAULTS, HostFrame, Injection, Recorded,
    Refusal, Reply, SETTINGS_A_FRAME, Status, Text,
};
use link::settings::{Effect, Settings, Unfit, WireValue};
use link::telemetry::Real;

/// Furthest that an angle may be put right at once, 2^-32 turn: a twelfth of a turn.
const ANGLE_MAX: u32 = u32::MAX / 12;

/// Why settings do not hold.
#[derive(Clone, Copy, Debug)]
pub enum NotSet {
    /// They do not fit the drive's formats.
    Unfit(Unfit),
    /// The drive does not take them.
    Refused(Refusal),
}

impl core::fmt::Display for NotSet {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Unfit(unfit) => unfit.fmt(f),
            Self::Refused(refusal) => f.write_str(refusal.sentence()),
        }
    }
}

impl core::error::Error for NotSet {}

impl From<Unfit> for NotSet {
    fn from(unfit: Unfit) -> Self {
        Self::Unfit(unfit)
    }
}

/// A drive that a host may command.
pub trait Served {
    /// What it is doing; what the link knows is filled in by the server.
    fn status(&self) -> Status;
    /// What it is doing, in a word.
    fn state(&self) -> State;
    /// Looks at what happened, also before a reset; not where nothing is kept.
    fn journal(&mut self, look: impl FnOnce(&Journal)) {
        let _ = look;
    }
    /// PWM periods a second, and a step of the speed task.
    fn rates(&self) -> (u32, u32);
    /// It is a simulated one.
    fn simulated(&self) -> bool;
    /// Takes speeds, as in [`Command::Run`].
    ///
    /// # Errors
    /// [`Refusal::Velocity`] or [`Refusal::MotorSpeed`]; the old ones stay.
    fn command(&mut self, velocity: i32, base: i32) -> Result<(), Refusal>;
    /// Takes a move, as in [`Command::Move`].
    ///
    /// # Errors
    /// The same, [`Refusal::Distance`] and [`Refusal::SoftLimit`].
    fn travel(&mut self, distance_nm: i64, velocity: i32, base: i32) -> Result<(), Refusal>;
    /// Takes a move to a position, as in [`Command::MoveTo`].
    ///
    /// # Errors
    /// The same, and [`Refusal::NotHomed`].
    fn travel_to(&mut self, position_nm: i64, velocity: i32, base: i32) -> Result<(), Refusal>;
    /// Takes a homing, as in [`Command::Home`].
    ///
    /// # Errors
    /// [`Refusal::MotorSpeed`].
    fn home(&mut self, base: i32) -> Result<(), Refusal>;
    /// Takes a torque, as in [`Command::Torque`].
    ///
    /// # Errors
    /// [`Refusal::Current`], [`Refusal::MotorSpeed`] or [`Refusal::Velocity`]; the old command stays.
    fn torque(&mut self, motor: u8, current: i32, speed: i32, base: i32) -> Result<(), Refusal>;
    /// Opens a stream, as in [`Command::Stream`].
    ///
    /// # Errors
    /// [`Refusal::Delay`], [`Refusal::MotorSpeed`] or [`Refusal::NotHomed`].
    fn stream(&mut self, delay_ms: u16, homed: bool, base: i32) -> Result<(), Refusal>;
    /// Takes a set-point, as in [`Command::SetPoint`].
    ///
    /// # Errors
    /// [`Refusal::NoStream`], [`Refusal::StreamFull`], [`Refusal::Spacing`], [`Refusal::Step`], [`Refusal::Velocity`] or
    /// [`Refusal::SoftLimit`].
    fn set_point(
        &mut self,
        at_us: u32,
        position_nm: i64,
        velocity: Option<i32>,
    ) -> Result<Followed, Refusal>;
    /// Takes a current, as in [`Command::DirectCurrent`], while it runs.
    ///
    /// # Errors
    /// [`Refusal::Current`].
    fn direct_current(&mut self, motor: u8, current: i32) -> Result<(), Refusal>;
    /// Puts an angle right, as in [`Command::Angle`], while it rests and is ready.
    ///
    /// # Errors
    /// [`Refusal::Angle`].
    fn angle(&mut self, motor: u8, behind: i32) -> Result<(), Refusal>;
    /// Takes a demand: see [`Demand`].
    fn demand(&mut self, demand: Demand);
    /// The commanding host is still there.
    fn renew(&mut self);
    /// The base speed, 2^-18 rad/s, for a table velocity, 2^-28 m/s, for which none is commanded.
    fn base_for(&self, velocity: i32) -> i32;
    /// How fast homing goes to its switch, 2^-28 m/s.
    fn home_velocity(&self) -> i32;
    /// The settings that hold.
    fn settings(&self) -> &Settings;
    /// The same with the orders that were learned since.
    fn learned(&self) -> Settings;
    /// Makes these settings hold, and says when they do. Those that take effect after a restart are stored.
    ///
    /// # Errors
    /// [`NotSet`]; nothing is changed then.
    fn configure(&mut self, settings: &Settings) -> Result<Effect, NotSet>;
    /// Stores the settings that hold.
    ///
    /// # Errors
    /// [`NotSet`].
    fn store(&mut self) -> Result<(), NotSet>;
    /// Starts or ends the telemetry.
    fn record(&mut self, request: u32);
    /// Arms a burst.
    ///
    /// # Errors
    /// [`Refusal::BurstWaits`] or [`Refusal::Burst`]; the burst that is there stays.
    fn arm_burst(&mut self, request: BurstRequest) -> Result<(), Refusal>;
    /// Forgets the burst.
    fn end_burst(&mut self);
    /// How it is going.
    fn burst(&self) -> BurstStatus;
    /// Its samples from this one on.
    ///
    /// # Errors
    /// [`Refusal::NoBurst`].
    fn burst_samples(&self, from: u16) -> Result<Vec<BurstSample, SAMPLES_A_FRAME>, Refusal>;
    /// Puts a fault in.
    ///
    /// # Errors
    /// [`Refusal::Real`] or [`Refusal::Injection`].
    fn inject(&mut self, injection: Injection) -> Result<(), Refusal>;
}

/// Who moves the drive.
#[derive(Clone, Debug)]
pub struct Commander {
    /// The next session's number.
    next: u32,
    /// Since when it is armed and rests, ms.
    armed: Option<u32>,
    /// The session that moves it.
    owner: Option<u32>,
    /// The motion that the owner commanded has begun.
    began: bool,
    /// Sessions up to this one are over.
    ended: u32,
    before: State,
    faults: Vec<Event, FAULTS>,
}

impl Commander {
    /// Of a drive that has just started; `sessions` is any number that is another with each start, so that frames from before
    /// are known.
    #[must_use]
    pub const fn new(sessions: u32) -> Self {
        Self {
            next: sessions,
            armed: None,
            owner: None,
            began: false,
            ended: sessions,
            before: State::Boot,
            faults: Vec::new(),
        }
    }

    /// Another start for the numbers of the sessions, as long as there is none: a drive that starts the same each time
    /// has one once a host's first byte comes, at a time that nobody knows.
    pub fn stir(&mut self, sessions: u32) {
        if self.next == 0 {
            (self.next, self.ended) = (sessions, sessions);
        }
    }

    /// That session is over. Numbers rise, and wrap.
    const fn has_ended(&self, session: u32) -> bool {
        session.wrapping_sub(self.ended).cast_signed() <= 0
    }

    /// The drive restarts: all sessions are over.
    fn start_anew(&mut self) {
        (self.armed, self.owner) = (None, None);
        self.ended = self.next;
    }

    /// The drive may be moved.
    #[must_use]
    pub const fn is_armed(&self) -> bool {
        self.armed.is_some()
    }

    /// Once a millisecond: what the drive is doing. A change of state, if there is one.
    pub fn look(&mut self, state: State, now_ms: u32) -> Option<Event> {
        if at_rest(state) {
            // Motion has ended. A session that has just commanded it keeps the drive until it begins.
            if self.began || matches!(state, State::Fault(_)) {
                (self.owner, self.began) = (None, false);
            }
        } else {
            self.began = true;
            if self.armed.is_some() {
                self.armed = Some(now_ms);
            }
        }
        let expired = |since: u32| now_ms.wrapping_sub(since) > ARMED_MS;
        if matches!(state, State::Fault(_)) || self.armed.is_some_and(expired) {
            self.armed = None;
        }
        if state == self.before {
            return None;
        }
        self.before = state;
        let event = Event {
            uptime_ms: now_ms,
            state: state.word(),
            fault: state.fault_word(),
        };
        if event.fault != 0 {
            if self.faults.is_full() {
                self.faults.pop();
            }
            // There is room.
            let _ = self.faults.insert(0, event);
        }
        Some(event)
    }
}

fn at_rest(state: State) -> bool {
    !state.has_bridges_on()
}

/// The drive's end of one line.
#[derive(Clone, Debug)]
pub struct Server {
    decoder: Decoder,
    session: Option<u32>,
    sequence: u32,
    /// As long as there is a session.
    draft: Option<Settings>,
    repeated: u32,
    refused: u32,
}

impl Default for Server {
    fn default() -> Self {
        Self::new()
    }
}

impl Server {
    /// Of a line on which nobody has spoken yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            decoder: Decoder::new(),
            session: None,
            sequence: 0,
            draft: None,
            repeated: 0,
            refused: 0,
        }
    }

    /// Somebody has spoken on the line.
    #[must_use]
    pub const fn has_session(&self) -> bool {
        self.session.is_some()
    }

    /// The next byte of the line. `send` gets the answer's bytes, if the byte ended a frame that has one.
    pub fn take(
        &mut self,
        byte: u8,
        now_ms: u32,
        commander: &mut Commander,
        drive: &mut impl Served,
        send: impl FnOnce(&[u8]),
    ) {
        let Some(frame) = self.decoder.take::<HostFrame>(byte) else {
            return;
        };
        let reply = match self.admit(&frame, commander, drive) {
            Some(reply) => reply,
            None if self.session == Some(frame.session) && !commander.has_ended(frame.session) => {
                if frame.sequence <= self.sequence {
                    count(&mut self.repeated);
                    return;
                }
                self.sequence = frame.sequence;
                self.answer(frame.command, now_ms, commander, drive)
            }
            None => {
                count(&mut self.repeated);
                Reply::Refused(Refusal::Session.word())
            }
        };
        if let Reply::Refused(_) | Reply::Unfit { .. } = reply {
            count(&mut self.refused);
        }
        let mut buffer = [0; FRAME_MAX];
        if let Some(bytes) = encode(&DriveFrame::Reply(frame.sequence, reply), &mut buffer) {
            send(bytes);
        }
    }

    /// A new session, if that is what is asked.
    fn admit(
        &mut self,
        frame: &HostFrame,
        commander: &mut Commander,
        drive: &impl Served,
    ) -> Option<Reply> {
        if frame.command != Command::Hello {
            return None;
        }
        // 0 is no session.
        commander.next = commander.next.wrapping_add(1).max(1);
        self.session = Some(commander.next);
        self.sequence = 0;
        self.draft = Some(*drive.settings());
        let (pwm_hz, speed_divider) = drive.rates();
        Some(Reply::Hello {
            session: commander.next,
            simulated: drive.simulated(),
            pwm_hz,
            speed_divider,
        })
    }

    #[inline(never)]
    fn answer(
        &mut self,
        command: Command,
        now_ms: u32,
        commander: &mut Commander,
        drive: &mut impl Served,
    ) -> Reply {
        let done = match command {
            Command::Hello => Ok(()),
            Command::Heartbeat => {
                if commander.owner == self.session {
                    drive.renew();
                }
                Ok(())
            }
            Command::Status => return Reply::Status(self.status(commander, drive)),
            Command::Faults => return Reply::Faults(commander.faults.clone()),
            Command::Journal { after } => return events(drive, after),
            Command::Arm => self.arm(now_ms, commander, drive),
            Command::Run { .. }
            | Command::Move { .. }
            | Command::MoveTo { .. }
            | Command::Home { .. }
            | Command::Torque { .. }
            | Command::Stream { .. } => {
                self.run(commander, drive, |drive| set_motion(command, drive))
            }
            Command::DirectCurrent { motor, current } => self
                .may_move(commander, drive)
                .and_then(|()| direct_current(drive, motor, current)),
            Command::Angle { motor, behind } => put_angle_right(drive, motor, behind),
            Command::Stop => {
                (commander.armed, commander.owner) = (None, None);
                drive.demand(Demand::Rest);
                Ok(())
            }
            Command::Reset => {
                drive.demand(Demand::Reset);
                Ok(())
            }
            Command::Record(request) => {
                drive.record(request);
                Ok(())
            }
            Command::Settings { from } => return settings(drive.settings(), from),
            Command::Learned { from } => return learned(drive, from),
            Command::Draft { id, value } => self.change_draft(id, value),
            Command::Discard => {
                self.draft = Some(*drive.settings());
                Ok(())
            }
            Command::Commit => return set(self.commit(commander, drive)),
            Command::Store if !at_rest(drive.state()) => Err(Refusal::Moving),
            Command::Store => return set(drive.store()),
            Command::Burst(request) => drive.arm_burst(request),
            Command::EndBurst => {
                drive.end_burst();
                Ok(())
            }
            Command::BurstStatus => return Reply::Burst(drive.burst()),
            Command::BurstSamples { from } => return burst_samples(drive, from),
            Command::Inject(injection) => drive.inject(injection),
            Command::SetPoint {
                at_us,
                position_nm,
                velocity,
            } => {
                let taken = self
                    .commands(commander)
                    .and_then(|()| drive.set_point(at_us, position_nm, velocity));
                match taken {
                    Ok(followed) => return go_on(drive, followed),
                    Err(refusal) => Err(refusal),
                }
            }
        };
        match done {
            Ok(()) => Reply::Done,
            Err(refusal) => Reply::Refused(refusal.word()),
        }
    }

    fn status(&self, commander: &Commander, drive: &impl Served) -> Status {
        Status {
            armed: commander.is_armed(),
            frames: self.decoder.count(),
            repeated: self.repeated,
            refused: self.refused,
            ..drive.status()
        }
    }

    fn change_draft(&mut self, id: u16, value: WireValue) -> Result<(), Refusal> {
        let draft = self.draft.as_mut().ok_or(Refusal::Session)?;
        draft.set(id, value.into()).map_err(|_| Refusal::Setting)
    }

    /// Makes the draft hold. A drive that moves takes what holds at once, and nothing else.
    fn commit(&self, commander: &mut Commander, drive: &mut impl Served) -> Result<(), NotSet> {
        let draft = self.draft.as_ref();
        let draft = draft.ok_or(NotSet::Refused(Refusal::Session))?;
        let state = drive.state();
        let at_once = || state.is_driven() && drive.settings().effect(draft) == Effect::AtOnce;
        if !(at_rest(state) || at_once()) {
            return Err(NotSet::Refused(Refusal::Moving));
        }
        if drive.configure(draft)? == Effect::Restart {
            commander.start_anew();
        }
        Ok(())
    }

    /// Lets the drive be moved. A drive that does not know its rotor angles begins to align.
    fn arm(
        &self,
        now_ms: u32,
        commander: &mut Commander,
        drive: &mut impl Served,
    ) -> Result<(), Refusal> {
        let aligns = drive.state() == State::Unaligned;
        if !aligns {
            runnable(drive.state())?;
        } else if commander.owner.is_some() && commander.owner != self.session {
            return Err(Refusal::Commanded);
        }
        commander.armed = Some(now_ms);
        if aligns {
            self.start(commander, drive, Demand::Align);
        }
        Ok(())
    }

    fn may_move(&self, commander: &Commander, drive: &impl Served) -> Result<(), Refusal> {
        runnable(drive.state())?;
        if commander.owner.is_some() && commander.owner != self.session {
            return Err(Refusal::Commanded);
        }
        if commander.armed.is_none() {
            return Err(Refusal::NotArmed);
        }
        Ok(())
    }

    /// Runs the drive with what `set` gives it, if it may be moved.
    fn run<D: Served>(
        &self,
        commander: &mut Commander,
        drive: &mut D,
        set: impl FnOnce(&mut D) -> Result<(), Refusal>,
    ) -> Result<(), Refusal> {
        self.may_move(commander, drive)?;
        set(drive)?;
        self.start(commander, drive, Demand::Run);
        Ok(())
    }

    /// This session moves the drive.
    fn commands(&self, commander: &Commander) -> Result<(), Refusal> {
        match commander.owner {
            None => Err(Refusal::NoStream),
            owner if owner != self.session => Err(Refusal::Commanded),
            _ => Ok(()),
        }
    }

    fn start(&self, commander: &mut Commander, drive: &mut impl Served, demand: Demand) {
        (commander.owner, commander.began) = (self.session, false);
        drive.renew();
        drive.demand(demand);
    }
}

fn runnable(state: State) -> Result<(), Refusal> {
    match state {
        State::Ready | State::Running | State::Holding | State::Stopping => Ok(()),
        State::Fault(_) => Err(Refusal::Fault),
        State::Unaligned => Err(Refusal::Unaligned),
        State::Boot | State::SelfTest | State::Aligning => Err(Refusal::NotReady),
    }
}

/// The latest events of the journal, after so many.
fn events(drive: &mut impl Served, after: u8) -> Reply {
    let mut some = Vec::new();
    drive.journal(|journal| {
        let events = journal.latest().skip(after.into()).take(EVENTS_A_FRAME);
        some = events.map(Recorded::from).collect();
    });
    Reply::Events(some)
}

/// Gives the drive the motion that a command asks. What is no motion sets none.
fn set_motion(command: Command, drive: &mut impl Served) -> Result<(), Refusal> {
    match command {
        Command::Run { velocity, base } => {
            let base = base.unwrap_or_else(|| drive.base_for(velocity));
            drive.command(velocity, base)
        }
        Command::Move {
            distance_nm,
            velocity,
            base,
        } => {
            let base = base.unwrap_or_else(|| drive.base_for(velocity));
            drive.travel(distance_nm, velocity, base)
        }
        Command::MoveTo {
            position_nm,
            velocity,
            base,
        } => {
            let base = base.unwrap_or_else(|| drive.base_for(velocity));
            drive.travel_to(position_nm, velocity, base)
        }
        Command::Home { base } => {
            let base = base.unwrap_or_else(|| drive.base_for(drive.home_velocity()));
            drive.home(base)
        }
        Command::Torque {
            motor,
            current,
            speed,
            base,
        } => drive.torque(motor, current, speed, base),
        Command::Stream {
            delay_ms,
            homed,
            base,
        } => drive.stream(delay_ms, homed, base),
        _ => Ok(()),
    }
}

fn direct_current(drive: &mut impl Served, motor: u8, current: i32) -> Result<(), Refusal> {
    match drive.state() {
        State::Running | State::Holding => drive.direct_current(motor, current),
        _ => Err(Refusal::AtRest),
    }
}

fn put_angle_right(drive: &mut impl Served, motor: u8, behind: i32) -> Result<(), Refusal> {
    match drive.state() {
        State::Ready if behind.unsigned_abs() > ANGLE_MAX => Err(Refusal::Angle),
        State::Ready => drive.angle(motor, behind),
        state => runnable(state).and(Err(Refusal::Moving)),
    }
}

fn burst_samples(drive: &impl Served, from: u16) -> Reply {
    match drive.burst_samples(from) {
        Ok(samples) => Reply::BurstSamples(samples),
        Err(refusal) => Reply::Refused(refusal.word()),
    }
}

/// A stream goes on, and who streams is there.
fn go_on(drive: &mut impl Served, followed: Followed) -> Reply {
    drive.renew();
    let Followed { ahead_us, error_nm } = followed;
    Reply::Followed { ahead_us, error_nm }
}

/// By itself: all settings are kilobytes, which not each answer is to have on its stack.
#[inline(never)]
fn learned(drive: &impl Served, from: u16) -> Reply {
    settings(&drive.learned(), from)
}

fn settings(settings: &Settings, from: u16) -> Reply {
    let mut some: Vec<(u16, WireValue), SETTINGS_A_FRAME> = Vec::new();
    for setting in Settings::all().filter(|setting| setting.id >= from) {
        let Some(value) = settings.get(setting.id) else {
            continue;
        };
        if some.push((setting.id, value.into())).is_err() {
            break;
        }
    }
    Reply::Settings(some)
}

fn set(done: Result<(), NotSet>) -> Reply {
    match done {
        Ok(()) => Reply::Done,
        Err(NotSet::Unfit(unfit)) => said(&unfit),
        Err(NotSet::Refused(refusal)) => Reply::Refused(refusal.word()),
    }
}

fn said(unfit: &Unfit) -> Reply {
    let text = |words: &str| {
        let mut text = Text::new();
        for letter in words.chars() {
            if text.push(letter).is_err() {
                break;
            }
        }
        text
    };
    let misfit = &unfit.misfit;
    Reply::Unfit {
        id: unfit.setting.map_or(0, |(setting, _)| setting.id),
        value: unfit.setting.map(|(_, value)| value.into()),
        name: text(misfit.name),
        unit: text(misfit.unit),
        is: Real::new(misfit.value),
        least: Real::new(misfit.least),
        below: Real::new(misfit.below),
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use link::codes::Fault;
    use link::message::Injected;
    use link::settings::Setting;
    use proptest::prelude::*;
    use std::vec;
    use std::vec::Vec as Bytes;

    struct Fake {
        state: State,
        settings: Settings,
        runs: u32,
        renewed: u32,
    }

    impl Fake {
        fn new() -> Self {
            Self {
                state: State::Ready,
                settings: Settings::DEFAULT,
                runs: 0,
                renewed: 0,
            }
        }
    }

    impl Served for Fake {
        fn status(&self) -> Status {
            Status::default()
        }
        fn state(&self) -> State {
            self.state
        }
        fn rates(&self) -> (u32, u32) {
            (20_000, 4)
        }
        fn simulated(&self) -> bool {
            true
        }
        fn command(&mut self, velocity: i32, _: i32) -> Result<(), Refusal> {
            if velocity > 100 {
                return Err(Refusal::Velocity);
            }
            Ok(())
        }
        fn travel(&mut self, _: i64, _: i32, _: i32) -> Result<(), Refusal> {
            Ok(())
        }
        fn travel_to(&mut self, _: i64, _: i32, _: i32) -> Result<(), Refusal> {
            Ok(())
        }
        fn home(&mut self, _: i32) -> Result<(), Refusal> {
            Ok(())
        }
        fn torque(&mut self, _: u8, _: i32, _: i32, _: i32) -> Result<(), Refusal> {
            Ok(())
        }
        fn stream(&mut self, _: u16, _: bool, _: i32) -> Result<(), Refusal> {
            Ok(())
        }
        fn set_point(&mut self, _: u32, _: i64, _: Option<i32>) -> Result<Followed, Refusal> {
            Ok(Followed::default())
        }
        fn direct_current(&mut self, _: u8, _: i32) -> Result<(), Refusal> {
            Ok(())
        }
        fn angle(&mut self, _: u8, _: i32) -> Result<(), Refusal> {
            Ok(())
        }
        fn demand(&mut self, demand: Demand) {
            match demand {
                Demand::Run => {
                    self.runs += 1;
                    self.state = State::Running;
                }
                Demand::Align => self.state = State::Aligning,
                Demand::Rest => self.state = State::Ready,
                Demand::Reset => {}
            }
        }
        fn renew(&mut self) {
            self.renewed += 1;
        }
        fn base_for(&self, _: i32) -> i32 {
            0
        }
        fn home_velocity(&self) -> i32 {
            0
        }
        fn settings(&self) -> &Settings {
            &self.settings
        }
        fn learned(&self) -> Settings {
            self.settings
        }
        fn configure(&mut self, settings: &Settings) -> Result<Effect, NotSet> {
            let effect = self.settings.effect(settings);
            self.settings = *settings;
            Ok(effect)
        }
        fn store(&mut self) -> Result<(), NotSet> {
            Ok(())
        }
        fn record(&mut self, _: u32) {}
        fn arm_burst(&mut self, _: BurstRequest) -> Result<(), Refusal> {
            Ok(())
        }
        fn end_burst(&mut self) {}
        fn burst(&self) -> BurstStatus {
            BurstStatus::default()
        }
        fn burst_samples(&self, _: u16) -> Result<Vec<BurstSample, SAMPLES_A_FRAME>, Refusal> {
            Err(Refusal::NoBurst)
        }
        fn inject(&mut self, injection: Injection) -> Result<(), Refusal> {
            Injected::of_word(injection.fault)
                .map(drop)
                .ok_or(Refusal::Injection)
        }
    }

    struct Line {
        server: Server,
        session: u32,
        sequence: u32,
    }

    impl Line {
        fn new() -> Self {
            Self {
                server: Server::new(),
                session: 0,
                sequence: 0,
            }
        }

        fn frame(&mut self, command: Command) -> Bytes<u8> {
            self.sequence += 1;
            let frame = HostFrame {
                session: self.session,
                sequence: self.sequence,
                command,
            };
            encode(&frame, &mut [0; FRAME_MAX]).unwrap().to_vec()
        }

        fn send(
            &mut self,
            bytes: &[u8],
            commander: &mut Commander,
            drive: &mut Fake,
        ) -> Bytes<Reply> {
            let mut replies = Bytes::new();
            let mut decoder = Decoder::new();
            for &byte in bytes {
                self.server.take(byte, 0, commander, drive, |answer| {
                    replies.extend(answer.iter().filter_map(|&byte| decoder.take(byte)).map(
                        |frame| match frame {
                            DriveFrame::Reply(_, reply) => reply,
                            other => panic!("{other:?}"),
                        },
                    ));
                });
            }
            replies
        }

        fn ask(&mut self, command: Command, commander: &mut Commander, drive: &mut Fake) -> Reply {
            let frame = self.frame(command);
            let mut replies = self.send(&frame, commander, drive);
            assert_eq!(replies.len(), 1, "{command:?}: {replies:?}");
            let reply = replies.pop().unwrap();
            if let Reply::Hello { session, .. } = reply {
                self.session = session;
                self.sequence = 0;
            }
            reply
        }
    }

    const RUN: Command = Command::Run {
        velocity: 5,
        base: Some(0),
    };

    fn refused(refusal: Refusal) -> Reply {
        Reply::Refused(refusal.word())
    }

    #[test]
    fn a_direct_current_takes_a_drive_that_runs_for_who_moves_it() {
        let (mut commander, mut drive) = (Commander::new(5), Fake::new());
        let (mut line, mut other) = (Line::new(), Line::new());
        let command = Command::DirectCurrent {
            motor: 0,
            current: 1,
        };
        for host in [&mut line, &mut other] {
            host.ask(Command::Hello, &mut commander, &mut drive);
        }
        let refused = |refusal: Refusal| Reply::Refused(refusal.word());
        let first = line.ask(command, &mut commander, &mut drive);
        assert_eq!(first, refused(Refusal::NotArmed));
        line.ask(Command::Arm, &mut commander, &mut drive);
        let rests = line.ask(command, &mut commander, &mut drive);
        assert_eq!(rests, refused(Refusal::AtRest));
        line.ask(RUN, &mut commander, &mut drive);
        assert_eq!(line.ask(command, &mut commander, &mut drive), Reply::Done);
        let others = other.ask(command, &mut commander, &mut drive);
        assert_eq!(others, refused(Refusal::Commanded));
    }

    #[test]
    fn nothing_moves_that_is_not_armed() {
        let (mut commander, mut drive, mut line) = (Commander::new(7), Fake::new(), Line::new());
        assert_eq!(
            line.ask(RUN, &mut commander, &mut drive),
            refused(Refusal::Session)
        );
        line.ask(Command::Hello, &mut commander, &mut drive);
        assert_eq!(
            line.ask(RUN, &mut commander, &mut drive),
            refused(Refusal::NotArmed)
        );
        assert_eq!(drive.runs, 0);
        assert_eq!(
            line.ask(Command::Arm, &mut commander, &mut drive),
            Reply::Done
        );
        assert_eq!(line.ask(RUN, &mut commander, &mut drive), Reply::Done);
        assert_eq!((drive.runs, drive.renewed), (1, 1));
        line.ask(Command::Heartbeat, &mut commander, &mut drive);
        assert_eq!(drive.renewed, 2);
        line.ask(Command::Stop, &mut commander, &mut drive);
        assert_eq!(
            line.ask(RUN, &mut commander, &mut drive),
            refused(Refusal::NotArmed)
        );
    }

    /// A host that commands within the millisecond in which the drive becomes ready is heard before that look.
    #[test]
    fn who_commands_as_the_drive_becomes_ready_keeps_it() {
        let (mut commander, mut drive, mut line) = (Commander::new(0), Fake::new(), Line::new());
        for before in [State::SelfTest, State::Aligning] {
            drive.state = State::Ready;
            commander.look(before, 1);
            line.ask(Command::Hello, &mut commander, &mut drive);
            line.ask(Command::Arm, &mut commander, &mut drive);
            line.ask(RUN, &mut commander, &mut drive);
            for (state, kept) in [(State::Ready, 1), (State::Running, 1), (State::Ready, 0)] {
                commander.look(state, 2);
                let renewed = drive.renewed;
                line.ask(Command::Heartbeat, &mut commander, &mut drive);
                assert_eq!(drive.renewed, renewed + kept, "{before:?}, then {state:?}");
            }
        }
    }

    /// An unaligned drive is aligned by who arms it, whose heartbeat counts until it is done.
    #[test]
    fn an_unaligned_drive_is_aligned_by_arming_and_takes_no_run() {
        let (mut commander, mut drive, mut line) = (Commander::new(0), Fake::new(), Line::new());
        drive.state = State::Unaligned;
        line.ask(Command::Hello, &mut commander, &mut drive);
        let reply = line.ask(RUN, &mut commander, &mut drive);
        assert_eq!(reply, refused(Refusal::Unaligned));
        assert_eq!(
            line.ask(Command::Arm, &mut commander, &mut drive),
            Reply::Done
        );
        assert_eq!(drive.state, State::Aligning);
        commander.look(State::Aligning, 1);
        let reply = line.ask(RUN, &mut commander, &mut drive);
        assert_eq!(reply, refused(Refusal::NotReady));
        let renewed = drive.renewed;
        line.ask(Command::Heartbeat, &mut commander, &mut drive);
        assert_eq!(drive.renewed, renewed + 1);
        let mut other = Line::new();
        other.ask(Command::Hello, &mut commander, &mut drive);
        other.ask(Command::Heartbeat, &mut commander, &mut drive);
        assert_eq!(drive.renewed, renewed + 1, "another's heartbeat does not");
        other.ask(Command::Stop, &mut commander, &mut drive);
        assert!(!commander.is_armed(), "any session stops it");
    }

    #[test]
    fn a_fault_and_ten_minutes_of_rest_disarm() {
        let (mut commander, mut drive, mut line) = (Commander::new(0), Fake::new(), Line::new());
        line.ask(Command::Hello, &mut commander, &mut drive);
        line.ask(Command::Arm, &mut commander, &mut drive);
        assert!(commander.look(State::Ready, ARMED_MS).is_some());
        assert!(commander.is_armed());
        commander.look(State::Ready, ARMED_MS + 1);
        assert!(!commander.is_armed());
        line.ask(Command::Arm, &mut commander, &mut drive);
        let fault = State::Fault(Fault::NutEncoder);
        let event = commander.look(fault, 1234).unwrap();
        assert!(!commander.is_armed());
        assert_eq!(
            (event.uptime_ms, event.fault),
            (1234, Fault::NutEncoder.word())
        );
        drive.state = fault;
        assert_eq!(
            line.ask(Command::Arm, &mut commander, &mut drive),
            refused(Refusal::Fault)
        );
        let Reply::Faults(faults) = line.ask(Command::Faults, &mut commander, &mut drive) else {
            panic!("faults");
        };
        assert_eq!(faults[..], [event]);
    }

    #[test]
    fn what_comes_again_does_nothing() {
        let (mut commander, mut drive, mut line) = (Commander::new(0), Fake::new(), Line::new());
        line.ask(Command::Hello, &mut commander, &mut drive);
        line.ask(Command::Arm, &mut commander, &mut drive);
        let run = line.frame(RUN);
        assert_eq!(line.send(&run, &mut commander, &mut drive), [Reply::Done]);
        assert_eq!(line.send(&run, &mut commander, &mut drive), []);
        // All of it again, the session's opening too: it opens another, in which the old frames are none.
        line.ask(Command::Stop, &mut commander, &mut drive);
        let mut again = Line::new();
        let hello = again.frame(Command::Hello);
        let replies = line.send(&[&hello[..], &run].concat(), &mut commander, &mut drive);
        assert_eq!(replies.last(), Some(&refused(Refusal::Session)));
        assert_eq!(drive.runs, 1);
    }

    #[test]
    fn one_session_moves_the_drive_and_any_stops_it() {
        let (mut commander, mut drive) = (Commander::new(0), Fake::new());
        let (mut one, mut other) = (Line::new(), Line::new());
        for line in [&mut one, &mut other] {
            line.ask(Command::Hello, &mut commander, &mut drive);
        }
        one.ask(Command::Arm, &mut commander, &mut drive);
        one.ask(RUN, &mut commander, &mut drive);
        commander.look(drive.state, 1);
        assert_eq!(
            other.ask(RUN, &mut commander, &mut drive),
            refused(Refusal::Commanded)
        );
        // Its heartbeat does not keep another's command alive.
        other.ask(Command::Heartbeat, &mut commander, &mut drive);
        assert_eq!(drive.renewed, 1);
        other.ask(Command::Stop, &mut commander, &mut drive);
        assert_eq!(drive.state, State::Ready);
    }

    #[test]
    fn a_drive_that_moves_takes_what_holds_at_once_and_no_more() {
        let (mut commander, mut drive, mut line) = (Commander::new(0), Fake::new(), Line::new());
        line.ask(Command::Hello, &mut commander, &mut drive);
        drive.state = State::Running;
        let moving = refused(Refusal::Moving);
        for (name, value, answer) in [
            ("tuning.speed_rad_s", 150.0, &Reply::Done),
            ("feed.velocity_max_mm_s", 50.0, &moving),
            ("feed.lead_mm", 10.0, &moving),
        ] {
            line.ask(Command::Discard, &mut commander, &mut drive);
            let id = Setting::named(name).unwrap().id;
            let value = WireValue::Real(Real::new(value));
            line.ask(Command::Draft { id, value }, &mut commander, &mut drive);
            let said = line.ask(Command::Commit, &mut commander, &mut drive);
            assert_eq!(&said, answer, "{name}");
        }
        assert_eq!(drive.settings.tuning.speed_rad_s, 150.0);
        assert_eq!(drive.settings.feed, Settings::DEFAULT.feed);
        assert_eq!(line.ask(Command::Store, &mut commander, &mut drive), moving);
        drive.state = State::Aligning;
        line.ask(Command::Discard, &mut commander, &mut drive);
        let said = line.ask(Command::Commit, &mut commander, &mut drive);
        assert_eq!(said, moving);
    }

    #[test]
    fn settings_are_taken_all_or_none_and_not_while_it_moves() {
        let (mut commander, mut drive, mut line) = (Commander::new(0), Fake::new(), Line::new());
        line.ask(Command::Hello, &mut commander, &mut drive);
        let draft = |number, value| Command::Draft {
            id: number,
            value: WireValue::Real(Real::new(value)),
        };
        assert_eq!(
            line.ask(draft(0x0401, 10.0), &mut commander, &mut drive),
            Reply::Done
        );
        assert_eq!(
            line.ask(draft(0x0401, -1.0), &mut commander, &mut drive),
            refused(Refusal::Setting)
        );
        assert_eq!(drive.settings, Settings::DEFAULT);
        drive.state = State::Running;
        assert_eq!(
            line.ask(Command::Commit, &mut commander, &mut drive),
            refused(Refusal::Moving)
        );
        drive.state = State::Ready;
        assert_eq!(
            line.ask(Command::Commit, &mut commander, &mut drive),
            Reply::Done
        );
        assert_eq!(drive.settings.feed.lead_mm, 10.0);

        // The drive restarts, and all sessions are over.
        assert_eq!(
            line.ask(Command::Status, &mut commander, &mut drive),
            refused(Refusal::Session)
        );
        line.ask(Command::Hello, &mut commander, &mut drive);
        let (mut all, mut from) = (0, 0);
        while let Reply::Settings(some) =
            line.ask(Command::Settings { from }, &mut commander, &mut drive)
            && let Some((last, _)) = some.last()
        {
            (all, from) = (all + some.len(), last + 1);
        }
        assert_eq!(all, Settings::all().count());
    }

    /// The longest of each kind: a frame that did not fit would be no answer.
    #[test]
    fn each_answer_fits_into_a_frame() {
        let most = u32::MAX;
        let motor = link::message::MotorStatus {
            current: [i32::MIN; 2],
            speed: i32::MIN,
            encoder: most,
            alignment: link::message::Aligned::Backwards { zero: most },
            bus_mv: most,
        };
        let event = Event {
            uptime_ms: most,
            state: most,
            fault: most,
        };
        let value = WireValue::Real(Real::new(1.0));
        let mut text = Text::new();
        while text.push('x').is_ok() {}
        let real = Real::new(0.1);
        let replies = [
            Reply::Status(Status {
                uptime_ms: most,
                motors: [motor; 2],
                scale: i32::MIN,
                dropped: most,
                repeated: most,
                refused: most,
                frames: link::frame::FrameCount {
                    frames: most,
                    damaged: most,
                    too_long: most,
                    versions: most,
                },
                ..Status::default()
            }),
            Reply::Faults((0..FAULTS).map(|_| event).collect()),
            Reply::Burst(BurstStatus {
                state: most,
                request: BurstRequest {
                    motor: u8::MAX,
                    trigger: most,
                    signal: most,
                    level: i32::MIN,
                    before: u16::MAX,
                    divider: u8::MAX,
                },
                before: u16::MAX,
                period: most,
                reversed: true,
            }),
            Reply::BurstSamples(
                (0..SAMPLES_A_FRAME)
                    .map(|_| BurstSample {
                        encoder: most,
                        phases: [i32::MIN; 2],
                        i_q: i32::MIN,
                        i_q_ref: i32::MIN,
                        voltage: [i32::MIN; 2],
                    })
                    .collect(),
            ),
            Reply::Settings((0..SETTINGS_A_FRAME).map(|_| (u16::MAX, value)).collect()),
            Reply::Unfit {
                id: u16::MAX,
                value: Some(value),
                name: text.clone(),
                unit: text,
                is: real,
                least: real,
                below: real,
            },
        ];
        for reply in replies {
            let frame = DriveFrame::Reply(most, reply);
            let mut buffer = [0; FRAME_MAX];
            assert!(encode(&frame, &mut buffer).is_some(), "{frame:?}");
        }
    }

    fn commands() -> impl Strategy<Value = Command> {
        prop_oneof![
            Just(Command::Hello),
            Just(Command::Heartbeat),
            Just(Command::Status),
            Just(Command::Faults),
            any::<u8>().prop_map(|after| Command::Journal { after }),
            Just(Command::Arm),
            Just(Command::Stop),
            Just(Command::Reset),
            Just(Command::Commit),
            Just(Command::Discard),
            any::<(i32, Option<i32>)>()
                .prop_map(|(velocity, base)| Command::Run { velocity, base }),
            any::<(i64, i32, Option<i32>)>().prop_map(|(distance_nm, velocity, base)| {
                Command::Move {
                    distance_nm,
                    velocity,
                    base,
                }
            }),
            any::<(i64, i32, Option<i32>)>().prop_map(|(position_nm, velocity, base)| {
                Command::MoveTo {
                    position_nm,
                    velocity,
                    base,
                }
            }),
            any::<(u8, i32, i32, i32)>().prop_map(|(motor, current, speed, base)| {
                Command::Torque {
                    motor,
                    current,
                    speed,
                    base,
                }
            }),
            any::<(u16, bool, i32)>().prop_map(|(delay_ms, homed, base)| Command::Stream {
                delay_ms,
                homed,
                base,
            }),
            any::<(u32, i64, Option<i32>)>().prop_map(|(at_us, position_nm, velocity)| {
                Command::SetPoint {
                    at_us,
                    position_nm,
                    velocity,
                }
            }),
            any::<(u8, i32)>()
                .prop_map(|(motor, current)| Command::DirectCurrent { motor, current }),
            any::<u32>().prop_map(Command::Record),
            any::<u16>().prop_map(|from| Command::Settings { from }),
            any::<u16>().prop_map(|from| Command::Learned { from }),
            any::<(u8, u32, u32, i32, u16, u8)>().prop_map(
                |(motor, trigger, signal, level, before, divider)| {
                    Command::Burst(BurstRequest {
                        motor,
                        trigger,
                        signal,
                        level,
                        before,
                        divider,
                    })
                }
            ),
            Just(Command::EndBurst),
            Just(Command::BurstStatus),
            any::<u16>().prop_map(|from| Command::BurstSamples { from }),
            (0u16..0x1200, any::<f64>()).prop_map(|(id, x)| Command::Draft {
                id,
                value: WireValue::Real(Real::new(x))
            }),
            any::<(u32, u8)>().prop_map(|(fault, motor)| Command::Inject(Injection {
                fault,
                motor,
                amount: Real::new(1.0)
            })),
        ]
    }

    proptest! {
        /// Frames of any session in any order, with anything between them: no panic, one answer at most to each, and nothing
        /// that runs unarmed.
        #[test]
        fn any_traffic_is_answered_or_dropped(
            frames in prop::collection::vec(
                (commands(), 0u32..4, 0u32..12, prop::collection::vec(any::<u8>(), 0..20)),
                0..40,
            ),
        ) {
            let (mut commander, mut drive, mut line) = (Commander::new(0), Fake::new(), Line::new());
            for (now, (command, session, sequence, garbage)) in (0..).zip(frames) {
                let frame = HostFrame { session, sequence, command };
                let mut bytes = garbage;
                bytes.push(0);
                bytes.extend(encode(&frame, &mut [0; FRAME_MAX]).unwrap());
                let (runs, armed) = (drive.runs, commander.is_armed());
                let replies = line.send(&bytes, &mut commander, &mut drive);
                prop_assert!(replies.len() <= 1, "{replies:?}");
                prop_assert!(armed || drive.runs == runs, "{command:?} ran a drive that is not armed");
                commander.look(drive.state, now);
            }
        }
    }
}
