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
    let listener = TcpListener::bind(&options.listen).with_context(|| {
        format!(
            "{} cannot be listened at: is another drive served there? Give another with --listen",
            options.listen
        )
    })?;
    listener.set_nonblocking(true)?;
    for warning in drive.settings().warnings() {
        eprintln!("warning: {}", warning.sentence());
    }
    for difference in differences(&setup, drive.settings()) {
        eprintln!("warning: {difference}");
    }
    let mut serving = Serving::new(drive);
    let mut lines = Vec::new();
    // To the other stream: a program reads the addresses.
    let machine = MachineLine(&setup);
    println!(
        "machine {name}; `ddfeed drive --sim {} status` says what the drive does; Ctrl-C ends it",
        listener.local_addr()?
    );
    eprintln!("{machine}");
    #[cfg(unix)]
    let _kept = if options.pty {
        let (ours, theirs) = pseudo_terminal()?;
        lines.push(Open {
            id: serving.open(),
            stream: Box::new(ours),
        });
        Some(theirs)
    } else {
        None
    };
    #[cfg(not(unix))]
    ensure!(!options.pty, "this system has no pseudo-terminals");
    let stop = ctrl_c().context("Ctrl-C cannot be caught")?;
    let (mut begun, mut passed, mut lagged) = (Instant::now(), Duration::ZERO, false);
    while !stop.load(Relaxed) {
        if let Some(stream) = accept(&listener)? {
            lines.push(Open {
                id: serving.open(),
                stream: Box::new(stream),
            });
        }
        lines.retain_mut(|line| {
            let there = line.pass(&mut serving);
            if !there {
                serving.close(line.id);
            }
            there
        });
        if let Some(flash) = &mut flash {
            flash.keep(serving.drive_mut())?;
        }
        let due = begun.elapsed().mul_f64(speed);
        for _ in 0..AT_ONCE {
            // Time that is not real may wait for a host that is slow; in real time it loses samples, as with a board.
            if passed >= due || (speed > 1.0 && serving.is_full()) {
                break;
            }
            serving.millisecond();
            passed += Duration::from_millis(1);
            for line in &mut lines {
                // A line that is gone is found when it is read.
                let _ = line.write(&mut serving);
            }
        }
        if due > passed + LAG {
            if !lagged {
                eprintln!(
                    "this computer does not simulate the drive {speed} times as fast as real time: it goes as fast as it can"
                );
                lagged = true;
            }
            (begun, passed) = (Instant::now(), Duration::ZERO);
        } else if due < passed {
            sleep(Duration::from_micros(200));
        }
    }
    Ok(())
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
