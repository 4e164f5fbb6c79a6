//! A client of the link: requests as JSON to bytes, bytes to messages as JSON and rows.

use crate::burst::ReadBurst;
use crate::commissioning::{Commissioning, Now};
use crate::identification::{ROW, compensation, numbers};
use crate::request::Request;
use crate::signals::{COLUMNS, Columns};
use anyhow::{Context, Result};
use ddfeed::record::{EncoderFrame, measured_model_file, model_file, sample};
use link::codes::{Fault, State};
use link::host::refused::unexpected;
use link::host::session::Session;
use link::host::status::{StatusReport, entry_json, event_json, fault_json};
use link::host::{Count, Decoder};
use link::message::{Aligned, Command, DriveFrame, Event, Refusal, Reply};
use link::settings::{Setting, Settings, Value as SettingValue, WireValue};
use link::telemetry::Frame;
use serde_json::{Value, json};

/// Rows that wait for the page: 10 s at 1 kHz. Older ones are dropped and counted.
const WAITING_ROWS: usize = 10_000;
/// Most values of a recording: two minutes at 5 kHz.
const LONGEST_RECORDING: usize = 600_000 * ROW;

/// A session with what it has received.
#[derive(Debug)]
pub struct Client {
    session: Session,
    settings: Settings,
    /// The settings of the next answer are those that hold.
    holding: bool,
    stream: u32,
    decoder: Option<Decoder>,
    columns: Columns,
    rows: Vec<f64>,
    dropped: u64,
    /// How the encoders lie to their rotors.
    aligned: [Aligned; 2],
    /// Its supply when it last told its status, V; 0: it has not.
    bus_v: f64,
    /// Rows of the recording that is made.
    recording: Option<Vec<f64>>,
    burst: ReadBurst,
    commissioning: Option<Commissioning>,
}

impl Default for Client {
    fn default() -> Self {
        Self::new()
    }
}

impl Client {
    /// No session yet.
    #[must_use]
    pub fn new() -> Self {
        Self {
            session: Session::new(),
            settings: Settings::DEFAULT,
            holding: false,
            stream: 0,
            decoder: None,
            columns: Columns::default(),
            rows: Vec::new(),
            dropped: 0,
            aligned: [Aligned::Unknown; 2],
            bus_v: 0.0,
            recording: None,
            burst: ReadBurst::default(),
            commissioning: None,
        }
    }

    /// Bytes of a request, which is JSON.
    ///
    /// # Errors
    /// There is no such request, or a value is out of its range.
    pub fn request(&mut self, json: &str) -> Result<Vec<u8>> {
        let command = Request::of_json(json)?.command(self.stream.wrapping_add(1) & 0xFF_FFFF)?;
        self.frame(command)
    }

    /// The bytes of a command. What its answers need is kept.
    fn frame(&mut self, command: Command) -> Result<Vec<u8>> {
        match command {
            Command::Record(word) => {
                let request = link::telemetry::Request::of_word(word);
                self.stream = request.stream;
                self.decoder = (request.divider > 0).then(|| Decoder::new(request));
                self.columns = Columns::default();
            }
            Command::BurstSamples { from } => self.burst.ask(from),
            Command::Settings { .. } => self.holding = true,
            Command::Learned { .. } => self.holding = false,
            _ => {}
        }
        self.session.request(command)
    }

    /// Number of the last request.
    #[must_use]
    pub fn sequence(&self) -> u32 {
        self.session.sequence()
    }

