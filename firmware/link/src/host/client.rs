//! A host's session with a drive over a line of bytes.

use crate::burst::{BurstStatus, SAMPLES};
use crate::codes::State;
use crate::host::burst::Burst;
use crate::host::session::Session;
use crate::message::{Command, DriveFrame, Event, Recorded, Refusal, Reply, Status};
use crate::settings::{Effect, Setting, Settings, Value};
use crate::telemetry::Frame;
use anyhow::{Context, Result, bail};
use std::collections::VecDeque;
use std::fmt;
use std::io;
use std::time::{Duration, Instant};

/// How long an answer may take.
pub const PATIENCE: Duration = Duration::from_secs(1);
/// How long a drive may take to start.
const STARTS: Duration = Duration::from_secs(5);
/// How often what may be asked again is asked.
const TRIES: u32 = 3;

/// Between two heartbeats of an alignment: far below the shortest time that a drive may be set to.
const BEAT: Duration = Duration::from_millis(20);
/// Longest that an alignment may take by the drive's clock, ms: its own limit and the self-test.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
const ALIGNS_MS: u32 = (control::alignment::LONGEST_S * 1e3) as u32 + 2000;

/// A line of bytes to a drive.
pub trait Line {
    /// Sends all of them.
    ///
    /// # Errors
    /// The line is gone.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// What has come; waits for it no longer than `patience`, and gives 0 then.
    ///
    /// # Errors
    /// The line is gone.
    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize>;

    /// The clock that patience runs by: a drive whose time is not this computer's has one of its own.
    fn now(&self) -> Instant {
        Instant::now()
    }
}

impl<L: Line + ?Sized> Line for Box<L> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        (**self).send(bytes)
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        (**self).receive(bytes, patience)
    }

    fn now(&self) -> Instant {
        (**self).now()
    }
}

/// The drive does not do what was asked.
#[derive(Clone, Debug, PartialEq)]
pub enum Refused {
    /// For this reason.
    For(Refusal),
    /// The settings do not fit its formats, in a sentence.
    Unfit(String),
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::For(refusal) => f.write_str(refusal.sentence()),
            Self::Unfit(sentence) => f.write_str(sentence),
        }
    }
}

impl std::error::Error for Refused {}

/// The drive does not answer any more.
#[derive(Clone, Debug, PartialEq)]
pub struct Lost(pub String);

impl fmt::Display for Lost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Lost {}

/// A session.
#[derive(Debug)]
pub struct Client<L> {
    line: L,
    session: Session,
    reply: Option<Reply>,
    /// What was posted and is not answered, and the answers.
    posted: VecDeque<u32>,
    answers: VecDeque<(u32, Reply)>,
    events: VecDeque<Event>,
    telemetry: VecDeque<Frame>,
}

impl<L: Line> Client<L> {
    /// Opens a session.
    ///
    /// # Errors
    /// Nobody answers on the line, or in another version.
    pub fn open(line: L) -> Result<Self> {
        let mut client = Self {
            line,
            session: Session::new(),
            reply: None,
            posted: VecDeque::new(),
            answers: VecDeque::new(),
            events: VecDeque::new(),
            telemetry: VecDeque::new(),
        };
        client.hello(PATIENCE, TRIES)?;
        Ok(client)
    }

    /// Opens a session.
    fn hello(&mut self, patience: Duration, tries: u32) -> Result<()> {
        // Ends what stood in the line.
        self.put(&[0])?;
        let reply = self.ask_for(Command::Hello, patience, tries);
        if self.session.count().versions > 0 {
            bail!(Lost(format!(
                "the drive speaks another version of the link than this program ({}): flash the firmware that it was \
                 built with",
                crate::LAYOUT
            )));
        }
        match reply? {
            Reply::Hello { .. } => Ok(()),
            other => bail!(unexpected(&other)),
        }
    }

    /// The drive is a simulated one.
    #[must_use]
    pub fn simulated(&self) -> bool {
        self.session.simulated()
    }

