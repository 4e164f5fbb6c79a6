//! The table follows set-points of a file or of the standard input.

mod rows;

use super::connect::Drive;
use super::motion::{Stopped, base, caught, ready, rest};
use super::options::FollowOptions;
use super::status::look;
use anyhow::{Context, Result, bail};
use link::codes::State;
use link::host::command::base_speed;
use link::host::refused::{Refused, unexpected};
use link::message::{Command, Refusal, Reply, Travel};
use rows::{Row, Rows};
use serde_json::json;
use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::fs::File;
use std::io::{BufReader, Read, stdin};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

/// Rows that are read ahead.
const AHEAD: usize = 1000;
/// How often the drive is heard while set-points go out.
const HEAR: Duration = Duration::from_millis(1);
/// How often it is looked at.
const LOOK: Duration = Duration::from_millis(100);
/// How long the standard input may be silent before a heartbeat goes out.
const BEAT: Duration = Duration::from_millis(20);

/// What the table was behind the set-points.
#[derive(Default)]
struct Behind {
    count: u32,
    squares: f64,
    most_nm: f64,
}

impl Behind {
    fn add(&mut self, nm: i32) {
        let nm = f64::from(nm);
        self.count += 1;
        self.squares += nm * nm;
        self.most_nm = self.most_nm.max(nm.abs());
    }

    fn rms_um(&self) -> f64 {
        1e-3 * (self.squares / f64::from(self.count.max(1))).sqrt()
    }
}

/// Follows the set-points to their end, or until Ctrl-C, and comes to rest.
pub fn follow(drive: &mut Drive, options: &FollowOptions) -> Result<()> {
    let settings = drive.settings()?;
    let stop = caught()?;
    let rows = read(&options.file)?;
    let first = match rows.recv() {
        Ok(first) => first?,
        Err(_) => bail!("there are no set-points behind the names of the columns"),
    };
    let base = match base(&options.lead) {
        Some(rad_s) => base_speed(rad_s * 60.0 / TAU, "--nut-rpm")?,
        None => 0,
    };
    if options.lead.arm {
        ready(drive, &stop)?;
    }
    drive.tell(Command::Stream {
        delay_ms: options.delay_ms,
        homed: options.homed,
        base,
    })?;
    let mut following = Following {
        // Positions count from where the table stands, which is that of the first row.
        zero_mm: if options.homed {
            0.0
        } else {
            first.position_mm
        },
        delay_us: i64::from(options.delay_ms) * 1000,
        posted: VecDeque::new(),
        clock: None,
        behind: Behind::default(),
        taken: 0,
        last_us: 0,
    };
    let followed = following.run(drive, rows, first, &stop);
    let rested = rest(drive);
    followed.and(rested)?;
    let (behind, seconds) = (&following.behind, 1e-6 * following.last_us as f64);
    let at_mm = look(drive)?.position_mm(&settings);
    if options.json {
        let result = json!({
            "seconds": seconds,
            "set_points": following.taken,
            "behind_um_rms": behind.rms_um(),
            "behind_um_max": 1e-3 * behind.most_nm,
            "at_rest_mm": at_mm,
        });
        println!("{result:#}");
    } else {
        println!(
            "followed {} set-points for {seconds:.3} s: {:.2} um behind (rms), {:.2} um at most; at rest at {at_mm:.4} mm",
            following.taken,
            behind.rms_um(),
            1e-3 * behind.most_nm
        );
    }
    Ok(())
}

/// Rows, as they come: the standard input is read beside the stream.
fn read(file: &Path) -> Result<Receiver<Result<Row>>> {
    let text: Box<dyn Read + Send> = if file == Path::new("-") {
        Box::new(stdin())
    } else {
        let open = File::open(file);
        Box::new(open.with_context(|| format!("{} cannot be read", file.display()))?)
    };
    let (sender, receiver) = sync_channel(AHEAD);
    thread::spawn(move || {
        let rows = match Rows::new(BufReader::new(text)) {
            Ok(rows) => rows,
            Err(error) => {
                let _ = sender.send(Err(error));
                return;
            }
        };
        // Nobody hears any more: the command has ended.
        for row in rows {
            if sender.send(row).is_err() {
                return;
            }
        }
    });
    Ok(receiver)
}

