//! Commissioning of the page's drive: the steps of `ddfeed drive commission`, polled between the page's own requests.

use anyhow::{Context, Result, bail, ensure};
use commission::Session;
use commission::electrical::MotorElectrical;
use commission::procedure::{Done, Machine, Options, Step, measured, run};
use link::host::dialogue::Dialogue;
use link::host::refused::Lost;
use link::message::{Command, Reply};
use link::telemetry::Frame;
use serde::Deserialize;
use serde_json::{Value, json};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::fmt;
use std::future::{Future, poll_fn};
use std::pin::Pin;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::task::{Context as Polled, Poll, Waker};
use std::time::Duration;

/// What the page asks for.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wanted {
    /// Furthest that the table may move to each side, mm.
    travel_mm: f64,
    /// Smallest phase margin, degrees.
    margin_deg: f64,
    /// Only the current loops are measured.
    response_only: bool,
}

impl Wanted {
    /// # Errors
    /// The JSON is no such request, or a value is out of its range.
    fn options(json: &str) -> Result<Options> {
        let wanted: Self =
            serde_json::from_str(json).with_context(|| format!("{json} is no request"))?;
        ensure!(
            wanted.travel_mm > 0.0 && wanted.travel_mm.is_finite(),
            "the travel is {} mm, but it must be above 0",
            wanted.travel_mm
        );
        ensure!(
            (1.0..=89.0).contains(&wanted.margin_deg),
            "the phase margin is {} degrees, but 1 to 89 are possible",
            wanted.margin_deg
        );
        Ok(Options {
            travel_m: 1e-3 * wanted.travel_mm,
            speed_rad_s: None,
            margin_deg: wanted.margin_deg,
            steps: if wanted.response_only {
                &[Step::Start, Step::Response]
            } else {
                &Step::ALL
            },
        })
    }
}

/// What the steps and the session of the page hand to each other.
#[derive(Debug, Default)]
struct Exchange {
    /// The page's clock.
    now: Duration,
    pwm_hz: f64,
    speed_hz: f64,
    /// Number of the last telemetry stream.
    stream: u32,
    /// The next request.
    request: Option<Command>,
    beat: bool,
    reply: Option<Reply>,
    telemetry: VecDeque<Frame>,
    /// Frames that came.
    frames: u64,
}

/// The steps' end.
struct PolledDialogue(Rc<RefCell<Exchange>>);

impl PolledDialogue {
    async fn until<T>(&self, mut found: impl FnMut(&mut Exchange) -> Option<T>) -> T {
        poll_fn(|_| found(&mut self.0.borrow_mut()).map_or(Poll::Pending, Poll::Ready)).await
    }
}

impl Dialogue for PolledDialogue {
    fn pwm_hz(&self) -> f64 {
        self.0.borrow().pwm_hz
    }

    fn speed_hz(&self) -> f64 {
        self.0.borrow().speed_hz
    }

    fn now(&self) -> Duration {
        self.0.borrow().now
    }

    async fn hello(&mut self, patience: Duration, tries: u32) -> Result<()> {
        match self.ask_for(Command::Hello, patience, tries).await? {
            Reply::Hello { .. } => Ok(()),
            _ => bail!(Lost::silent()),
        }
    }

    async fn ask_for(&mut self, command: Command, patience: Duration, tries: u32) -> Result<Reply> {
        for _ in 0..tries {
            let until = {
                let mut exchange = self.0.borrow_mut();
                (exchange.reply, exchange.request) = (None, Some(command));
                exchange.now + patience
            };
            let answer = self.until(|exchange| {
                let late = exchange.now >= until;
                let reply = exchange.reply.take();
                (reply.is_some() || late).then_some(reply)
            });
            if let Some(reply) = answer.await {
                return Ok(reply);
            }
        }
        bail!(Lost::silent())
    }

    async fn listen(&mut self, patience: Duration) -> Result<()> {
        let (frames, until) = {
            let exchange = self.0.borrow();
            (exchange.frames, exchange.now + patience)
        };
        self.until(|exchange| {
            (exchange.frames != frames || exchange.now >= until).then_some(Ok(()))
        })
        .await
    }

    fn beat(&mut self) -> Result<()> {
        self.0.borrow_mut().beat = true;
        Ok(())
    }

    fn take_telemetry(&mut self) -> Option<Frame> {
        self.0.borrow_mut().telemetry.pop_front()
    }

    fn next_stream(&mut self) -> u32 {
        let mut exchange = self.0.borrow_mut();
        exchange.stream = exchange.stream.wrapping_add(1) & 0xFF_FFFF;
        exchange.stream
    }
}

/// How far it is.
#[derive(Debug)]
struct Progress {
    step: Step,
    part: f64,
    done: Vec<Done>,
}

/// What the steps ask of the drive now.
#[derive(Debug, Default)]
pub struct Asked {
    /// A request, whose number the steps want to know: [`Commissioning::asked`].
    pub request: Option<Command>,
    /// A heartbeat.
    pub beat: bool,
}

/// What the session of the page tells the steps at each poll.
#[derive(Clone, Copy, Debug)]
pub struct Now {
    /// The page's clock, ms.
    pub ms: f64,
    /// PWM periods a second.
    pub pwm_hz: f64,
    /// Steps of the speed task a second.
    pub speed_hz: f64,
    /// Number of the last telemetry stream.
    pub stream: u32,
}

