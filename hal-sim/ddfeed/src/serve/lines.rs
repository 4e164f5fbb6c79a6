//! The simulated drive's time and lines: one thread, a millisecond after the other.

use super::ServeOptions;
use super::machine::{MachineLine, differences};
use super::switched_on::SwitchedOn;
use crate::interrupt::ctrl_c;
use anyhow::{Context, Result, ensure};
use hal_sim::served::{LineId, Serving};
use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::Ordering::Relaxed;
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Time that the drive may lag behind before it is said, and no longer caught up with.
const LAG: Duration = Duration::from_millis(200);
/// Milliseconds of the drive's time between two looks at the lines.
const AT_ONCE: u32 = 5;

/// A line without waiting: a read or write that would wait gives `WouldBlock` or `TimedOut`.
trait Stream: Read + Write {}
impl<S: Read + Write> Stream for S {}

struct Open {
    id: LineId,
    stream: Box<dyn Stream>,
}

impl Open {
    /// Passes on what has come and what can go; `false` if the line is gone.
    fn pass(&mut self, serving: &mut Serving) -> bool {
        self.read(serving).is_ok() && self.write(serving).is_ok()
    }

    fn read(&mut self, serving: &mut Serving) -> io::Result<()> {
        let mut bytes = [0; 4096];
        let room = serving.room(self.id).min(bytes.len());
        if room == 0 {
            return Ok(());
        }
        match self.stream.read(&mut bytes[..room]) {
            Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
            Ok(count) => {
                serving.receive(self.id, &bytes[..count]);
                Ok(())
            }
            Err(error) => later(&error).then_some(()).ok_or(error),
        }
    }

    fn write(&mut self, serving: &mut Serving) -> io::Result<()> {
        let goes = serving.outgoing(self.id);
        if goes.is_empty() {
            return Ok(());
        }
        match self.stream.write(goes) {
            Ok(count) => {
                serving.sent(self.id, count);
                Ok(())
            }
            Err(error) => later(&error).then_some(()).ok_or(error),
        }
    }
}

fn later(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
    )
}

/// The drive and its lines.
struct Connected {
    serving: Serving,
    lines: Vec<Open>,
    listener: TcpListener,
}

impl Connected {
    fn open(&mut self, stream: impl Stream + 'static) {
        self.lines.push(Open {
            id: self.serving.open(),
            stream: Box::new(stream),
        });
    }

    /// Takes a line that is new, passes on what has come and what can go, and closes the lines that are gone.
    fn pass(&mut self) -> Result<()> {
        if let Some(stream) = accept(&self.listener)? {
            self.open(stream);
        }
        self.lines.retain_mut(|line| {
            let there = line.pass(&mut self.serving);
            if !there {
                self.serving.close(line.id);
            }
            there
        });
        Ok(())
    }

    fn millisecond(&mut self) {
        self.serving.millisecond();
        for line in &mut self.lines {
            // A line that is gone is found when it is read.
            let _ = line.write(&mut self.serving);
        }
    }
}

/// The drive's time beside this computer's.
struct Pace {
    /// The drive's seconds in one of this computer's.
    speed: f64,
    begun: Instant,
    /// The drive's time since then.
    passed: Duration,
    /// It has been said that the drive lags behind.
    lagged: bool,
}

impl Pace {
    fn new(speed: f64) -> Self {
        Self {
            speed,
            begun: Instant::now(),
            passed: Duration::ZERO,
            lagged: false,
        }
    }

    /// Simulates up to the present, a few milliseconds at most.
    fn follow(&mut self, connected: &mut Connected) {
        let due = self.begun.elapsed().mul_f64(self.speed);
        for _ in 0..AT_ONCE {
            // Time that is not real may wait for a host that is slow; in real time it loses samples, as with a board.
            if self.passed >= due || (self.speed > 1.0 && connected.serving.is_full()) {
                break;
            }
            connected.millisecond();
            self.passed += Duration::from_millis(1);
        }
        if due > self.passed + LAG {
            if !self.lagged {
                eprintln!(
                    "this computer does not simulate the drive {} times as fast as real time: it goes as fast as it can",
                    self.speed
                );
                self.lagged = true;
            }
            (self.begun, self.passed) = (Instant::now(), Duration::ZERO);
        } else if due < self.passed {
            sleep(Duration::from_micros(200));
        }
    }
}

/// Serves until Ctrl-C.
pub fn run(options: &ServeOptions) -> Result<()> {
    let speed = options.speed;
    ensure!(
        (0.01..=10.0).contains(&speed),
        "--speed is {speed}, but 0.01 to 10 times real time are possible: the drive's own half second for a heartbeat \
         goes as fast"
    );
    let SwitchedOn {
        setup,
        name,
        drive,
        mut flash,
    } = SwitchedOn::new(options)?;
    let listener = listen(&options.listen)?;
    for warning in drive.settings().warnings() {
        eprintln!("warning: {}", warning.sentence());
    }
    for difference in differences(&setup, drive.settings()) {
        eprintln!("warning: {difference}");
    }
    let mut connected = Connected {
        serving: Serving::new(drive),
        lines: Vec::new(),
        listener,
    };
    // To the other stream: a program reads the addresses.
    let machine = MachineLine(&setup);
    println!(
        "machine {name}; `ddfeed drive --sim {} status` says what the drive does; Ctrl-C ends it",
        connected.listener.local_addr()?
    );
    eprintln!("{machine}");
    #[cfg(unix)]
    let _kept = if options.pty {
        let (ours, theirs) = pseudo_terminal()?;
        connected.open(ours);
        Some(theirs)
    } else {
        None
    };
    #[cfg(not(unix))]
    ensure!(!options.pty, "this system has no pseudo-terminals");
    let stop = ctrl_c().context("Ctrl-C cannot be caught")?;
    let mut pace = Pace::new(speed);
    while !stop.load(Relaxed) {
        connected.pass()?;
        if let Some(flash) = &mut flash {
            flash.keep(connected.serving.drive_mut())?;
        }
        pace.follow(&mut connected);
    }
    Ok(())
}

fn listen(address: &str) -> Result<TcpListener> {
    let listener = TcpListener::bind(address).with_context(|| {
        format!(
            "{address} cannot be listened at: is another drive served there? Give another with --listen"
        )
    })?;
    listener.set_nonblocking(true)?;
    Ok(listener)
}

fn accept(listener: &TcpListener) -> Result<Option<TcpStream>> {
    match listener.accept() {
        Ok((stream, _)) => {
            stream.set_nonblocking(true)?;
            stream.set_nodelay(true)?;
            Ok(Some(stream))
        }
        Err(error) if later(&error) => Ok(None),
        Err(error) => Err(error).context("a connection could not be taken"),
    }
}

/// A pseudo-terminal, its name printed: our end, and theirs, which stays open so that a host may come and go.
#[cfg(unix)]
fn pseudo_terminal() -> Result<(impl Stream, impl Sized)> {
    use serialport::{SerialPort, TTYPort};
    let (mut ours, theirs) = TTYPort::pair().context("there is no pseudo-terminal left")?;
    ours.set_timeout(Duration::ZERO)?;
    let name = theirs.name().context("the pseudo-terminal has no name")?;
    println!("and at the pseudo-terminal {name}: `ddfeed drive --serial {name} status`");
    Ok((ours, theirs))
}