    /// Takes bytes of the drive: the messages in them.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<Value> {
        let mut messages = Vec::new();
        for &byte in bytes {
            match self.session.take(byte) {
                Some(DriveFrame::Reply(sequence, reply)) => {
                    if let Some(commissioning) = &mut self.commissioning {
                        commissioning.reply(sequence, &reply);
                    }
                    let mut message = self.reply(&reply);
                    message["sequence"] = sequence.into();
                    messages.push(json!({ "reply": message }));
                }
                Some(DriveFrame::Event(event)) => {
                    messages.push(json!({ "event": state_json(&event) }));
                }
                Some(DriveFrame::Telemetry(frame)) => messages.extend(self.telemetry(frame)),
                None => {}
            }
        }
        messages
    }

    fn telemetry(&mut self, frame: Frame) -> Option<Value> {
        if let Some(commissioning) = &mut self.commissioning {
            commissioning.telemetry(frame);
        }
        let decoder = self.decoder.as_mut()?;
        let begins = decoder.header().is_none();
        let row = decoder.frame(frame);
        let header = *decoder.header()?;
        let interval_s = decoder.interval_s()?;
        if let Some(row) = row {
            if let Some(recording) = &mut self.recording
                && recording.len() < LONGEST_RECORDING
            {
                recording.extend(numbers(&sample(
                    &header,
                    &row,
                    EncoderFrame::both(self.aligned, &self.settings),
                )));
            }
            if self.rows.len() >= WAITING_ROWS * COLUMNS {
                self.rows.drain(..COLUMNS);
                self.dropped += 1;
            }
            self.columns
                .append(&header, interval_s, &row, &mut self.rows);
        }
        begins.then(|| {
            json!({ "stream": {
                "interval_s": interval_s,
                "lead_mm": 1e3 * header.lead_m.get(),
                "scale_um": 1e6 * header.scale_count_m.get(),
                "pole_pairs": header.motors.map(|motor| motor.pole_pairs),
            }})
        })
    }

    fn reply(&mut self, reply: &Reply) -> Value {
        match reply {
            Reply::Done => json!({ "done": true }),
            Reply::Refused(word) => {
                let refusal = Refusal::of_word(*word);
                json!({ "refused": {
                    "name": refusal.map_or("unknown", Refusal::name),
                    "sentence": refusal.map_or(
                        "The drive refuses, for a reason that this page does not know.",
                        Refusal::sentence,
                    ),
                }})
            }
            Reply::Hello { .. } => json!({ "hello": {
                "simulated": self.session.simulated(),
                "pwm_hz": self.session.pwm_hz(),
                "speed_hz": self.session.speed_hz(),
            }}),
            Reply::Status(status) => {
                self.aligned = status.motors.map(|motor| motor.alignment);
                let report = StatusReport::of(*status);
                self.bus_v = report.bus_v();
                json!({ "status": report.json(&self.settings, self.session.simulated()) })
            }
            Reply::Faults(faults) => {
                json!({ "faults": faults.iter().map(entry_json).collect::<Vec<_>>() })
            }
            Reply::Events(events) => {
                json!({ "events": events.iter().map(event_json).collect::<Vec<_>>() })
            }
            Reply::Burst(status) => {
                json!({ "burst": self.burst.going(*status, self.session.pwm_hz()) })
            }
            Reply::BurstSamples(some) => json!({ "samples": self.burst.take(some) }),
            Reply::Settings(some) => json!({ "settings": self.settings_json(some) }),
            Reply::Followed { ahead_us, error_nm } => {
                json!({ "followed": { "ahead_us": ahead_us, "error_nm": error_nm } })
            }
            Reply::Unfit { .. } => json!({ "unfit": unexpected(reply).to_string() }),
        }
    }

    fn settings_json(&mut self, some: &[(u16, WireValue)]) -> Vec<Value> {
        some.iter()
            .filter_map(|&(id, value)| {
                let (setting, value) = (Setting::numbered(id)?, SettingValue::from(value));
                if self.holding {
                    // A value that this page does not allow is shown, and not kept.
                    let _ = self.settings.set(id, value);
                }
                Some(json!({
                    "id": id,
                    "name": setting.to_string(),
                    "value": value.shown(setting).to_string(),
                }))
            })
            .collect()
    }

    /// Takes the rows that came, [`COLUMNS`] values each.
    pub fn rows(&mut self) -> Vec<f64> {
        std::mem::take(&mut self.rows)
    }

    /// Rows of the burst that was read: see [`ReadBurst::rows`].
    #[must_use]
    pub fn burst_rows(&self) -> Vec<f64> {
        self.burst.rows(&self.settings, self.session.pwm_hz())
    }

    /// Begins to commission the drive. See [`Commissioning::new`].
    ///
    /// # Errors
    /// As [`Commissioning::new`].
    pub fn commission(&mut self, wanted: &str) -> Result<()> {
        self.commissioning = Some(Commissioning::new(wanted)?);
        Ok(())
    }

    /// Goes on with the commissioning at that time of the page's clock, ms: bytes for the drive.
    ///
    /// # Errors
    /// A command is longer than a frame.
    pub fn poll_commissioning(&mut self, ms: f64) -> Result<Vec<u8>> {
        let now = Now {
            ms,
            pwm_hz: self.session.pwm_hz(),
            speed_hz: self.session.speed_hz(),
            stream: self.stream,
        };
        let Some(commissioning) = &mut self.commissioning else {
            return Ok(Vec::new());
        };
        let asked = commissioning.poll(now);
        let mut bytes = Vec::new();
        if asked.beat {
            bytes.extend(self.frame(Command::Heartbeat)?);
        }
        if let Some(command) = asked.request {
            bytes.extend(self.frame(command)?);
            let sequence = self.sequence();
            if let Some(commissioning) = &mut self.commissioning {
                commissioning.asked(sequence);
            }
        }
        Ok(bytes)
    }

    /// A commissioning is under way.
    #[must_use]
    pub fn commissions(&self) -> bool {
        let commissioning = self.commissioning.as_ref();
        commissioning.is_some_and(Commissioning::is_running)
    }

    /// Ends the commissioning at once: it sends nothing any more.
    pub fn stop_commissioning(&mut self) {
        if let Some(commissioning) = &mut self.commissioning {
            commissioning.stop();
        }
    }

    /// See [`Commissioning::json`]; null where none was begun.
    #[must_use]
    pub fn commissioning(&self) -> Value {
        let commissioning = self.commissioning.as_ref();
        commissioning.map_or(Value::Null, Commissioning::json)
    }

    /// Begins a recording of the rows that come.
    pub fn begin_recording(&mut self) {
        self.recording = Some(Vec::new());
    }

    /// Ends the recording: its rows, [`ROW`] values each.
    pub fn take_recording(&mut self) -> Vec<f64> {
        self.recording.take().unwrap_or_default()
    }

    /// The model file that the drive declares of itself, once a stream has begun. Of a commissioning, it has what that measured.
    ///
    /// # Errors
    /// No stream has begun.
    pub fn declared(&self) -> Result<String> {
        let known = self.decoder.as_ref();
        let known = known.and_then(|decoder| Some((*decoder.header()?, decoder.interval_s()?)));
        let (header, interval_s) = known.context("There is no telemetry yet.")?;
        let measured = self
            .commissioning
            .as_ref()
            .and_then(Commissioning::measured);
        Ok(match measured {
            Some((machine, motors)) => {
                measured_model_file(&header, interval_s, &machine, &motors, self.bus_v)
            }
            None => model_file(&header, interval_s, self.bus_v),
        })
    }

    /// The settings that compensate what a model has. See [`compensation`].
    ///
    /// # Errors
    /// As [`compensation`].
    pub fn compensation(&self, model: &str) -> Result<Value> {
        compensation(model, &self.settings)
    }

    /// How the line and the telemetry went.
    #[must_use]
    pub fn counts(&self) -> Value {
        let frames = self.session.count();
        let Count {
            rows,
            lost,
            gaps,
            damaged,
        } = self
            .decoder
            .as_ref()
            .map_or_else(Count::default, Decoder::count);
        json!({
            "frames": frames.frames,
            "damaged": u64::from(frames.damaged) + damaged,
            "too_long": frames.too_long,
            "versions": frames.versions,
            "rows": rows,
            "lost": lost + self.dropped,
            "gaps": gaps,
        })
    }
}

/// A change of state.
fn state_json(event: &Event) -> Value {
    let state = State::of_words(event.state, event.fault);
    json!({
        "uptime_ms": event.uptime_ms,
        "state": state.map_or("unknown", State::name),
        "fault": Fault::of_word(event.fault).map(fault_json),
    })
}
