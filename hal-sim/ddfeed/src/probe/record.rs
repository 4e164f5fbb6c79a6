//! `record`: the drive's telemetry into a recording.

use super::memory::with_chip;
use super::tell::start;
use super::{Image, ctrl_c, find};
use crate::hold::Hold;
use crate::output::Folder;
use crate::record::{Recorder, save};
use crate::session::RecordOptions;
use anyhow::{Context, Error, Result, bail};
use indicatif::{ProgressBar, ProgressStyle};
use link::TELEMETRY_CHANNEL;
use link::codes::{Run, State};
use link::host::rtt::Channel;
use link::host::{Drive, Memory};
use link::telemetry::Request;
use probe_rs::probe::DebugProbeInfo;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread;
use std::time::{Duration, Instant};

/// How long the channel is left alone: at the full rate it takes 0.1 s to fill.
const PAUSE: Duration = Duration::from_millis(2);
/// How often the drive's state is looked at.
const LOOK: Duration = Duration::from_millis(250);

/// What the thread at the probe says.
enum Said {
    Started(Request),
    Bytes(Vec<u8>),
}

/// Records the drive at the probe that was asked for.
///
/// # Errors
/// There is no such probe, no ELF, or the recording ended early.
pub fn run(options: &RecordOptions) -> Result<()> {
    let probe = find(&options.which)?;
    let image = Image::read(&options.elf)
        .context("the firmware's ELF says where the drive has its data: run `cargo xtask build`, or name it with --elf")?;
    record(probe, image.drive()?, options)
}

/// Records.
fn record(probe: DebugProbeInfo, drive: Drive, options: &RecordOptions) -> Result<()> {
    let folder = Folder::open(&options.out)?;
    let seconds = options.seconds()?;
    let script = Script {
        drive,
        divider: options.divider()?,
        seconds,
        holds: options.hold.clone(),
        stop: ctrl_c().context("Ctrl-C cannot be caught, and would lose the recording")?,
    };
    let stop = Arc::clone(&script.stop);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let bar = ProgressBar::new((seconds * 1e3) as u64)
        .with_style(ProgressStyle::with_template("{bar:40} {msg}")?);

    let (summary, outcome) = save(
        &folder,
        &options.name,
        f64::from(options.rate),
        |recorder| {
            let mut failed: Option<Error> = None;
            let ended = with_chip(
                probe,
                move |mut memory, say| script.run(&mut memory, say),
                |said| {
                    if failed.is_none()
                        && let Err(error) = take(recorder, said)
                    {
                        // The drive is still to be brought to rest, so the thread at the probe ends by itself.
                        stop.store(true, Relaxed);
                        failed = Some(error);
                    }
                    show(&bar, recorder);
                    Ok(())
                },
            );
            failed.map_or(ended, Err)
        },
    )?;
    bar.finish_and_clear();
    println!(
        "{}: {summary}",
        folder.path(&format!("{}.csv.gz", options.name)).display()
    );
    outcome.context("the recording ended early, and what came before is kept")
}

fn take(recorder: &mut Recorder, said: Said) -> Result<()> {
    match said {
        Said::Started(request) => {
            recorder.start(request);
            Ok(())
        }
        Said::Bytes(bytes) => recorder.take(&bytes),
    }
}

fn show(bar: &ProgressBar, recorder: &Recorder) {
    let (count, seconds) = (recorder.count(), recorder.seconds());
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    bar.set_position((seconds * 1e3) as u64);
    bar.set_message(format!("{seconds:.1} s, {} lost", count.lost));
}

/// What the thread at the probe does.
struct Script {
    drive: Drive,
    divider: u8,
    seconds: f64,
    holds: Vec<Hold>,
    stop: Arc<AtomicBool>,
}

impl Script {
    /// Starts the stream, passes it on, and leaves the drive quiet, whatever happens.
    fn run(&self, memory: &mut impl Memory, say: &dyn Fn(Said)) -> Result<()> {
        self.drive.look(memory)?;
        let channel = Channel::find(memory, self.drive.rtt, TELEMETRY_CHANNEL)?
            .context("the drive has not set its telemetry up: does the firmware run?")?;
        say(Said::Started(self.drive.record(memory, self.divider)?));
        let streamed = self.stream(memory, &channel, say);
        let rested = if self.holds.is_empty() {
            Ok(())
        } else {
            self.drive.run(memory, Run::Rest)
        };
        let quiet = self.drive.record(memory, 0).map(|_| ());
        // The first that failed is the cause.
        streamed.and(rested).and(quiet)
    }