    /// PWM periods a second.
    #[must_use]
    pub fn pwm_hz(&self) -> f64 {
        self.session.pwm_hz()
    }

    /// Steps of its speed task a second.
    #[must_use]
    pub fn speed_hz(&self) -> f64 {
        self.session.speed_hz()
    }

    /// Lets the drive be moved. A drive in [`State::Unaligned`] is aligned: both motors move, and heartbeats go out until that ends.
    /// `go_on` sees each status; `false` interrupts the alignment. Gives the state that the drive is left in: a fault or
    /// [`State::Unaligned`] where it is not aligned.
    ///
    /// # Errors
    /// The drive refuses, is lost, or does not end its alignment in time.
    pub fn arm(&mut self, mut go_on: impl FnMut(&Status) -> bool) -> Result<State> {
        let before = self.status()?;
        let state = |status: &Status| State::of_words(status.state, status.fault);
        self.tell(Command::Arm)?;
        match state(&before) {
            Some(State::Unaligned) => {}
            Some(other) => return Ok(other),
            None => bail!("the drive is in a state that this program does not know"),
        }
        let mut began = false;
        loop {
            self.beat()?;
            let status = self.status()?;
            match state(&status) {
                Some(state @ (State::Ready | State::Fault(_))) => return Ok(state),
                Some(State::Unaligned) if began => return Ok(State::Unaligned),
                Some(State::Aligning) => began = true,
                _ => {}
            }
            if status.uptime_ms.wrapping_sub(before.uptime_ms) > ALIGNS_MS {
                bail!("the drive has not aligned its motors in {ALIGNS_MS} ms");
            }
            if !go_on(&status) {
                self.tell(Command::Stop)?;
            }
            self.listen(BEAT)?;
        }
    }

    /// Asks, and waits for the answer. What may be asked twice is asked again where no answer comes.
    ///
    /// # Errors
    /// [`Lost`] if none comes.
    pub fn ask(&mut self, command: Command) -> Result<Reply> {
        // A second move would move twice; a second burst is refused while the first waits.
        let once = matches!(
            command,
            Command::Move { .. }
                | Command::MoveTo { .. }
                | Command::SetPoint { .. }
                | Command::Inject(_)
                | Command::Burst(_)
        );
        let tries = if once { 1 } else { TRIES };
        self.ask_for(command, PATIENCE, tries)
    }

    fn ask_for(&mut self, command: Command, patience: Duration, tries: u32) -> Result<Reply> {
        for _ in 0..tries {
            self.reply = None;
            self.say(command)?;
            let until = self.line.now() + patience;
            loop {
                if let Some(reply) = self.reply.take() {
                    return Ok(reply);
                }
                let left = until.saturating_duration_since(self.line.now());
                // A simulated clock stands still while a host waits for no time at all.
                if left.is_zero() {
                    break;
                }
                self.listen(left)?;
            }
        }
        bail!(Lost(
            "the drive does not answer: is it there, has it power, and is nothing else on the line?".to_owned()
        ))
    }

    /// The line's clock.
    pub fn now(&self) -> Instant {
        self.line.now()
    }

    /// Says that the host is still there, and waits for no answer: telemetry may stand before it.
    ///
    /// # Errors
    /// [`Lost`] if the line is gone.
    pub fn beat(&mut self) -> Result<()> {
        self.say(Command::Heartbeat)
    }

    /// Asks, and does not wait for the answer, which [`take_answer`](Self::take_answer) gives with the same number.
    ///
    /// # Errors
    /// [`Lost`] if the line is gone.
    pub fn post(&mut self, command: Command) -> Result<u32> {
        self.say(command)?;
        let sequence = self.session.sequence();
        self.posted.push_back(sequence);
        Ok(sequence)
    }

    /// The next answer to what was posted, with its number.
    pub fn take_answer(&mut self) -> Option<(u32, Reply)> {
        self.answers.pop_front()
    }

