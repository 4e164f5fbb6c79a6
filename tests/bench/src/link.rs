//! `cargo xtask bench link`: the link to a drive that `serve` simulates, over each transport that this computer has.
//!
//! The drive is served by this very program, in a process of its own, as a person serves it. What a probe or a board's serial port
//! takes is not measured here.

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use ddfeed::drive::connect::{Drive, SentLine, by_serial, by_tcp};
use ddfeed::drive::motion::{BEAT, rest, run_at};
use link::codes::State;
use link::host::Decoder;
use link::host::client::{Client, Line};
use link::message::Command as Asked;
use link::telemetry::{FRAME_MAX, Request};
use serde::Serialize;
use std::cell::Cell;
use std::convert::Infallible;
use std::io::{self, BufRead, BufReader};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::rc::Rc;
use std::time::{Duration, Instant};

/// How many times as fast as real time the drive goes, and each how manieth step of its speed task makes a sample. In its own time
/// a drive sends no more samples than its speed task has steps: what is more comes of a faster drive.
const RATES: [(f64, &[u8]); 4] = [(1.0, &[5, 2, 1]), (2.0, &[1]), (4.0, &[1]), (10.0, &[1])];
/// Both motors turn so fast while samples come, rpm, so that their frames have the length of a running drive's; the table rests.
const TURNING_RPM: f64 = 300.0;
/// How long the drive waits for a command, ms of its time, which may be ten times as fast as that of this computer.
const HEARTBEAT_MS: f64 = 10_000.0;
/// How long a drive may take to be ready.
const READY: Duration = Duration::from_secs(20);

#[derive(Serialize)]
struct Report {
    round_trips: usize,
    duration_s: f64,
    transports: Vec<Transport>,
}

#[derive(Serialize)]
struct Transport {
    transport: &'static str,
    round_trip_median_ms: f64,
    round_trip_99_percent_ms: f64,
    round_trip_worst_ms: f64,
    rates: Vec<Rate>,
}

/// What came of a rate, by this computer's time.
#[derive(Serialize)]
struct Rate {
    drive_speed: f64,
    asked_samples_per_s: f64,
    samples_per_s: f64,
    samples: u64,
    lost: u64,
    damaged: u64,
    line_bytes_per_s: f64,
}

/// How many, how long, and how to say it.
#[derive(Args)]
pub struct LinkOptions {
    /// Status commands of each transport.
    #[arg(long, value_name = "N", default_value = "1000")]
    pub round_trips: std::num::NonZeroUsize,
    /// How long each rate of telemetry is taken, s.
    #[arg(long, value_name = "S", default_value_t = 5.0)]
    pub duration: f64,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// Measures and prints.
pub fn run(options: &LinkOptions) -> Result<()> {
    ensure!(
        (0.1..=600.0).contains(&options.duration),
        "--duration is {} s, but 0.1 to 600 s are possible",
        options.duration
    );
    let mut transports: Vec<Transport> = Vec::new();
    for (speed, dividers) in RATES {
        let served = Served::new(speed)?;
        for (k, (name, open)) in served.lines().into_iter().enumerate() {
            let mut line = Counted::open(open)?;
            if transports.len() == k {
                transports.push(round_trips(&mut line.drive, name, options)?);
            }
            for divider in dividers {
                let rate = stream(&mut line, speed, *divider, options.duration)
                    .with_context(|| format!("over the {name}"))?;
                transports[k].rates.push(rate);
            }
        }
    }
    let report = Report {
        round_trips: options.round_trips.get(),
        duration_s: options.duration,
        transports,
    };
    if options.json {
        println!("{}", serde_json::to_string(&report)?);
    } else {
        tell(&report);
    }
    Ok(())
}

fn tell(report: &Report) {
    for transport in &report.transports {
        println!(
            "{}: {} status commands, there and back: median {:.2} ms, 99 % within {:.2} ms, worst {:.2} ms",
            transport.transport,
            report.round_trips,
            transport.round_trip_median_ms,
            transport.round_trip_99_percent_ms,
            transport.round_trip_worst_ms
        );
        for rate in &transport.rates {
            println!(
                "{:>8.0} samples a second of a drive {} times as fast as real time: {:.0} came, {:.0} kB/s; {} lost and {} damaged of {}",
                rate.asked_samples_per_s,
                rate.drive_speed,
                rate.samples_per_s,
                1e-3 * rate.line_bytes_per_s,
                rate.lost,
                rate.damaged,
                rate.samples + rate.lost
            );
        }
    }
}

/// A served drive; it ends with the measurement.
struct Served {
    child: Child,
    address: String,
    terminal: Option<String>,
    /// It ends where nobody reads what it says.
    said: BufReader<ChildStdout>,
}

impl Served {
    fn new(speed: f64) -> Result<Self> {
        let program = std::env::current_exe().context("this program's own file is not known")?;
        let mut serve = Command::new(program);
        serve.args(["serve", "--listen", "127.0.0.1:0", "--speed"]);
        serve.arg(speed.to_string());
        if cfg!(unix) {
            serve.arg("--pty");
        }
        let mut child = serve.stdout(Stdio::piped()).spawn()?;
        let said = BufReader::new(child.stdout.take().context("`serve` has no output")?);
        let mut served = Self {
            child,
            address: String::new(),
            terminal: None,
            said,
        };
        served.address = served.word_after("--sim ")?;
        if cfg!(unix) {
            served.terminal = Some(served.word_after("--serial ")?);
        }
        Ok(served)
    }