/// A stream under way.
struct Following {
    zero_mm: f64,
    delay_us: i64,
    /// Sequence numbers and times of what is not answered.
    posted: VecDeque<(u32, i64)>,
    /// The drive's time in the stream, us, by its last answer.
    clock: Option<(Instant, i64)>,
    behind: Behind,
    /// Set-points that the drive has taken.
    taken: u32,
    last_us: i64,
}

impl Following {
    fn run(
        &mut self,
        drive: &mut Drive,
        rows: Receiver<Result<Row>>,
        first: Row,
        stop: &AtomicBool,
    ) -> Result<()> {
        let (mut next, mut more) = (Some(first), true);
        let (mut looked, mut beaten) = (drive.now(), drive.now());
        while !stop.load(Relaxed) {
            while let Some(row) = next
                && self.is_due(row, drive.now())
            {
                self.post(drive, row)?;
                beaten = drive.now();
                next = None;
                if more {
                    match rows.try_recv() {
                        Ok(row) => next = Some(row?),
                        Err(TryRecvError::Empty) => {}
                        Err(TryRecvError::Disconnected) => more = false,
                    }
                }
            }
            if next.is_none() && more {
                match rows.try_recv() {
                    Ok(row) => {
                        next = Some(row?);
                        continue;
                    }
                    Err(TryRecvError::Empty) => {}
                    Err(TryRecvError::Disconnected) => more = false,
                }
            }
            if drive.now() - beaten >= BEAT {
                beaten = drive.now();
                drive.beat()?;
            }
            drive.listen(HEAR)?;
            let over = next.is_none() && !more;
            self.hear(drive, over)?;
            if drive.now() - looked >= LOOK {
                looked = drive.now();
                let seen = look(drive)?;
                if let Some(State::Fault(fault)) = seen.state {
                    bail!(Stopped(fault, None));
                }
                let ended = matches!(seen.travel(), Some(Travel::StreamEnded | Travel::Ended));
                if ended && over {
                    return Ok(());
                }
                if ended {
                    return Err(self.ended());
                }
            }
        }
        Ok(())
    }

    /// Its time has come, but for the drive's delay.
    fn is_due(&self, row: Row, now: Instant) -> bool {
        let clock_us = match self.clock {
            None => -self.delay_us,
            Some((at, us)) => {
                let gone = i64::try_from((now - at).as_micros()).unwrap_or(i64::MAX);
                us.saturating_add(gone)
            }
        };
        row.us <= clock_us.saturating_add(self.delay_us)
    }

    fn post(&mut self, drive: &mut Drive, row: Row) -> Result<()> {
        // The stream's time wraps.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let (at_us, position_nm) = (
            row.us as u32,
            ((row.position_mm - self.zero_mm) * 1e6).round() as i64,
        );
        let sequence = drive.post(Command::SetPoint {
            at_us,
            position_nm,
            velocity: row.velocity,
        })?;
        self.posted.push_back((sequence, row.us));
        Ok(())
    }

    fn hear(&mut self, drive: &mut Drive, over: bool) -> Result<()> {
        while let Some((sequence, answer)) = drive.take_answer() {
            let of_answer = |(posted, _): &(u32, i64)| *posted == sequence;
            let Some(place) = self.posted.iter().position(of_answer) else {
                continue;
            };
            let Some((_, us)) = self.posted.drain(..=place).next_back() else {
                continue;
            };
            match answer {
                Reply::Followed { ahead_us, error_nm } => {
                    let clock_us = us - i64::from(ahead_us);
                    self.clock = Some((drive.now(), clock_us));
                    self.taken += 1;
                    self.last_us = us;
                    if clock_us >= 0 {
                        self.behind.add(error_nm);
                    }
                }
                Reply::Refused(word) if Refusal::of_word(word) == Some(Refusal::NoStream) => {
                    if !over {
                        return Err(self.ended());
                    }
                }
                other => {
                    return Err(unexpected(&other)
                        .context(format!("the set-point at {:.6} s", 1e-6 * us as f64)));
                }
            }
        }
        Ok(())
    }

    /// The stream has ended before its set-points did.
    fn ended(&self) -> anyhow::Error {
        anyhow::Error::from(Refused::For(Refusal::NoStream)).context(format!(
            "the stream ended at {:.3} s, as the next set-point came later than the delay of {} ms allows, or the drive was stopped: \
             give a larger --delay-ms, at most 200",
            1e-6 * self.last_us as f64,
            self.delay_us / 1000
        ))
    }
}
