//! The emulated drive on its bench: built, joined to a machine, observed in its debug view and commanded over RTT's link, as by a
//! person with a probe.

use crate::chip::CORE_HZ;
use crate::chip::power::PowerStage;
use crate::chip::wiring::Wiring;
use crate::commander::Commander;
use crate::emulator::Emulator;
use crate::image::Image;
use crate::joint::Joint;
use crate::pins::Motor;
use control::guard::GuardPlate;
use control::journal::Journal;
use control::plate::DrivePlate;
use hal_sim::board::BoardConfig;
use hal_sim::experiment::RPM;
use hal_sim::sensors::CurrentSensing;
use link::codes::{Demand, Fault, State};
use link::host::{Drive, View};
use link::message::{Command as LinkCommand, Refusal, Reply};
use link::scale;
use link::telemetry::{Frame, Request};
use plant::machine::Coupling;
use plant::model::Model;
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::rc::Rc;
use std::sync::OnceLock;

/// Plate data of the drive that the firmware is built for by default, from the firmware's own source.
#[must_use]
pub fn plate() -> DrivePlate {
    plate_of(Wiring::Nucleo)
}

/// Plate data of the drive on a board, from the firmware's own source.
#[must_use]
pub fn plate_of(board: Wiring) -> DrivePlate {
    board.kind().plate()
}

/// What the ADCs read of a board's heat sinks at a temperature, degrees Celsius.
#[must_use]
pub fn counts_at(board: Wiring, celsius: f64) -> [u16; 2] {
    board.kind().counts_at(celsius)
}

/// Limits of a board, from the firmware's own source.
#[must_use]
pub fn guards_of(board: Wiring) -> GuardPlate {
    board.kind().guards()
}

/// Builds the firmware as it is flashed, once, and says where its ELF is.
///
/// # Errors
/// The build's own words.
pub fn firmware() -> Result<PathBuf, String> {
    firmware_of(Wiring::Nucleo)
}

/// Builds the firmware for a board, once, and says where its ELF is. It takes the rotors to stand where the plate says, as
/// those of a machine do that begins at zero; but for that it is what is flashed.
///
/// # Errors
/// The build's own words.
pub fn firmware_of(board: Wiring) -> Result<PathBuf, String> {
    firmware_that(board, Variant::AtZero)
}

/// Builds the firmware for a board as it is flashed, which aligns the rotors first, once, and says where its ELF is.
///
/// # Errors
/// The build's own words.
pub fn aligning_firmware_of(board: Wiring) -> Result<PathBuf, String> {
    firmware_that(board, Variant::Aligns)
}

/// Builds the firmware for the default board that compensates ripple, once, and says where its ELF is. It takes the rotors to
/// stand where the plate says.
///
/// # Errors
/// The build's own words.
pub fn smooth_firmware() -> Result<PathBuf, String> {
    firmware_that(Wiring::Nucleo, Variant::Smooth)
}

/// What an ELF has beside its board.
#[derive(Clone, Copy)]
enum Variant {
    /// Its rotors stand where the plate says.
    AtZero,
    /// It aligns them first, as what is flashed.
    Aligns,
    /// The first, and it compensates ripple.
    Smooth,
}

fn firmware_that(board: Wiring, variant: Variant) -> Result<PathBuf, String> {
    static BUILT: [OnceLock<Result<PathBuf, String>>; 9] = [const { OnceLock::new() }; 9];
    BUILT[board as usize + 3 * variant as usize]
        .get_or_init(|| {
            let _alone = xtask::firmware::alone().map_err(said)?;
            let (name, features) = match board {
                Wiring::Nucleo => ("firmware-nucleo", "board-nucleo"),
                Wiring::Nucleo40kHz => ("firmware-40khz", "pwm-40khz"),
                Wiring::Mains => ("firmware-mains", "board-mains"),
            };
            let (name, features) = match variant {
                Variant::Aligns => (format!("{name}-aligns"), features.to_owned()),
                Variant::AtZero => (name.to_owned(), format!("{features},encoders-at-zero")),
                Variant::Smooth => (
                    format!("{name}-smooth"),
                    format!("{features},encoders-at-zero,smooth"),
                ),
            };
            // What is flashed has the addresses that a debugger finds in the ELF of `cargo xtask build`.
            let elf = match (board, variant) {
                (Wiring::Nucleo, Variant::Aligns) => build(&[])?,
                _ => build(&["--no-default-features", "--features", &features])?,
            };
            let kept = elf.with_file_name(name);
            // Whole at once, for another process may read it.
            let copied = kept.with_extension("copied");
            std::fs::copy(&elf, &copied)
                .and_then(|_| std::fs::rename(&copied, &kept))
                .map_err(|error| format!("cannot copy {}: {error}", elf.display()))?;
            // The name is the default board's again: what is flashed by it must be that.
            build(&[])?;
            Ok(kept)
        })
        .clone()
}

