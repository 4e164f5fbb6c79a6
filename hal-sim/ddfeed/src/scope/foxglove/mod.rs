//! `ddfeed scope --foxglove`: a drive's telemetry, settings and commands for Foxglove and programs that speak its protocol.
//!
//! One thread has the drive's session. What clients ask reaches it in a queue; a stop goes past the queue.

mod clients;
mod parameters;

use super::ScopeOptions;
use crate::drive::LineOptions;
use crate::drive::connect::{self, Drive};
use crate::drive::motion::BEAT;
use crate::interrupt::ctrl_c;
use crate::mcap_file::{TOPIC, message};
use crate::record::{EncoderFrame, sample};
use crate::session::divider;
use anyhow::{Context, Result, bail, ensure};
use clients::{Asked, Clients, Service};
use foxglove::websocket::{Capability, Status};
use foxglove::{
    ChannelBuilder, PartialMetadata, RawChannel, Schema, WebSocketServer, WebSocketServerHandle,
};
use link::codes::State;
use link::host::Decoder;
use link::host::refused::Lost;
use link::host::status::StatusReport;
use link::message::{Command, Travel};
use link::settings::Settings;
use link::telemetry::Request;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Rows a second.
const RATE_HZ: u32 = 1000;
/// How long the drive's bytes are waited for.
const WAIT: Duration = Duration::from_millis(2);
/// How often the drive is looked at.
const LOOK: Duration = Duration::from_millis(100);

/// Serves until Ctrl-C. The drive then comes to rest, if a client moves it.
///
/// # Errors
/// The address is not this computer's or in use, or the drive is not reached or lost.
pub fn run(options: &ScopeOptions, line: &LineOptions, listen: SocketAddr) -> Result<()> {
    ensure!(
        listen.ip().is_loopback(),
        "--foxglove is {}, but only addresses of this computer are possible, as 127.0.0.1:8765: the protocol has no token",
        listen
    );
    let stop = ctrl_c().context("Ctrl-C cannot be caught")?;
    let drive = connect::open(line, options.baud)?;
    let (clients, asked) = Clients::new();
    let services: &[Service] = if options.foxglove_commands {
        &[Service::Stop, Service::Arm, Service::Home]
    } else {
        &[Service::Stop]
    };
    let server = WebSocketServer::new()
        .name("ddfeed")
        .bind(listen.ip().to_string(), listen.port())
        .supported_encodings(["json"])
        .capabilities([Capability::Parameters, Capability::Services])
        .parameter_handler(clients.parameters())
        .listener(clients.listener())
        .services(services.iter().map(|service| clients.service(*service)))
        .start_blocking()
        .with_context(|| {
            format!(
                "{} cannot be listened at: is another program there? Give another with --foxglove",
                listen
            )
        })?;
    println!("ws://{}:{}", listen.ip(), server.port());
    eprintln!("open the connection in Foxglove; Ctrl-C ends it");
    if options.foxglove_commands {
        eprintln!(
            "clients may arm the drive: each page in a browser of this computer can connect, since the protocol does not tell who asks"
        );
    }
    let mut session = Session::new(drive, server, options.foxglove_commands)?;
    while !stop.load(Relaxed) {
        session.step(&clients, &asked)?;
    }
    session.end()
}

/// The thread's own.
struct Session {
    drive: Drive,
    server: WebSocketServerHandle,
    channel: Arc<RawChannel>,
    decoder: Decoder,
    /// As the session began: what the encoders' ages are does not change while it lasts.
    settings: Settings,
    /// How the encoders lie to the rotors: an alignment changes it.
    encoders: [EncoderFrame; 2],
    /// Time of the stream's first row since 1970, ns.
    start_ns: u64,
    /// Clients may command.
    commands: bool,
    /// A client has armed the drive or moves it.
    commanding: bool,
    /// It homes for a client.
    homing: bool,
    looked: Instant,
    beaten: Instant,
}

impl Session {
    fn new(mut drive: Drive, server: WebSocketServerHandle, commands: bool) -> Result<Self> {
        let schema = Schema::new(message::NAME, "ros2msg", message::definition().into_bytes());
        let channel = ChannelBuilder::new(TOPIC)
            .message_encoding("cdr")
            .schema(schema)
            .build_raw()?;
        let settings = drive.settings()?;
        let request = Request {
            divider: divider(RATE_HZ)?,
            stream: 1,
        };
        drive.tell(Command::Record(request.word()))?;
        let start = SystemTime::now().duration_since(UNIX_EPOCH)?;
        let now = drive.now();
        let mut session = Self {
            drive,
            server,
            channel,
            decoder: Decoder::new(request),
            settings,
            encoders: [EncoderFrame::default(); 2],
            start_ns: start.as_nanos() as u64,
            commands,
            commanding: false,
            homing: false,
            looked: now,
            beaten: now,
        };
        session.look()?;
        Ok(session)
    }