    fn say(&mut self, command: Command) -> Result<()> {
        let bytes = self.session.request(command)?;
        self.put(&bytes)
    }

    /// Asks for what is answered by its being done.
    ///
    /// # Errors
    /// [`Refused`] or [`Lost`].
    pub fn tell(&mut self, command: Command) -> Result<()> {
        match self.ask(command)? {
            Reply::Done => Ok(()),
            other => bail!(unexpected(&other)),
        }
    }

    /// What the drive is doing.
    ///
    /// # Errors
    /// [`Lost`].
    pub fn status(&mut self) -> Result<Status> {
        match self.ask(Command::Status)? {
            Reply::Status(status) => Ok(status),
            other => bail!(unexpected(&other)),
        }
    }

    /// The last faults, the latest first.
    ///
    /// # Errors
    /// [`Lost`].
    pub fn faults(&mut self) -> Result<Vec<Event>> {
        match self.ask(Command::Faults)? {
            Reply::Faults(faults) => Ok(faults.into_iter().collect()),
            other => bail!(unexpected(&other)),
        }
    }

    /// The journal, the latest event first.
    ///
    /// # Errors
    /// [`Lost`].
    pub fn journal(&mut self) -> Result<Vec<Recorded>> {
        let mut all = Vec::new();
        loop {
            let after = u8::try_from(all.len()).unwrap_or(u8::MAX);
            match self.ask(Command::Journal { after })? {
                Reply::Events(events) if events.is_empty() || after == u8::MAX => return Ok(all),
                Reply::Events(events) => all.extend(events),
                other => bail!(unexpected(&other)),
            }
        }
    }

    /// How its burst is going.
    ///
    /// # Errors
    /// [`Lost`].
    pub fn burst(&mut self) -> Result<BurstStatus> {
        match self.ask(Command::BurstStatus)? {
            Reply::Burst(status) => Ok(status),
            other => bail!(unexpected(&other)),
        }
    }

    /// A complete burst, of a drive with these settings.
    ///
    /// # Errors
    /// [`Refused`] if it is not complete, or [`Lost`].
    pub fn read_burst(&mut self, settings: &Settings) -> Result<Burst> {
        let status = self.burst()?;
        let mut samples = Vec::with_capacity(SAMPLES);
        while samples.len() < SAMPLES {
            let from = u16::try_from(samples.len())?;
            match self.ask(Command::BurstSamples { from })? {
                Reply::BurstSamples(some) if some.is_empty() => break,
                Reply::BurstSamples(some) => samples.extend(some),
                other => bail!(unexpected(&other)),
            }
        }
        if self.burst()? != status {
            bail!(
                "another burst was armed while this one was read: read again once that is complete"
            );
        }
        let motor = [&settings.screw, &settings.nut][usize::from(status.request.motor != 0)];
        let counts = motor.encoder.counts_per_turn;
        Ok(Burst::of(&status, &samples, self.pwm_hz(), counts))
    }

    /// The settings that hold.
    ///
    /// # Errors
    /// [`Lost`], or the drive has other settings than this program.
    pub fn settings(&mut self) -> Result<Settings> {
        self.all_settings(|from| Command::Settings { from })
    }

    /// The same with the orders that the drive has learned.
    ///
    /// # Errors
    /// [`Lost`], or the drive has other settings than this program.
    pub fn learned(&mut self) -> Result<Settings> {
        self.all_settings(|from| Command::Learned { from })
    }

    fn all_settings(&mut self, command: impl Fn(u16) -> Command) -> Result<Settings> {
        let mut settings = Settings::DEFAULT;
        let (mut from, mut count) = (0, 0);
        loop {
            let some = match self.ask(command(from))? {
                Reply::Settings(some) => some,
                other => bail!(unexpected(&other)),
            };
            let Some((last, _)) = some.last() else { break };
            (from, count) = (last.saturating_add(1), count + some.len());
            for (id, value) in &some {
                settings
                    .set(*id, (*value).into())
                    .context("the drive has a setting that this program does not allow")?;
            }
        }
        let known = Settings::all().count();
        if count != known {
            bail!(
                "the drive has {count} settings, and this program {known}: they are of different versions"
            );
        }
        Ok(settings)
    }