/// A run of cargo on the firmware, as it is built for the chip: `build` or `check`.
#[must_use]
pub fn cargo_on_firmware(command: &str) -> Command {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    let mut run = Command::new(cargo);
    run.args([command, "--package", "firmware"]);
    run.args(["--profile", "firmware", "--target", xtask::firmware::TARGET]);
    run
}

fn build(features: &[&str]) -> Result<PathBuf, String> {
    let root = xtask::tools::root().map_err(said)?;
    let output = cargo_on_firmware("build")
        .args(features)
        .current_dir(&root)
        .output()
        .map_err(|error| format!("cargo does not start: {error}"))?;
    if !output.status.success() {
        return Err(format!(
            "the firmware does not build:\n{}",
            String::from_utf8_lossy(&output.stderr)
        ));
    }
    Ok(xtask::firmware::folder().map_err(said)?.join("firmware"))
}

/// One count of a board's linear scale, m, from the firmware's own source.
#[must_use]
pub fn scale_count_m(board: Wiring) -> f64 {
    board.kind().scale_count_m()
}

/// `template` with the motors that the plate of `board` declares: see [`hal_sim::boards::BoardKind::machine`].
#[must_use]
pub fn machine_of(board: Wiring, template: &Model, coupling: Coupling) -> Model {
    board.kind().machine(template, coupling)
}

/// A board's power stage with its own amplifiers on sensors of a kind, and a driver that says that there is a fault when a
/// switch carries so much.
#[must_use]
pub fn power_stage(wiring: Wiring, sensing: CurrentSensing, driver_a: f64) -> PowerStage {
    let board = plate_of(wiring).board;
    PowerStage {
        sensing,
        amps_per_count: board.amps_per_count,
        zero: board.zero_counts,
        driver_a,
    }
}

/// Peak phase current that a board's comparators let pass, A.
#[must_use]
pub fn over_current_a(wiring: Wiring) -> f64 {
    wiring.kind().over_current_a()
}

/// The board of `hal-sim` that has what the firmware's plate says.
#[must_use]
pub fn board_config(wiring: Wiring) -> BoardConfig {
    wiring.kind().config()
}

/// The state: bridges off, ready to run.
pub const READY: u32 = State::Ready.word();
/// The state: following the command.
pub const RUNNING: u32 = State::Running.word();
/// The state: stopped by a fault.
pub const FAULT: u32 = State::FAULT_WORD;

/// What the drive says it is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status {
    /// A [`State`]'s word.
    pub state: u32,
    /// A [`link::codes::Fault`]'s word.
    pub fault: u32,
    /// A [`link::codes::ResetReason`]'s word.
    pub reset_reason: u32,
}

/// The drive on its bench.
pub struct Bench {
    /// The chip.
    pub emulator: Emulator,
    /// The machine at its pins.
    pub joint: Rc<RefCell<Joint>>,
    /// What it runs.
    pub image: Rc<Image>,
    /// Where its debug structures are.
    pub drive: Drive,
    /// Someone commands, and sends heartbeats.
    pub attended: bool,
    /// The session, once something was commanded.
    commander: Option<Commander>,
    /// Speeds that the next run is commanded with: 2^-28 m/s and 2^-18 rad/s.
    speeds: [i32; 2],
    /// Number of the last stream of telemetry.
    stream: u32,
    /// When the last heartbeat was sent, cycles.
    beaten: u64,
    /// Periods of the screw in a step of the speed task.
    speed_divider: u64,
}

impl Bench {
    /// The firmware just flashed, on `model` with the default board's motors.
    ///
    /// # Errors
    /// A sentence about what is missing.
    pub fn new(model: &Model, coupling: Coupling) -> Result<Self, String> {
        Self::on(Wiring::Nucleo, model, coupling)
    }

