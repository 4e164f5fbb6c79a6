//! What goes wrong between debugger and chip: each is said in a sentence with cause and remedy, in time.

use crate::emulated::Emulated;
use crate::figures::named;
use crate::program::{Running, board, ddfeed};
use board::flash::listen;
use ddfeed::probe::{Image, find};
use ddfeed::session::Which;
use link::{LINK_UP_CHANNEL, RTT_SYMBOL, VIEW_SYMBOL};
use plant::machine::Coupling;
use plant::model::Model;
use std::process::Command;
use std::time::{Duration, Instant};
use tests::bench::{Bench, READY, RUNNING, firmware};
use tests::chip::flash::BEGIN;
use tests::emulator::HaltedTime;

/// No failure takes longer to be said.
const PATIENCE: Duration = Duration::from_secs(8);
/// How long a build and a flashing may take.
const WORK: Duration = Duration::from_secs(60);

fn new() -> Result<Bench, String> {
    Bench::new(&Model::paper(), Coupling::Lumped)
}

fn ready() -> Result<Bench, String> {
    let mut bench = new()?;
    bench.wait_for(READY, 0.2)?;
    Ok(bench)
}

fn blank() -> Result<Bench, String> {
    let mut bench = new()?;
    bench.emulator.deliver()?;
    Ok(bench)
}

/// The commands, as they are begun; what they write goes to `out`.
fn commands(chip: &Emulated, out: &tempfile::TempDir) -> Vec<Command> {
    let probe = format!("--probe={}", chip.address);
    let folder = out.path().to_str().unwrap();
    let words: [(Command, Vec<&str>); 6] = [
        (board(), vec!["flash", &probe]),
        (board(), vec!["run", &probe]),
        (board(), vec!["bringup", &probe, "--out", folder]),
        (board(), vec!["attach", &probe]),
        (ddfeed(), vec!["drive", &probe, "status"]),
        (ddfeed(), vec!["record", &probe, folder, "--duration=1"]),
    ];
    words
        .into_iter()
        .map(|(mut command, words)| {
            command.args(words);
            command
        })
        .collect()
}

/// Each of the commands fails, and says `parts` in time.
#[track_caller]
fn each_says(chip: &Emulated, parts: &[&str]) {
    let out = tempfile::tempdir().unwrap();
    for command in &mut commands(chip, &out) {
        let mut running = Running::start(command);
        if command.get_program() == board().get_program() {
            running.until("Finished", WORK);
        }
        let began = Instant::now();
        let error = running.until("error: ", PATIENCE);
        assert!(!running.ended(PATIENCE));
        println!("{:.1} s: {error}", began.elapsed().as_secs_f64());
        for part in parts {
            assert!(
                error.contains(part),
                "`{part}` is not said by {command:?}: {error}"
            );
        }
    }
    let left = std::fs::read_dir(out.path()).unwrap().count();
    assert_eq!(left, 0, "nothing is written where nothing was read");
}

fn with_options(word: u32) -> Emulated {
    Emulated::start(HaltedTime::Running, move || {
        let mut bench = new()?;
        bench.emulator.chip().system.set_option_bytes(word);
        Ok(bench)
    })
}

#[test]
fn a_locked_chip_is_named_and_its_program_is_closed() {
    let chip = with_options(0xFAEF_FCBB);
    each_says(
        &chip,
        &["the chip is locked", "unlock it with STM32CubeProgrammer"],
    );
    // A debugger that does not ask first does not get it either.
    let mut bytes = [0; 4];
    let read = chip.ask(move |bench| bench.emulator.debugger_reads(BEGIN, &mut bytes));
    assert!(read.is_err_and(|error| error.contains("locked")));
    let ram = chip.ask(move |bench| bench.emulator.debugger_reads(0x2000_0000, &mut bytes));
    assert_eq!(ram, Ok(()));
    named("a locked chip");
}

#[test]
fn a_chip_that_was_locked_for_good_does_not_answer_and_only_another_helps() {
    let chip = with_options(0xFAEF_FCCC);
    each_says(&chip, &["no answer", "level 2", "only another chip helps"]);
    named("a chip locked for good");
}

#[test]
fn another_chip_is_named() {
    let chip = Emulated::start(HaltedTime::Running, || {
        let mut bench = new()?;
        bench.emulator.chip().system.set_identity(0x2001_0468);
        Ok(bench)
    });
    each_says(
        &chip,
        &["an STM32G431", "not the STM32G474RE", "is the probe on"],
    );
    named("another chip");
}

#[test]
fn a_second_session_is_turned_away_and_the_first_goes_on() {
    let chip = Emulated::start(HaltedTime::Running, new);
    let mut first = chip.attach().unwrap();
    each_says(
        &chip,
        &["is another debugger using it", "End the other session"],
    );
    first.core(0).unwrap().halt(PATIENCE).unwrap();
    named("two sessions");
}

#[test]
fn a_chip_without_firmware_is_to_be_flashed() {
    let chip = Emulated::start(HaltedTime::Running, blank);
    let out = tempfile::tempdir().unwrap();
    for command in &mut commands(&chip, &out)[3..] {
        let mut running = Running::start(command);
        let error = running.until("error: ", WORK);
        assert!(!running.ended(PATIENCE));
        assert!(
            error.contains("`cargo xtask flash`"),
            "{command:?}: {error}"
        );
    }
    named("no firmware");
}

#[test]
fn a_firmware_of_another_version_is_to_be_flashed_anew() {
    let chip = Emulated::start(HaltedTime::Running, ready);
    let other = (link::LAYOUT + 1).to_le_bytes();
    chip.ask(move |bench| {
        let view = bench.image.symbol(VIEW_SYMBOL)?;
        bench.emulator.debugger_writes(view + 4, &other)
    })
    .unwrap();
    let output = chip.command(board(), "attach").output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    println!("{said}");
    assert!(!output.status.success());
    assert!(said.contains("not the view of this firmware"), "{said}");
    assert!(said.contains("flash it first"), "{said}");
    named("another firmware");
}