/// Steps that are under way.
struct Running {
    exchange: Rc<RefCell<Exchange>>,
    steps: Pin<Box<dyn Future<Output = Result<()>>>>,
    /// Number of the request that is under way.
    sequence: Option<u32>,
}

/// Steps that are under way or over.
pub struct Commissioning {
    progress: Rc<RefCell<Progress>>,
    /// `None`: over. What the steps were handed is gone with them.
    running: Option<Running>,
    error: Option<String>,
}

impl fmt::Debug for Commissioning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Commissioning")
            .field("progress", &self.progress)
            .field("error", &self.error)
            .finish_non_exhaustive()
    }
}

impl Commissioning {
    /// Begins with the first step. `json` is a [`Wanted`].
    ///
    /// # Errors
    /// A value is missing or out of its range.
    pub fn new(json: &str) -> Result<Self> {
        let options = Wanted::options(json)?;
        let exchange = Rc::new(RefCell::new(Exchange::default()));
        let progress = Rc::new(RefCell::new(Progress {
            step: Step::Start,
            part: 0.0,
            done: Vec::new(),
        }));
        let (line, seen) = (PolledDialogue(Rc::clone(&exchange)), Rc::clone(&progress));
        let steps = async move {
            // Whoever stops it drops this future: nothing of it reaches the drive afterwards.
            let never = Arc::new(AtomicBool::new(false));
            let mut session = Session::open(line, never).await?;
            let mut done = Vec::new();
            run(
                &mut session,
                &options,
                &mut done,
                &mut |step, part| {
                    let mut seen = seen.borrow_mut();
                    (seen.step, seen.part) = (step, part);
                },
                &mut |done| {
                    seen.borrow_mut().done = done.to_vec();
                    Ok(())
                },
            )
            .await
        };
        Ok(Self {
            progress,
            running: Some(Running {
                exchange,
                steps: Box::pin(steps),
                sequence: None,
            }),
            error: None,
        })
    }

    /// It is under way.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.running.is_some()
    }

    /// The drive has answered a request.
    pub fn reply(&mut self, sequence: u32, reply: &Reply) {
        let Some(running) = &mut self.running else {
            return;
        };
        let mut exchange = running.exchange.borrow_mut();
        exchange.frames += 1;
        if running.sequence == Some(sequence) {
            running.sequence = None;
            exchange.reply = Some(reply.clone());
        }
    }

    /// The drive has sent telemetry.
    pub fn telemetry(&mut self, frame: Frame) {
        if let Some(running) = &mut self.running {
            let mut exchange = running.exchange.borrow_mut();
            exchange.frames += 1;
            exchange.telemetry.push_back(frame);
        }
    }

    /// Goes on as far as the answers allow: what is asked next.
    pub fn poll(&mut self, now: Now) -> Asked {
        let Some(running) = &mut self.running else {
            return Asked::default();
        };
        {
            let mut exchange = running.exchange.borrow_mut();
            exchange.now = Duration::from_secs_f64(1e-3 * now.ms.max(0.0));
            (exchange.pwm_hz, exchange.speed_hz) = (now.pwm_hz, now.speed_hz);
            exchange.stream = now.stream;
        }
        let polled = running
            .steps
            .as_mut()
            .poll(&mut Polled::from_waker(Waker::noop()));
        let asked = {
            let mut exchange = running.exchange.borrow_mut();
            Asked {
                request: exchange.request.take(),
                beat: std::mem::take(&mut exchange.beat),
            }
        };
        if let Poll::Ready(result) = polled {
            self.error = result.err().map(|error| format!("{error:#}"));
            self.running = None;
        }
        asked
    }

    /// The last request has this number.
    pub fn asked(&mut self, sequence: u32) {
        if let Some(running) = &mut self.running {
            running.sequence = Some(sequence);
        }
    }

    /// Ends it at once: it sends nothing any more.
    pub fn stop(&mut self) {
        if self.running.take().is_some() {
            self.error = Some("It was stopped.".to_owned());
        }
    }

    /// The machine and its motors, once the steps that measure them are done.
    #[must_use]
    pub fn measured(&self) -> Option<(Machine, [MotorElectrical; 2])> {
        measured(&self.progress.borrow().done)
    }

    /// How far it is, and what was found, as JSON.
    #[must_use]
    pub fn json(&self) -> Value {
        let progress = self.progress.borrow();
        let steps = progress.done.iter().map(|done| {
            json!({
                "name": done.step.name(),
                "about": done.step.about(),
                "seconds": done.seconds,
                "quantities": done.quantities,
                "limits": done.limits,
                "responses": done.responses,
                "speed_responses": done.speed_responses,
            })
        });
        json!({
            "running": self.is_running(),
            "step": progress.step.name(),
            "about": progress.step.about(),
            "part": progress.part,
            "error": self.error,
            "done": steps.collect::<Vec<_>>(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use link::telemetry::Sample;

    /// A page stays open for hours after a commissioning, and telemetry goes on.
    #[test]
    fn one_that_is_over_keeps_no_telemetry() {
        let wanted = r#"{"travel_mm":10,"margin_deg":45,"response_only":true}"#;
        let mut commissioning = Commissioning::new(wanted).unwrap();
        let frame = Frame::Sample(Sample::default());
        commissioning.telemetry(frame);
        let exchange = Rc::clone(&commissioning.running.as_ref().unwrap().exchange);
        assert_eq!(exchange.borrow().telemetry.len(), 1);
        commissioning.stop();
        commissioning.telemetry(frame);
        assert_eq!(exchange.borrow().telemetry.len(), 1);
    }
}