    /// The firmware of a board just flashed, on `model` with its motors: see [`machine_of`].
    ///
    /// # Errors
    /// A sentence about what is missing.
    pub fn on(board: Wiring, model: &Model, coupling: Coupling) -> Result<Self, String> {
        Self::with(&firmware_of(board)?, board, model, coupling)
    }

    /// It boots, is asked for 2.5 mm/s with the nut at 300 rpm, and runs for `seconds`.
    ///
    /// # Errors
    /// It is not ready in time, or does not run at the end.
    pub fn running(mut self, seconds: f64) -> Result<Self, String> {
        self.wait_for(READY, 0.2)?;
        self.start(2.5e-3, 300.0 * RPM)?;
        self.pass(seconds)?;
        match self.status()?.state {
            RUNNING => Ok(self),
            state => Err(format!(
                "after {seconds} s of running the drive's state is the word {state}, expected {RUNNING}"
            )),
        }
    }

    /// An ELF for a board just flashed, on `model`.
    ///
    /// # Errors
    /// A sentence about what is missing.
    pub fn with(
        elf: &Path,
        board: Wiring,
        model: &Model,
        coupling: Coupling,
    ) -> Result<Self, String> {
        let image = Rc::new(Image::read(elf)?);
        let config = board_config(board);
        let joint = Rc::new(RefCell::new(Joint::new(
            &machine_of(board, model, coupling),
            coupling,
            config,
            counts_at(board, 40.0),
        )));
        let emulator = Emulator::new(&image, board, Rc::clone(&joint) as _)?;
        let drive = Drive::locate(|name| image.symbol(name))?;
        Ok(Self {
            emulator,
            joint,
            image,
            drive,
            attended: true,
            commander: None,
            speeds: [0; 2],
            stream: 0,
            beaten: 0,
            speed_divider: plate_of(board).board.speed_divider.into(),
        })
    }

    /// Lets `seconds` pass.
    ///
    /// # Errors
    /// What the firmware did that the chip does not have.
    pub fn pass(&mut self, seconds: f64) -> Result<(), String> {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let cycles = (seconds * CORE_HZ as f64).round() as u64;
        let until = self.emulator.chip().now + cycles;
        // Twice in the shortest time that a board lets the commander be silent.
        const BEAT: u64 = CORE_HZ / 5;
        while self.attended && self.commander.is_some() {
            let due = self.beaten + BEAT;
            if due > until {
                break;
            }
            if due > self.emulator.chip().now {
                self.emulator.run_until(due)?;
            }
            self.beat()?;
        }
        self.emulator.run_until(until)
    }

    /// Sends a heartbeat.
    fn beat(&mut self) -> Result<(), String> {
        self.beaten = self.emulator.chip().now;
        if let Some(commander) = &mut self.commander {
            commander
                .put(&mut self.emulator, LinkCommand::Heartbeat)
                .map_err(said)?;
        }
        Ok(())
    }

    /// Lets time pass to shortly before the screw's next top, where all tasks have done their work.
    ///
    /// # Errors
    /// As [`Bench::pass`].
    pub fn settle_untold(&mut self) -> Result<(), String> {
        const MARGIN: u64 = 500;
        let chip = self.emulator.chip();
        let top = chip.pwm[0].next_top().ok_or("the timers do not run yet")?;
        let (now, period) = (chip.now, chip.pwm[0].period());
        let until = if top > now + MARGIN {
            top
        } else {
            top + period
        } - MARGIN;
        self.emulator.run_until(until)
    }

    /// [`Bench::settle_untold`], and how many of the screw's tops were sampled so far.
    ///
    /// # Errors
    /// The record of tops is not kept, or as [`Bench::pass`].
    pub fn settle(&mut self) -> Result<u64, String> {
        self.settle_untold()?;
        let tops = self
            .emulator
            .chip()
            .tops
            .as_ref()
            .ok_or("the record of tops is not kept")?;
        Ok(tops.iter().filter(|top| top.motor == Motor::Screw).count() as u64)
    }

    /// Time until the next top of `motor`'s timer, s.
    pub fn time_to_top(&mut self, motor: Motor) -> f64 {
        let chip = self.emulator.chip();
        let next = chip.pwm[motor as usize].next_top().unwrap_or(chip.now);
        (next - chip.now) as f64 / CORE_HZ as f64
    }