    fn stream(
        &self,
        memory: &mut impl Memory,
        channel: &Channel,
        say: &dyn Fn(Said),
    ) -> Result<()> {
        let begun = Instant::now();
        let (mut holds, mut hold_until) = (self.holds.iter(), 0.0);
        let mut looked = begun;
        while !self.stop.load(Relaxed) {
            let now = begun.elapsed().as_secs_f64();
            if now >= self.seconds {
                break;
            }
            if now >= hold_until
                && let Some(hold) = holds.next()
            {
                start(memory, self.drive, hold.velocity, hold.base)?;
                hold_until += hold.seconds;
            }
            let mut bytes = Vec::new();
            channel.drain(memory, &mut bytes)?;
            say(Said::Bytes(bytes));
            if looked.elapsed() > LOOK {
                looked = Instant::now();
                if !self.holds.is_empty() {
                    self.drive.keep_alive(memory)?;
                }
                let view = self.drive.look(memory)?;
                if let Some(State::Fault(fault)) = view.state()
                    && !self.holds.is_empty()
                {
                    bail!("the drive was stopped by a fault. {}", fault.sentence());
                }
            }
            thread::sleep(PAUSE);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use link::codes::Fault;
    use link::view::{DriveCommand, DriveView, MAGIC};
    use std::cell::RefCell;
    use std::mem::offset_of;

    /// A chip that stands in RAM at 0, and loses its probe after a number of accesses.
    struct Fake {
        bytes: Vec<u8>,
        left: u32,
    }

    const VIEW: u32 = 0;
    const COMMAND: u32 = 0x400;
    const RTT: u32 = 0x800;
    const BUFFER: u32 = 0xC00;

    impl Fake {
        fn new(left: u32) -> Self {
            let mut fake = Self {
                bytes: vec![0; 0x1000],
                left: u32::MAX,
            };
            fake.put(VIEW, &[MAGIC, link::LAYOUT, State::Ready.word()]);
            fake.bytes[RTT as usize..RTT as usize + 16].copy_from_slice(b"SEGGER RTT\0\0\0\0\0\0");
            fake.put(RTT + 16, &[2, 0]);
            fake.put(RTT + 24 + 24, &[0, BUFFER, 0x100, 0, 0, 0]);
            fake.left = left;
            fake
        }

        fn put(&mut self, address: u32, words: &[u32]) {
            for (k, word) in words.iter().enumerate() {
                let at = address as usize + 4 * k;
                self.bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
            }
        }

        fn word(&self, address: u32) -> u32 {
            let at = address as usize;
            u32::from_le_bytes(self.bytes[at..at + 4].try_into().unwrap())
        }

        fn command(&self, offset: usize) -> u32 {
            self.word(COMMAND + offset as u32)
        }

        fn reach(&mut self) -> Result<()> {
            self.left = self.left.checked_sub(1).context("the probe is gone")?;
            Ok(())
        }
    }

    impl Memory for Fake {
        fn read(&mut self, address: u32, bytes: &mut [u8]) -> Result<()> {
            self.reach()?;
            let at = address as usize;
            bytes.copy_from_slice(&self.bytes[at..at + bytes.len()]);
            Ok(())
        }

        fn write(&mut self, address: u32, word: u32) -> Result<()> {
            self.reach()?;
            self.put(address, &[word]);
            // The drive takes a command at once.
            if address == COMMAND + offset_of!(DriveCommand, sequence) as u32 {
                let taken = VIEW + offset_of!(DriveView, taken) as u32;
                let count = self.word(taken) + 1;
                self.put(taken, &[count]);
            }
            Ok(())
        }
    }

    fn script(moving: bool) -> Script {
        let hold = Hold {
            velocity: 2.5e-3,
            base: 31.4,
            seconds: 0.3,
        };
        Script {
            drive: Drive::locate(|name| -> Result<u32> {
                Ok(match name {
                    link::VIEW_SYMBOL => VIEW,
                    link::COMMAND_SYMBOL => COMMAND,
                    _ => RTT,
                })
            })
            .unwrap(),
            divider: 2,
            seconds: 0.3,
            holds: if moving { vec![hold] } else { Vec::new() },
            stop: Arc::new(AtomicBool::new(false)),
        }
    }

    #[test]
    fn the_drive_runs_for_its_holds_and_is_left_quiet() {
        let mut chip = Fake::new(u32::MAX);
        let running = RefCell::new(Vec::new());
        script(true)
            .run(&mut chip, &|said| {
                if let Said::Started(request) = said {
                    running.borrow_mut().push(request.divider);
                }
            })
            .unwrap();
        assert_eq!(*running.borrow(), [2]);
        // Once when it was asked to run, and again while it ran.
        let beats = chip.command(offset_of!(DriveCommand, heartbeat));
        assert!(beats >= 2, "the command was renewed {beats} times");
        assert!(
            chip.command(offset_of!(DriveCommand, velocity)) > 0,
            "measured {}, expected above {}",
            chip.command(offset_of!(DriveCommand, velocity)),
            0
        );
        assert_eq!(
            chip.command(offset_of!(DriveCommand, run)),
            Run::Rest.word()
        );
        let last = Request::of_word(chip.command(offset_of!(DriveCommand, record)));
        assert_eq!(last.divider, 0);
    }

    #[test]
    fn a_fault_and_a_lost_probe_end_a_recording_with_their_cause() {
        let mut chip = Fake::new(u32::MAX);
        chip.put(
            VIEW + offset_of!(DriveView, state) as u32,
            &[State::FAULT_WORD, Fault::NutEncoder.word()],
        );
        let error = script(true)
            .run(&mut chip, &|_| ())
            .unwrap_err()
            .to_string();
        assert!(error.contains(Fault::NutEncoder.sentence()), "{error}");
        assert_eq!(
            chip.command(offset_of!(DriveCommand, run)),
            Run::Rest.word()
        );

        let mut chip = Fake::new(40);
        let error = script(false)
            .run(&mut chip, &|_| ())
            .unwrap_err()
            .to_string();
        assert_eq!(error, "the probe is gone");
    }
}