    /// Makes `settings` hold and stores them, all of them or none.
    ///
    /// # Errors
    /// As [`change`](Self::change) and [`store`](Self::store).
    pub fn configure(&mut self, settings: &Settings) -> Result<()> {
        if self.change(settings)? == Effect::Restart {
            return Ok(());
        }
        self.store()
    }

    /// Stores the settings that hold.
    ///
    /// # Errors
    /// [`Refused`] while the drive moves or if its flash does not take them, or [`Lost`].
    pub fn store(&mut self) -> Result<()> {
        self.tell(Command::Store)
    }

    /// Makes `settings` hold, all of them or none, and says when they do. If one takes effect after a restart only, they are stored and
    /// the drive restarts. A new session then replaces this one.
    ///
    /// # Errors
    /// [`Refused`] with the setting that does not fit, or [`Lost`].
    pub fn change(&mut self, settings: &Settings) -> Result<Effect> {
        self.tell(Command::Discard)?;
        let held = self.settings()?;
        for (setting, _, value) in held.differences(settings) {
            self.tell(Command::Draft {
                id: setting.id,
                value: value.into(),
            })
            .with_context(|| format!("{setting} was not taken"))?;
        }
        match self.tell(Command::Commit) {
            // Its answer was lost, and it was asked again after its restart.
            Err(error) if error.downcast_ref() == Some(&Refused::For(Refusal::Session)) => {}
            told => told.map_err(|error| advised(error, &held, settings))?,
        }
        let effect = held.effect(settings);
        if effect != Effect::Restart {
            return Ok(effect);
        }
        // What is said while it starts is lost.
        self.hello(STARTS / 50, 50)
            .context("the drive does not come back after it was given settings")?;
        if self.settings()? != *settings {
            bail!(
                "the drive has started anew, and does not run on the settings that it was given: `status` says on which"
            );
        }
        Ok(effect)
    }

    /// Takes what has come, waiting for it no longer than `patience`.
    ///
    /// # Errors
    /// [`Lost`].
    pub fn listen(&mut self, patience: Duration) -> Result<()> {
        let mut bytes = [0; 4096];
        let count = self
            .line
            .receive(&mut bytes, patience)
            .map_err(|error| Lost(format!("the line to the drive is gone: {error}")))?;
        for &byte in &bytes[..count] {
            match self.session.take(byte) {
                Some(DriveFrame::Reply(sequence, reply)) if self.was_posted(sequence) => {
                    self.answers.push_back((sequence, reply));
                }
                // Nobody waits for an earlier one's any more.
                Some(DriveFrame::Reply(sequence, reply)) if sequence == self.session.sequence() => {
                    self.reply = Some(reply);
                }
                Some(DriveFrame::Reply(..)) => {}
                Some(DriveFrame::Event(event)) => self.events.push_back(event),
                Some(DriveFrame::Telemetry(frame)) => self.telemetry.push_back(frame),
                None => {}
            }
        }
        Ok(())
    }

    /// This is the answer to what was posted. Those before it have none: they were lost on the way.
    fn was_posted(&mut self, sequence: u32) -> bool {
        let place = self.posted.iter().position(|posted| *posted == sequence);
        if let Some(place) = place {
            self.posted.drain(..=place);
        }
        place.is_some()
    }

    /// The next change of state that has come.
    pub fn take_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// The next telemetry that has come.
    pub fn take_telemetry(&mut self) -> Option<Frame> {
        self.telemetry.pop_front()
    }

    fn put(&mut self, bytes: &[u8]) -> Result<()> {
        self.line
            .send(bytes)
            .map_err(|error| Lost(format!("the line to the drive is gone: {error}")).into())
    }
}