    /// Makes the interrupt handler called `handler` loop without end from its next entry on.
    ///
    /// # Errors
    /// The firmware has no such function.
    pub fn hang(&mut self, handler: &str) -> Result<(), String> {
        const BRANCH_TO_ITSELF: u16 = 0xE7FE;
        let address = self.image.symbol(handler)? & !1;
        self.emulator.patch(address, BRANCH_TO_ITSELF)
    }

    /// The journal in the firmware's memory.
    ///
    /// # Errors
    /// It is not where the ELF says.
    pub fn journal(&self) -> Result<Journal, String> {
        let mut address = self.image.symbol(link::JOURNAL_SYMBOL)?;
        let mut failed = None;
        let journal = Journal::of_words(|| {
            let word = self.emulator.word(address);
            address += 4;
            word.unwrap_or_else(|error| {
                failed = Some(error);
                0
            })
        });
        failed.map_or(Ok(journal), Err)
    }

    /// What the firmware has logged since the last call.
    ///
    /// # Errors
    /// The log is not where the ELF says, or is no log.
    pub fn log(&mut self) -> Result<Vec<String>, String> {
        crate::log::drain(&mut self.emulator, &self.image)
    }

    /// What the drive says.
    ///
    /// # Errors
    /// Never, while the view is in RAM.
    pub fn status(&mut self) -> Result<Status, String> {
        let view = self.look()?;
        let words = view.words();
        Ok(Status {
            state: words.state,
            fault: words.fault,
            reset_reason: words.reset_reason,
        })
    }

    /// The debug view, as `cargo xtask attach` reads it.
    ///
    /// # Errors
    /// The firmware has not set it up.
    pub fn look(&mut self) -> Result<View, String> {
        self.drive.look(&mut self.emulator).map_err(said)
    }

    /// Lets time pass period by period until the view is `there`: the screw's period whose speed task did that. It must do so within
    /// 20 ms, and the record of tops must be kept.
    ///
    /// # Errors
    /// It did not come.
    pub fn wait_for_step(&mut self, there: impl Fn(&View) -> bool) -> Result<u64, String> {
        /// Periods of the fastest board in 20 ms.
        const PERIODS: u32 = 800;
        for _ in 0..PERIODS {
            // All tasks of a period have done their work shortly before the next top.
            let tops = self.settle()?;
            if there(&self.look()?) {
                // A step may end some periods after it began.
                let period = tops.saturating_sub(1);
                return Ok(period - period % self.speed_divider);
            }
            let period = self.emulator.chip().pwm[0].period();
            let until = self.emulator.time() + period / 2;
            self.emulator.run_until(until)?;
        }
        Err(format!(
            "no step of the speed task did that: {:?}",
            self.status()
        ))
    }

    /// Lets time pass until the drive is in `state`, for at most `seconds`.
    ///
    /// # Errors
    /// The state did not come.
    pub fn wait_for(&mut self, state: u32, seconds: f64) -> Result<(), String> {
        let what = format!("the drive's state {state}");
        // Until it has started there is no view.
        let there = |bench: &mut Self| Ok(bench.status().is_ok_and(|status| status.state == state));
        self.until(&what, seconds, 200e-6, there).map(|_| ())
    }

    /// Lets time pass, `look` s at a time, until `there`, for at most `seconds` of the chip's time: how long it took, s.
    /// Every wait of a test goes through here, so that none is without end.
    ///
    /// # Errors
    /// It did not come: what was waited for, how long, and what the drive is doing instead. Or as [`Bench::pass`].
    pub fn until(
        &mut self,
        what: &str,
        seconds: f64,
        look: f64,
        mut there: impl FnMut(&mut Self) -> Result<bool, String>,
    ) -> Result<f64, String> {
        let mut passed = 0.0;
        while !there(self)? {
            if passed > seconds {
                return Err(format!(
                    "{what}: not there after {:.1} us, expected within {:.1} us; the drive is at {:?}",
                    1e6 * passed,
                    1e6 * seconds,
                    self.status()
                ));
            }
            self.pass(look)?;
            passed += look;
        }
        Ok(passed)
    }

    /// Commands over RTT's link, and waits for the answer. A session is opened first where there is none, or where the firmware has
    /// restarted.
    ///
    /// # Errors
    /// The firmware refuses it, or does not answer within 50 ms.
    pub fn tell(&mut self, command: LinkCommand) -> Result<Reply, String> {
        if self.commander.is_none() {
            self.open()?;
        }
        match self.ask(command)? {
            Reply::Refused(word) if word == Refusal::Session.word() => {
                self.open()?;
                accepted(self.ask(command)?)
            }
            reply => accepted(reply),
        }
    }

