//! Requests to a drive and their answers, whatever carries them.
//!
//! | who | how it waits |
//! | --- | --- |
//! | [`Client`](super::client::Client) | each call blocks its thread until the answer is there |
//! | the browser page | one thread polls, and does other work between |

use crate::burst::{BurstStatus, SAMPLES};
use crate::codes::State;
use crate::host::burst::Burst;
use crate::host::refused::{Refused, advised, unexpected};
use crate::message::{Command, Refusal, Reply, Status};
use crate::settings::{Effect, Settings};
use crate::telemetry::Frame;
use anyhow::{Context, Result, bail};
use std::time::Duration;

/// How long an answer may take.
pub const PATIENCE: Duration = Duration::from_secs(1);
/// How long a drive may take to start.
const STARTS: Duration = Duration::from_secs(5);
/// How often what may be asked again is asked.
pub const TRIES: u32 = 3;
/// Between two heartbeats of an alignment: far below the shortest time that a drive may be set to.
const BEAT: Duration = Duration::from_millis(20);
/// Longest that an alignment may take by the drive's clock, ms: its own limit and the self-test.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
const ALIGNS_MS: u32 = (control::alignment::LONGEST_S * 1e3) as u32 + 2000;

/// A host's dialogue with a drive.
#[allow(
    async_fn_in_trait,
    reason = "one thread polls a dialogue: its futures need not be Send"
)]
pub trait Dialogue {
    /// PWM periods a second.
    fn pwm_hz(&self) -> f64;

    /// Steps of its speed task a second.
    fn speed_hz(&self) -> f64;

    /// The clock that patience runs by, since any beginning.
    fn now(&self) -> Duration;

    /// Opens a session, in so many tries of that patience.
    ///
    /// # Errors
    /// [`Lost`](super::refused::Lost) if nobody answers.
    async fn hello(&mut self, patience: Duration, tries: u32) -> Result<()>;

    /// Asks in so many tries, and waits for the answer that long each.
    ///
    /// # Errors
    /// [`Lost`](super::refused::Lost) if none comes.
    async fn ask_for(&mut self, command: Command, patience: Duration, tries: u32) -> Result<Reply>;

    /// Takes what has come, waiting for it no longer than `patience`.
    ///
    /// # Errors
    /// [`Lost`](super::refused::Lost) if the line is gone.
    async fn listen(&mut self, patience: Duration) -> Result<()>;

    /// Says that the host is still there, and waits for no answer: telemetry may stand before it.
    ///
    /// # Errors
    /// [`Lost`](super::refused::Lost) if the line is gone.
    fn beat(&mut self) -> Result<()>;

    /// The next telemetry that has come.
    fn take_telemetry(&mut self) -> Option<Frame>;

    /// A number for a stream of telemetry that no stream before it had.
    fn next_stream(&mut self) -> u32;