    /// Serves what was asked, and what came.
    fn step(&mut self, clients: &Clients, asked: &Receiver<Asked>) -> Result<()> {
        let (stop, leaving) = (clients.take_stop(), clients.take_leaving());
        if stop || leaving && self.commanding {
            self.rest()?;
        }
        if let Ok(asked) = asked.try_recv() {
            self.serve(asked, clients)?;
        }
        let now = self.drive.now();
        if self.homing && now - self.beaten > BEAT {
            self.beaten = now;
            self.drive.beat()?;
        }
        if now - self.looked > LOOK {
            self.look()?;
        }
        self.drive.listen(WAIT)?;
        self.publish()
    }

    fn serve(&mut self, asked: Asked, clients: &Clients) -> Result<()> {
        match asked {
            Asked::Get(names, responder) => {
                let settings = self.drive.settings()?;
                responder.respond(parameters::of(&settings, &names));
            }
            Asked::Set(parameters, responder) => {
                let names: Vec<String> = parameters.iter().map(|one| one.name.clone()).collect();
                if let Err(error) = self.set(&parameters) {
                    self.show(refusal(error)?);
                }
                let settings = self.drive.settings()?;
                let held = parameters::of(&settings, &names);
                self.server.publish_parameter_values(held.clone());
                responder.respond(held);
            }
            Asked::Service(service, responder) => {
                let served = match service {
                    Service::Arm => self.arm(clients),
                    Service::Home => self.home(),
                    Service::Stop => self.rest(),
                };
                match served {
                    Ok(sentence) => {
                        responder.respond_ok(serde_json::json!({ "done": sentence }).to_string())
                    }
                    Err(error) => responder.respond_err(refusal(error)?),
                }
            }
        }
        Ok(())
    }

    /// Sets what takes effect without a restart, and stores nothing.
    fn set(&mut self, parameters: &[foxglove::websocket::Parameter]) -> Result<()> {
        ensure!(
            self.commands,
            "nothing was set: `ddfeed scope --foxglove` runs without --foxglove-commands"
        );
        let held = self.drive.settings()?;
        let new = parameters::changed(&held, parameters)?;
        if let Some(setting) = held.changes_that_restart(&new).next() {
            bail!(
                "{setting} takes effect when the drive restarts: set it with `ddfeed drive settings set`, which says what is lost"
            );
        }
        self.drive.change(&new)?;
        Ok(())
    }

    /// Shows an error to all clients.
    fn show(&self, sentence: String) {
        self.server.publish_status(Status::error(sentence));
    }

    fn arm(&mut self, clients: &Clients) -> Result<&'static str> {
        let state = self.drive.arm(|_| !clients.stop_or_leaving())?;
        self.look()?;
        match state {
            State::Fault(fault) => bail!("{}: {}", fault.name(), fault.sentence()),
            State::Unaligned => bail!("the alignment was interrupted: the bridges are open"),
            _ => {
                self.commanding = true;
                Ok("armed")
            }
        }
    }

    fn home(&mut self) -> Result<&'static str> {
        self.drive.tell(Command::Home { base: None })?;
        (self.commanding, self.homing) = (true, true);
        Ok("homing: the drive rests at the end")
    }

    fn rest(&mut self) -> Result<&'static str> {
        (self.commanding, self.homing) = (false, false);
        self.drive.tell(Command::Stop)?;
        Ok("comes to rest")
    }

    /// How the encoders lie, and whether the drive has homed, or why not.
    fn look(&mut self) -> Result<()> {
        self.looked = self.drive.now();
        let status = self.drive.status()?;
        let aligned = status.motors.map(|motor| motor.alignment);
        self.encoders = EncoderFrame::both(aligned, &self.settings);
        let travel = StatusReport::of(status).travel();
        if self.homing && travel != Some(Travel::Homing) {
            self.rest()?;
            if let Some(travel) = travel.filter(|travel| *travel != Travel::Homed) {
                self.show(format!("not homed: {}", travel.sentence()));
            }
        }
        Ok(())
    }

    /// Sends the rows that came.
    fn publish(&mut self) -> Result<()> {
        while let Some(frame) = self.drive.take_telemetry() {
            let Some(row) = self.decoder.frame(frame) else {
                continue;
            };
            let Some(header) = self.decoder.header() else {
                continue;
            };
            let time_ns = self.start_ns + (row.time_s * 1e9).round() as u64;
            let sample = sample(header, &row, self.encoders);
            let bytes = message::encode(&sample, time_ns)?;
            let log_time = PartialMetadata::with_log_time(time_ns);
            self.channel.log_with_meta(&bytes, log_time);
        }
        Ok(())
    }

    /// Brings a drive that a client moves to rest, and ends the telemetry.
    fn end(mut self) -> Result<()> {
        if self.commanding {
            self.rest()?;
        }
        let none = Request {
            divider: 0,
            stream: 1,
        };
        self.drive.tell(Command::Record(none.word()))
    }
}

/// The sentence of an error after which the drive is still there.
///
/// # Errors
/// The drive is lost.
fn refusal(error: anyhow::Error) -> Result<String> {
    if error.is::<Lost>() {
        return Err(error);
    }
    Ok(format!("{error:#}"))
}
