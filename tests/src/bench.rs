//! The emulated drive on its bench: built, joined to a machine, and used through its debug structures, as a person with
//! a probe would.

use crate::chip::CORE_HZ;
use crate::chip::power::PowerStage;
use crate::chip::wiring::Wiring;
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
use link::codes::{Run, State};
use link::host::{Drive, View};
use link::telemetry::Request;
use plant::machine::Coupling;
use plant::model::Model;
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::rc::Rc;
use std::sync::{Mutex, OnceLock};

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
    // One build at a time, for all boards' ELFs leave cargo by the same name.
    static ONE: Mutex<()> = Mutex::new(());
    BUILT[board as usize + 3 * variant as usize]
        .get_or_init(|| {
            let _one = ONE.lock().map_err(|_| "another build failed")?;
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
            let elf = build(&["--no-default-features", "--features", &features])?;
            let kept = elf.with_file_name(name);
            std::fs::copy(&elf, &kept)
                .map_err(|error| format!("cannot copy {}: {error}", elf.display()))?;
            // The name is the default board's again: what is flashed by it must be that.
            build(&[])?;
            Ok(kept)
        })
        .clone()
}

const TARGET: &str = "thumbv7em-none-eabihf";

/// A run of cargo on the firmware, as it is built for the chip: `build` or `check`.
#[must_use]
pub fn cargo_on_firmware(command: &str) -> Command {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    let mut run = Command::new(cargo);
    run.args([command, "--package", "firmware"]);
    run.args(["--profile", "firmware", "--target", TARGET]);
    run
}

fn build(features: &[&str]) -> Result<PathBuf, String> {
    let root = xtask::tools::root().map_err(|error| format!("{error:#}"))?;
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
    let target =
        std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), PathBuf::from);
    Ok(target.join(TARGET).join("firmware").join("firmware"))
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
    /// Someone commands, and says so: see [`Drive::keep_alive`].
    pub attended: bool,
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
        self.ask(2.5e-3, 300.0 * RPM)?;
        self.run(1)?;
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
        while self.attended {
            self.drive.keep_alive(&mut self.emulator).map_err(said)?;
            let renewed = self.emulator.chip().now + CORE_HZ / 4;
            if renewed >= until {
                break;
            }
            self.emulator.run_until(renewed)?;
        }
        self.emulator.run_until(until)
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

    /// Makes the interrupt handler called `handler` loop for ever from its next entry on.
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

    /// Asks for a table velocity, m/s, and a base speed, rad/s.
    ///
    /// # Errors
    /// The numbers are beyond the command's formats.
    pub fn ask(&mut self, velocity: f64, base: f64) -> Result<(), String> {
        self.drive
            .ask(&mut self.emulator, velocity, base)
            .map_err(said)
    }

    /// Asks to run (1), to come to rest (0), or to leave a fault (2).
    ///
    /// # Errors
    /// There is no such request.
    pub fn run(&mut self, run: u32) -> Result<(), String> {
        let run = Run::of_word(run).ok_or_else(|| format!("there is no request {run}"))?;
        self.drive.run(&mut self.emulator, run).map_err(said)
    }

    /// Asks for telemetry at every `divider`th step of the speed task; 0: none.
    ///
    /// # Errors
    /// Never, while the command is in RAM.
    pub fn record(&mut self, divider: u8) -> Result<Request, String> {
        self.drive.record(&mut self.emulator, divider).map_err(said)
    }
}

fn said(error: anyhow::Error) -> String {
    format!("{error:#}")
}
