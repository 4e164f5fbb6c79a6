//! A host's session with a drive over a line of bytes.

use crate::burst::BurstStatus;
use crate::codes::State;
use crate::host::burst::Burst;
use crate::host::dialogue::{Dialogue, PATIENCE, TRIES};
use crate::host::refused::{Lost, unexpected};
use crate::host::session::Session;
use crate::message::{Command, DriveFrame, Event, Recorded, Reply, Status};
use crate::settings::{Effect, Settings};
use crate::telemetry::Frame;
use anyhow::{Result, bail};
use pollster::block_on;
use std::collections::VecDeque;
use std::io;
use std::time::{Duration, Instant};

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

/// A session over a line that is waited for.
#[derive(Debug)]
pub struct Client<L> {
    line: L,
    /// When the session was opened, by the line's clock.
    opened: Instant,
    stream: u32,
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
            opened: line.now(),
            line,
            stream: 0,
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
        bail!(Lost::silent())
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

    /// See [`Dialogue::ask`].
    ///
    /// # Errors
    /// As [`Dialogue::ask`].
    pub fn ask(&mut self, command: Command) -> Result<Reply> {
        block_on(Dialogue::ask(self, command))
    }

    /// See [`Dialogue::tell`].
    ///
    /// # Errors
    /// As [`Dialogue::tell`].
    pub fn tell(&mut self, command: Command) -> Result<()> {
        block_on(Dialogue::tell(self, command))
    }

    /// See [`Dialogue::status`].
    ///
    /// # Errors
    /// As [`Dialogue::status`].
    pub fn status(&mut self) -> Result<Status> {
        block_on(Dialogue::status(self))
    }

    /// See [`Dialogue::arm`].
    ///
    /// # Errors
    /// As [`Dialogue::arm`].
    pub fn arm(&mut self, go_on: impl FnMut(&Status) -> bool) -> Result<State> {
        block_on(Dialogue::arm(self, go_on))
    }

    /// See [`Dialogue::burst`].
    ///
    /// # Errors
    /// As [`Dialogue::burst`].
    pub fn burst(&mut self) -> Result<BurstStatus> {
        block_on(Dialogue::burst(self))
    }

    /// See [`Dialogue::read_burst`].
    ///
    /// # Errors
    /// As [`Dialogue::read_burst`].
    pub fn read_burst(&mut self, settings: &Settings) -> Result<Burst> {
        block_on(Dialogue::read_burst(self, settings))
    }

    /// See [`Dialogue::settings`].
    ///
    /// # Errors
    /// As [`Dialogue::settings`].
    pub fn settings(&mut self) -> Result<Settings> {
        block_on(Dialogue::settings(self))
    }

    /// See [`Dialogue::learned`].
    ///
    /// # Errors
    /// As [`Dialogue::learned`].
    pub fn learned(&mut self) -> Result<Settings> {
        block_on(Dialogue::learned(self))
    }

    /// See [`Dialogue::change`].
    ///
    /// # Errors
    /// As [`Dialogue::change`].
    pub fn change(&mut self, settings: &Settings) -> Result<Effect> {
        block_on(Dialogue::change(self, settings))
    }

    /// See [`Dialogue::store`].
    ///
    /// # Errors
    /// As [`Dialogue::store`].
    pub fn store(&mut self) -> Result<()> {
        block_on(Dialogue::store(self))
    }

    /// See [`Dialogue::configure`].
    ///
    /// # Errors
    /// As [`Dialogue::configure`].
    pub fn configure(&mut self, settings: &Settings) -> Result<()> {
        block_on(Dialogue::configure(self, settings))
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

/// No future of it waits: each call blocks until it is ready.
impl<L: Line> Dialogue for Client<L> {
    fn pwm_hz(&self) -> f64 {
        self.session.pwm_hz()
    }

    fn speed_hz(&self) -> f64 {
        self.session.speed_hz()
    }

    fn now(&self) -> Duration {
        self.line.now().duration_since(self.opened)
    }

    async fn hello(&mut self, patience: Duration, tries: u32) -> Result<()> {
        Self::hello(self, patience, tries)
    }

    async fn ask_for(&mut self, command: Command, patience: Duration, tries: u32) -> Result<Reply> {
        Self::ask_for(self, command, patience, tries)
    }

    async fn listen(&mut self, patience: Duration) -> Result<()> {
        Self::listen(self, patience)
    }

    fn beat(&mut self) -> Result<()> {
        Self::beat(self)
    }

    fn take_telemetry(&mut self) -> Option<Frame> {
        Self::take_telemetry(self)
    }

    fn next_stream(&mut self) -> u32 {
        self.stream += 1;
        self.stream
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