/// What does not fit the drive's numbers, and by how much.
fn misfit(name: &str, unit: &str, is: f64, [least, below]: [f64; 2]) -> String {
    // A unit of the format's own: only the ratio says something.
    if unit.starts_with("2^-n") {
        return if is > below {
            format!(
                "{name} would be {:.3} times too large for the drive's number format",
                is / below
            )
        } else {
            format!(
                "{name} would be too small for the drive's number format, by a factor of {:.3}",
                least / is
            )
        };
    }
    // Only one end is a limit where the other is the largest number there is.
    let possible = if below == f64::MAX {
        format!("at least {least} {unit} is needed")
    } else if least == f64::MIN {
        format!("at most {below} {unit} is possible")
    } else {
        format!("{least} to {below} {unit} are possible")
    };
    format!("{name} would be {is} {unit}, but {possible}")
}

/// Where a setting does not fit: that it does with the value that it has.
fn advised(error: anyhow::Error, held: &Settings, asked: &Settings) -> anyhow::Error {
    let Some(Refused::Unfit(sentence)) = error.downcast_ref() else {
        return error;
    };
    let unfit = held
        .differences(asked)
        .find(|(setting, ..)| sentence.starts_with(&format!("{setting} = ")));
    let Some((setting, now, _)) = unfit else {
        return error;
    };
    let (now, unit) = (now.shown(setting), setting.unit());
    let space = if unit.is_empty() { "" } else { " " };
    let advice =
        format!("{sentence}. It fits with {now}{space}{unit}: choose a value nearer to that");
    Refused::Unfit(advice).into()
}

/// Why the drive did not do what was asked, by its answer: [`Refused`], or that the answer is not the expected one.
#[must_use]
pub fn unexpected(reply: &Reply) -> anyhow::Error {
    match reply {
        Reply::Refused(word) => match Refusal::of_word(*word) {
            Some(refusal) => Refused::For(refusal).into(),
            None => {
                anyhow::anyhow!("the drive refuses, for a reason that this program does not know")
            }
        },
        Reply::Unfit {
            id,
            value,
            name,
            unit,
            is,
            least,
            below,
        } => {
            let setting = Setting::numbered(*id);
            let begin = match (setting, value) {
                (Some(setting), Some(value)) => {
                    format!(
                        "{setting} = {} does not fit: ",
                        Value::from(*value).shown(setting)
                    )
                }
                _ => "the settings do not fit: ".to_owned(),
            };
            Refused::Unfit(format!(
                "{begin}{}",
                misfit(name, unit, is.get(), [least.get(), below.get()])
            ))
            .into()
        }
        _ => anyhow::anyhow!("the drive answers something else than was asked"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_on_one_side_is_said_as_one() {
        for (limits, expected) in [
            ([0.0, f64::MAX], "at least 0 V/A is needed"),
            ([f64::MIN, 3.0], "at most 3 V/A is possible"),
            ([0.0, 3.0], "0 to 3 V/A are possible"),
        ] {
            let said = misfit("gain", "V/A", -1.0, limits);
            assert_eq!(said, format!("gain would be -1 V/A, but {expected}"));
        }
    }

    /// A line with nobody at its other end. Its clock passes by what a host waits.
    struct Silence {
        now: Instant,
    }

    impl Line for Silence {
        fn send(&mut self, _: &[u8]) -> io::Result<()> {
            Ok(())
        }

        fn receive(&mut self, _: &mut [u8], patience: Duration) -> io::Result<usize> {
            assert!(!patience.is_zero(), "time stands still");
            self.now += patience;
            Ok(0)
        }

        fn now(&self) -> Instant {
            self.now
        }
    }

    #[test]
    fn a_drive_that_says_nothing_is_given_up() {
        let line = Silence {
            now: Instant::now(),
        };
        let error = Client::open(line).map(|_| ()).unwrap_err();
        assert!(error.is::<Lost>(), "{error:#}");
    }
}