#[test]
fn a_core_that_is_reset_under_a_recording_ends_it_and_what_came_is_kept() {
    let chip = Emulated::start(HaltedTime::Running, ready);
    let out = tempfile::tempdir().unwrap();
    let mut record = recording(&chip, &out);
    runs(&chip);
    rows_come(&chip);
    let request = 0x05FA_0004_u32.to_le_bytes();
    chip.ask(move |bench| bench.emulator.debugger_writes(0xE000_ED0C, &request))
        .unwrap();
    let began = Instant::now();
    record.until("error: ", PATIENCE);
    assert!(!record.ended(PATIENCE));
    println!("{:.1} s: {:#?}", began.elapsed().as_secs_f64(), record.said);
    named("a reset while recording");
}

/// Waits until the drive runs.
fn runs(chip: &Emulated) {
    let began = Instant::now();
    while chip.ask(|bench| bench.status()).unwrap().state != RUNNING {
        assert!(began.elapsed() < WORK, "the drive does not run");
    }
}

/// Waits until the program has read the drive's telemetry a few times: before its first row there is nothing to keep.
fn rows_come(chip: &Emulated) {
    // SEGGER RTT's control block: an identifier, two counts, then each channel, with how far it was read.
    let at = 24 + 24 * LINK_UP_CHANNEL as u32 + 16;
    let read = || {
        chip.ask(move |bench| {
            let mut bytes = [0; 4];
            let block = bench.image.symbol(RTT_SYMBOL)?;
            bench.emulator.debugger_reads(block + at, &mut bytes)?;
            Ok::<_, String>(u32::from_le_bytes(bytes))
        })
        .unwrap()
    };
    let began = Instant::now();
    let (mut last, mut reads) = (read(), 0);
    while reads < 3 {
        assert!(began.elapsed() < WORK, "no telemetry is read");
        let now = read();
        reads += u32::from(now != last);
        last = now;
    }
}

/// A recording of a drive that runs for long.
fn recording(chip: &Emulated, out: &tempfile::TempDir) -> Running {
    let mut record = chip.command(ddfeed(), "record");
    record.arg(out.path());
    record.args(["--arm", "--hold", "2.5,300,60"]);
    Running::start(&mut record)
}

#[test]
fn a_probe_that_disappears_ends_a_recording_and_what_came_is_kept() {
    let chip = Emulated::start(HaltedTime::Running, ready);
    let out = tempfile::tempdir().unwrap();
    let mut record = recording(&chip, &out);
    runs(&chip);
    rows_come(&chip);
    drop(chip);
    let began = Instant::now();
    record.until("error: ", PATIENCE);
    assert!(!record.ended(PATIENCE));
    println!("{:.1} s: {:#?}", began.elapsed().as_secs_f64(), record.said);
    let said = record.said.concat();
    assert!(said.contains("what came before is kept"), "{said}");
    assert!(said.contains("is the probe still connected"), "{said}");
    assert!(out.path().join("record.csv.gz").exists());
    named("a probe lost while recording");
}

#[test]
fn a_probe_that_disappears_ends_attach() {
    let chip = Emulated::start(HaltedTime::Running, ready);
    let mut attach = Running::start(&mut chip.command(board(), "attach"));
    attach.until("ready", WORK);
    drop(chip);
    let began = Instant::now();
    attach.until("is the probe still connected", PATIENCE);
    assert!(!attach.ended(PATIENCE));
    println!("after {:.1} s", began.elapsed().as_secs_f64());
    named("a probe lost while attached");
}

#[test]
fn a_flash_that_does_not_take_the_firmware_is_said() {
    let chip = Emulated::start(HaltedTime::Running, || {
        let mut bench = blank()?;
        bench.emulator.chip().faults.worn.protected = true;
        Ok(bench)
    });
    let mut flash = Running::start(&mut chip.command(board(), "flash"));
    flash.until("Finished", WORK);
    let said = flash.until("error: ", PATIENCE);
    assert!(!flash.ended(PATIENCE));
    assert!(said.contains("could not be written to the chip"), "{said}");
    assert!(said.contains("look for write protection"), "{said}");
    named("a flash that does not take the firmware");
}

#[test]
fn a_firmware_that_cannot_run_says_why_in_its_log() {
    let chip = Emulated::start(HaltedTime::Running, || {
        let mut bench = blank()?;
        bench.emulator.chip().system.crystal = false;
        Ok(bench)
    });
    let mut run = Running::start(&mut chip.command(board(), "run"));
    run.until("written and started", WORK);
    let said = run.until("the crystal does not start", PATIENCE);
    assert!(said.contains("check the board's"), "{said}");
    named("a firmware that cannot run");
}

#[test]
fn a_log_that_does_not_start_is_said() {
    let chip = Emulated::start(HaltedTime::Running, blank);
    let which = Which {
        probe: Some(chip.address.to_string()),
    };
    let image = Image::read(&firmware().unwrap()).unwrap();
    let began = Instant::now();
    let ended = listen(find(&which).unwrap(), &image, |_| Ok(()));
    let said = ended.unwrap_err().to_string();
    println!("{:.1} s: {said}", began.elapsed().as_secs_f64());
    assert!(began.elapsed() < PATIENCE);
    assert!(said.contains("the firmware does not run"), "{said}");
    assert!(said.contains("`cargo xtask bringup`"), "{said}");
    named("a log that does not start");
}