    /// The word after `mark` in the next line that it prints.
    fn word_after(&mut self, mark: &str) -> Result<String> {
        let mut line = String::new();
        self.said.read_line(&mut line)?;
        let rest = line.split_once(mark).map(|(_, rest)| rest);
        let word = rest.and_then(|rest| rest.split_whitespace().next());
        Ok(word.context("`serve` did not start")?.to_owned())
    }

    fn lines(&self) -> Vec<(&'static str, Result<SentLine>)> {
        let mut lines = vec![("TCP", by_tcp(&self.address))];
        if let Some(terminal) = &self.terminal {
            // A pseudo-terminal takes any rate.
            lines.push(("pseudo-terminal", by_serial(terminal, link::SERIAL_BAUD)));
        }
        lines
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A session that counts the bytes that come.
struct Counted {
    drive: Drive,
    bytes: Rc<Cell<u64>>,
    streams: u32,
}

struct CountedLine {
    line: Box<dyn Line>,
    bytes: Rc<Cell<u64>>,
}

impl Line for CountedLine {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.line.send(bytes)
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        let count = self.line.receive(bytes, patience)?;
        self.bytes.set(self.bytes.get() + count as u64);
        Ok(count)
    }
}

impl Counted {
    /// Of a drive that is ready.
    fn open(line: Result<SentLine>) -> Result<Self> {
        let bytes = Rc::new(Cell::new(0));
        let line: Box<dyn Line> = Box::new(CountedLine {
            line: line?,
            bytes: Rc::clone(&bytes),
        });
        let mut drive = Client::open(line)?;
        ready(&mut drive)?;
        let mut settings = drive.settings()?;
        if settings.command.heartbeat_ms != HEARTBEAT_MS {
            settings.command.heartbeat_ms = HEARTBEAT_MS;
            drive.configure(&settings)?;
            ready(&mut drive)?;
        }
        Ok(Self {
            drive,
            bytes,
            streams: 0,
        })
    }
}

/// Waits until the drive is ready.
fn ready(drive: &mut Drive) -> Result<()> {
    let until = Instant::now() + READY;
    loop {
        let status = drive.status()?;
        match State::of_words(status.state, status.fault) {
            Some(State::Ready | State::Unaligned) => return Ok(()),
            state if Instant::now() > until => bail!("the drive is not ready: {state:?}"),
            _ => drive.listen(Duration::from_millis(10))?,
        }
    }
}

/// Asks a drive that rests for its status, one time after the other.
fn round_trips(drive: &mut Drive, name: &'static str, options: &LinkOptions) -> Result<Transport> {
    let mut times = Vec::new();
    for _ in 0..options.round_trips.get() {
        let asked = Instant::now();
        drive.status()?;
        times.push(1e3 * asked.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    let last = times.len() - 1;
    Ok(Transport {
        transport: name,
        round_trip_median_ms: times[last / 2],
        round_trip_99_percent_ms: times[last * 99 / 100],
        round_trip_worst_ms: times[last],
        rates: Vec::new(),
    })
}

/// Takes telemetry of a drive that turns, for so long by this computer's time.
fn stream(line: &mut Counted, drive_speed: f64, divider: u8, seconds: f64) -> Result<Rate> {
    let Counted {
        drive,
        bytes,
        streams,
    } = line;
    *streams += 1;
    let request = Request {
        divider,
        stream: *streams,
    };
    drive.arm(|_| true)?;
    drive.tell(run_at(
        0.0,
        Some(TURNING_RPM / 60.0 * std::f64::consts::TAU),
    )?)?;
    let mut decoder = Decoder::new(request);
    drive.tell(Asked::Record(request.word()))?;
    let (begun, before, mut beaten) = (Instant::now(), bytes.get(), Instant::now());
    let mut elapsed_s = 0.0;
    while elapsed_s < seconds {
        if beaten.elapsed() > BEAT {
            beaten = Instant::now();
            drive.beat()?;
        }
        drive.listen(Duration::from_millis(5))?;
        elapsed_s = begun.elapsed().as_secs_f64();
        let mut buffer = [0; FRAME_MAX];
        while let Some(frame) = drive.take_telemetry() {
            if let Some(frame) = frame.encode(&mut buffer) {
                let Ok(()) = decoder.take(frame, |_, _| Ok::<(), Infallible>(()));
            }
        }
    }
    let came = bytes.get() - before;
    let none = Request {
        divider: 0,
        ..request
    };
    drive.tell(Asked::Record(none.word()))?;
    // What is under way still belongs to no other rate.
    while drive.take_telemetry().is_some() {}
    rest(drive)?;
    let count = decoder.count();
    ensure!(count.rows > 0, "no sample came within {seconds} s");
    Ok(Rate {
        drive_speed,
        asked_samples_per_s: drive_speed * drive.speed_hz() / f64::from(divider),
        samples_per_s: count.rows as f64 / elapsed_s,
        samples: count.rows,
        lost: count.lost,
        damaged: count.damaged,
        line_bytes_per_s: came as f64 / elapsed_s,
    })
}
