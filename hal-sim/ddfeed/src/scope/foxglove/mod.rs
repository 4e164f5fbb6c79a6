//! `ddfeed scope --foxglove`: a drive's telemetry, settings and commands for Foxglove and programs that speak its protocol.
//!
//! One thread has the drive's session. What clients ask reaches it in a queue; a stop goes past the queue.

mod clients;
mod parameters;

use crate::drive::LineOptions;
use crate::drive::connect::{self, Drive};
use crate::drive::motion::BEAT;
use crate::interrupt::ctrl_c;
use crate::mcap_file::{TOPIC, message};
use crate::record::{EncoderFrame, sample};
use anyhow::{Context, Result, bail, ensure};
use clients::{Asked, Clients, Service};
use foxglove::websocket::{Capability, Status};
use foxglove::{
    ChannelBuilder, PartialMetadata, RawChannel, Schema, WebSocketServer, WebSocketServerHandle,
};
use link::codes::State;
use link::host::Decoder;
use link::host::status::StatusReport;
use link::message::{Command, Travel};
use link::telemetry::Request;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Rows a second.
const RATE_HZ: f64 = 1000.0;
/// How long the drive's bytes are waited for.
const WAIT: Duration = Duration::from_millis(2);
/// How often a drive that homes is looked at.
const LOOK: Duration = Duration::from_millis(100);

/// Which drive, and for whom.
#[derive(Clone, Copy, Debug)]
pub struct Serving<'a> {
    /// The drive.
    pub line: &'a LineOptions,
    /// Bits a second of the serial port.
    pub baud: Option<u32>,
    /// Where clients connect.
    pub listen: SocketAddr,
    /// Clients may arm, home and set settings.
    pub commands: bool,
}

/// Serves until Ctrl-C. The drive then comes to rest, if a client moves it.
///
/// # Errors
/// The address is not this computer's or in use, or the drive is not reached or lost.
pub fn run(serving: &Serving) -> Result<()> {
    ensure!(
        serving.listen.ip().is_loopback(),
        "--foxglove is {}, but only addresses of this computer are possible, as 127.0.0.1:8765: the protocol has no token",
        serving.listen
    );
    let stop = ctrl_c().context("Ctrl-C cannot be caught")?;
    let drive = connect::open(serving.line, serving.baud)?;
    let clients = Clients::new();
    let services: &[Service] = if serving.commands {
        &[Service::Stop, Service::Arm, Service::Home]
    } else {
        &[Service::Stop]
    };
    let server = WebSocketServer::new()
        .name("ddfeed")
        .bind(serving.listen.ip().to_string(), serving.listen.port())
        .supported_encodings(["json"])
        .capabilities([Capability::Parameters, Capability::Services])
        .parameter_handler(clients.parameters())
        .listener(clients.listener())
        .services(services.iter().map(|service| clients.service(*service)))
        .start_blocking()
        .with_context(|| {
            format!(
                "{} cannot be listened at: is another program there? Give another with --foxglove",
                serving.listen
            )
        })?;
    println!("ws://{}:{}", serving.listen.ip(), server.port());
    eprintln!("open the connection in Foxglove; Ctrl-C ends it");
    if serving.commands {
        eprintln!(
            "clients may arm the drive: each page in a browser of this computer can connect, since the protocol does not tell who asks"
        );
    }
    let mut session = Session::new(drive, server, serving.commands)?;
    while !stop.load(Relaxed) {
        session.step(&clients)?;
    }
    session.end()
}

/// The thread's own.
struct Session {
    drive: Drive,
    server: WebSocketServerHandle,
    channel: Arc<RawChannel>,
    decoder: Decoder,
    encoders: [EncoderFrame; 2],
    /// Time of the stream's first row since 1970, ns.
    start_ns: u64,
    /// Clients may command.
    commands: bool,
    /// When the drive that homes for a client was last looked at; `None`: it does not.
    homing: Option<Instant>,
    beaten: Instant,
}

impl Session {
    fn new(mut drive: Drive, server: WebSocketServerHandle, commands: bool) -> Result<Self> {
        let schema = Schema::new(message::NAME, "ros2msg", message::definition().into_bytes());
        let channel = ChannelBuilder::new(TOPIC)
            .message_encoding("cdr")
            .schema(schema)
            .build_raw()?;
        let aligned = drive.status()?.motors.map(|motor| motor.alignment);
        let encoders = EncoderFrame::both(aligned, &drive.settings()?);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let request = Request {
            divider: (drive.speed_hz() / RATE_HZ).round().clamp(1.0, 255.0) as u8,
            stream: 1,
        };
        drive.tell(Command::Record(request.word()))?;
        let start = SystemTime::now().duration_since(UNIX_EPOCH)?;
        let beaten = drive.now();
        Ok(Self {
            drive,
            server,
            channel,
            decoder: Decoder::new(request),
            encoders,
            start_ns: start.as_nanos() as u64,
            commands,
            homing: None,
            beaten,
        })
    }

    /// Serves what was asked, and what came.
    fn step(&mut self, clients: &Clients) -> Result<()> {
        if clients.take_stop() {
            self.rest()?;
        }
        if let Some(asked) = clients.next() {
            self.serve(asked, clients)?;
        }
        if self.homing.is_some() {
            self.attend()?;
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
                    self.report(&error)?;
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
                    Err(error) => {
                        responder.respond_err(format!("{error:#}"));
                        refused_only(error)?;
                    }
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

    /// Shows an error to all clients; one that is no refusal ends the session.
    fn report(&self, error: &anyhow::Error) -> Result<()> {
        self.server
            .publish_status(Status::error(format!("{error:#}")));
        if error.is::<link::host::client::Lost>() {
            bail!("{error:#}");
        }
        Ok(())
    }

    fn arm(&mut self, clients: &Clients) -> Result<&'static str> {
        match self.drive.arm(|_| !clients.stop_is_asked())? {
            State::Fault(fault) => bail!("{}: {}", fault.name(), fault.sentence()),
            State::Unaligned => bail!("the alignment was interrupted: the bridges are open"),
            _ => Ok("armed"),
        }
    }

    fn rest(&mut self) -> Result<&'static str> {
        self.homing = None;
        self.drive.tell(Command::Stop)?;
        Ok("comes to rest")
    }

    fn home(&mut self) -> Result<&'static str> {
        self.drive.tell(Command::Home { base: None })?;
        self.homing = Some(self.drive.now());
        Ok("homing: the status `travel` tells its end")
    }

    /// Heartbeats for a drive that homes, and its rest at the end.
    fn attend(&mut self) -> Result<()> {
        let now = self.drive.now();
        if now - self.beaten > BEAT {
            self.beaten = now;
            self.drive.beat()?;
        }
        if self.homing.is_some_and(|looked| now - looked > LOOK) {
            self.homing = Some(now);
            let seen = StatusReport::of(self.drive.status()?);
            if seen.travel() != Some(Travel::Homing) {
                self.rest()?;
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

    /// Brings a drive that homes to rest, and ends the telemetry.
    fn end(mut self) -> Result<()> {
        if self.homing.is_some() {
            self.rest()?;
        }
        let none = Request {
            divider: 0,
            stream: 1,
        };
        self.drive.tell(Command::Record(none.word()))
    }
}

/// A drive that refuses is still there.
fn refused_only(error: anyhow::Error) -> Result<()> {
    if error.is::<link::host::client::Lost>() {
        return Err(error);
    }
    Ok(())
}