    /// Lets the drive be moved. A drive in [`State::Unaligned`] is aligned: both motors move, and heartbeats go out until that ends.
    /// `go_on` sees each status; `false` interrupts the alignment. Gives the state that the drive is left in: a fault or
    /// [`State::Unaligned`] where it is not aligned.
    ///
    /// # Errors
    /// The drive refuses, is lost, or does not end its alignment in time.
    async fn arm(&mut self, mut go_on: impl FnMut(&Status) -> bool) -> Result<State> {
        let before = self.status().await?;
        let state = |status: &Status| State::of_words(status.state, status.fault);
        self.tell(Command::Arm).await?;
        match state(&before) {
            Some(State::Unaligned) => {}
            Some(other) => return Ok(other),
            None => bail!("the drive is in a state that this program does not know"),
        }
        let mut began = false;
        loop {
            self.beat()?;
            let status = self.status().await?;
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
                self.tell(Command::Stop).await?;
            }
            self.listen(BEAT).await?;
        }
    }

    /// Asks, and waits for the answer. What may be asked twice is asked again where no answer comes.
    ///
    /// # Errors
    /// [`Lost`](super::refused::Lost) if none comes.
    async fn ask(&mut self, command: Command) -> Result<Reply> {
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
        self.ask_for(command, PATIENCE, tries).await
    }

    /// Asks for what is answered by its being done.
    ///
    /// # Errors
    /// [`Refused`] or [`Lost`](super::refused::Lost).
    async fn tell(&mut self, command: Command) -> Result<()> {
        match self.ask(command).await? {
            Reply::Done => Ok(()),
            other => bail!(unexpected(&other)),
        }
    }

    /// What the drive is doing.
    ///
    /// # Errors
    /// [`Lost`](super::refused::Lost).
    async fn status(&mut self) -> Result<Status> {
        match self.ask(Command::Status).await? {
            Reply::Status(status) => Ok(status),
            other => bail!(unexpected(&other)),
        }
    }

    /// How its burst is going.
    ///
    /// # Errors
    /// [`Lost`](super::refused::Lost).
    async fn burst(&mut self) -> Result<BurstStatus> {
        match self.ask(Command::BurstStatus).await? {
            Reply::Burst(status) => Ok(status),
            other => bail!(unexpected(&other)),
        }
    }

    /// A complete burst, of a drive with these settings.
    ///
    /// # Errors
    /// [`Refused`] if it is not complete, or [`Lost`](super::refused::Lost).
    async fn read_burst(&mut self, settings: &Settings) -> Result<Burst> {
        let status = self.burst().await?;
        let mut samples = Vec::with_capacity(SAMPLES);
        while samples.len() < SAMPLES {
            let from = u16::try_from(samples.len())?;
            match self.ask(Command::BurstSamples { from }).await? {
                Reply::BurstSamples(some) if some.is_empty() => break,
                Reply::BurstSamples(some) => samples.extend(some),
                other => bail!(unexpected(&other)),
            }
        }
        if self.burst().await? != status {
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
    /// [`Lost`](super::refused::Lost), or the drive has other settings than this program.
    async fn settings(&mut self) -> Result<Settings> {
        read_settings(self, |from| Command::Settings { from }).await
    }

    /// The same with the orders that the drive has learned.
    ///
    /// # Errors
    /// [`Lost`](super::refused::Lost), or the drive has other settings than this program.
    async fn learned(&mut self) -> Result<Settings> {
        read_settings(self, |from| Command::Learned { from }).await
    }

    /// Makes `settings` hold and stores them, all of them or none.
    ///
    /// # Errors
    /// As [`change`](Self::change) and [`store`](Self::store).
    async fn configure(&mut self, settings: &Settings) -> Result<()> {
        if self.change(settings).await? == Effect::Restart {
            return Ok(());
        }
        self.store().await
    }

    /// Stores the settings that hold.
    ///
    /// # Errors
    /// [`Refused`] while the drive moves or if its flash does not take them, or [`Lost`](super::refused::Lost).
    async fn store(&mut self) -> Result<()> {
        self.tell(Command::Store).await
    }

    /// Makes `settings` hold, all of them or none, and says when they do. If one takes effect after a restart only, they are stored and
    /// the drive restarts. A new session then replaces this one.
    ///
    /// # Errors
    /// [`Refused`] with the setting that does not fit, or [`Lost`](super::refused::Lost).
    async fn change(&mut self, settings: &Settings) -> Result<Effect> {
        self.tell(Command::Discard).await?;
        let held = self.settings().await?;
        for (setting, _, value) in held.differences(settings) {
            self.tell(Command::Draft {
                id: setting.id,
                value: value.into(),
            })
            .await
            .with_context(|| format!("{setting} was not taken"))?;
        }
        match self.tell(Command::Commit).await {
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
            .await
            .context("the drive does not come back after it was given settings")?;
        if self.settings().await? != *settings {
            bail!(
                "the drive has started anew, and does not run on the settings that it was given: `status` says on which"
            );
        }
        Ok(effect)
    }
}

async fn read_settings<D: Dialogue + ?Sized>(
    drive: &mut D,
    command: impl Fn(u16) -> Command,
) -> Result<Settings> {
    let mut settings = Settings::DEFAULT;
    let (mut from, mut count) = (0, 0);
    loop {
        let some = match drive.ask(command(from)).await? {
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