    fn open(&mut self) -> Result<(), String> {
        let commander = Commander::new(&mut self.emulator, self.drive.rtt).map_err(said)?;
        self.commander = Some(commander);
        self.ask(LinkCommand::Hello).and_then(accepted).map(|_| ())
    }

    fn ask(&mut self, command: LinkCommand) -> Result<Reply, String> {
        /// Time of a look at the channel, s.
        const LOOK_S: f64 = 20e-6;
        /// A reply takes no longer, s.
        const PATIENCE_S: f64 = 50e-3;
        let commander = self.commander.as_mut().ok_or("there is no session")?;
        let number = commander.put(&mut self.emulator, command).map_err(said)?;
        self.beaten = self.emulator.chip().now;
        let mut reply = None;
        // The heartbeats of `pass` come no closer than its renewals.
        let attended = std::mem::replace(&mut self.attended, false);
        let waited = self.until("an answer over RTT", PATIENCE_S, LOOK_S, |bench| {
            if let Some(commander) = &mut bench.commander {
                reply = commander.reply(&mut bench.emulator, number).map_err(said)?;
            }
            Ok(reply.is_some())
        });
        self.attended = attended;
        waited?;
        reply.ok_or_else(|| "no answer".to_owned())
    }

    /// Arms the drive, and has it follow a table velocity, m/s, and a common speed, rad/s. The drive runs some milliseconds later.
    ///
    /// # Errors
    /// The numbers are beyond the command's formats, or the firmware refuses.
    pub fn start(&mut self, velocity: f64, base: f64) -> Result<(), String> {
        let word = |value, bits| {
            scale::word(value, bits).ok_or_else(|| format!("{value} is beyond the format"))
        };
        self.speeds = [
            word(velocity, scale::TABLE_VELOCITY)?,
            word(base, scale::BASE_SPEED)?,
        ];
        self.demand(Demand::Run)
    }

    /// Demands rest, an alignment, a run at the last speeds, or a reset.
    ///
    /// # Errors
    /// The firmware refuses it.
    pub fn demand(&mut self, demand: Demand) -> Result<(), String> {
        let [velocity, base] = self.speeds;
        let base = Some(base);
        let command = match demand {
            Demand::Rest => LinkCommand::Stop,
            Demand::Align => LinkCommand::Arm,
            Demand::Reset => LinkCommand::Reset,
            Demand::Run => {
                self.tell(LinkCommand::Arm)?;
                LinkCommand::Run { velocity, base }
            }
        };
        self.tell(command).map(|_| ())
    }

    /// Waits until the drive is unaligned, and aligns it within `seconds`.
    ///
    /// # Errors
    /// It is not ready by then.
    pub fn align(&mut self, seconds: f64) -> Result<(), String> {
        self.wait_for(State::Unaligned.word(), 0.5)?;
        self.demand(Demand::Align)?;
        self.until("an aligned drive", seconds, 200e-6, |bench| {
            let status = bench.status()?;
            match Fault::of_word(status.fault) {
                Some(fault) => Err(format!("a fault ended the alignment: {}", fault.name())),
                None => Ok(status.state == READY),
            }
        })
        .map(|_| ())
    }

    /// Demands telemetry at every `divider`th step of the speed task, in a new stream; 0: none.
    ///
    /// # Errors
    /// The firmware refuses it.
    pub fn record(&mut self, divider: u8) -> Result<Request, String> {
        self.stream += 1;
        let stream = self.stream;
        let request = Request { divider, stream };
        self.tell(LinkCommand::Record(request.word()))?;
        Ok(request)
    }

    /// The telemetry that has come since it was last taken.
    ///
    /// # Errors
    /// The channel is not as the firmware has it.
    pub fn take_telemetry(&mut self) -> Result<Vec<Frame>, String> {
        let Some(commander) = &mut self.commander else {
            return Ok(Vec::new());
        };
        commander.take_telemetry(&mut self.emulator).map_err(said)
    }
}

fn accepted(reply: Reply) -> Result<Reply, String> {
    match reply {
        Reply::Refused(word) => Err(format!("refused: {:?}", Refusal::of_word(word))),
        reply => Ok(reply),
    }
}

fn said(error: anyhow::Error) -> String {
    format!("{error:#}")
}
