//! What goes wrong between debugger and chip: each is said in a sentence, in time.

use crate::emulated::Emulated;
use anyhow::Result;
use board::flash::flash;
use ddfeed::probe::{find, memory};
use ddfeed::session::Which;
use link::host::Memory;
use plant::machine::Coupling;
use plant::model::Model;
use std::time::{Duration, Instant};
use tests::bench::{Bench, firmware};
use tests::emulator::HaltedTime;

/// No failure takes longer to be said.
const PATIENCE: Duration = Duration::from_secs(8);

fn new() -> Result<Bench, String> {
    Bench::new(&Model::paper(), Coupling::Lumped)
}

fn with_options(word: u32) -> Emulated {
    Emulated::start(HaltedTime::Running, move || {
        let mut bench = new()?;
        bench.emulator.chip().system.set_option_bytes(word);
        Ok(bench)
    })
}

fn which(chip: &Emulated) -> Which {
    Which {
        probe: Some(chip.address.to_string()),
    }
}

/// Reads a word of the chip, as the commands begin: what is said.
fn reached(chip: &Emulated) -> Result<[u32; 1]> {
    let probe = find(&which(chip))?;
    let work = |mut target: memory::Target<'_>, _: &dyn Fn(())| target.words(0x0800_0000);
    memory::with_chip(probe, work, |()| Ok(()))
}

fn assert_said(what: Result<[u32; 1]>, began: Instant, expected: &str) {
    let error = format!("{:#}", what.unwrap_err());
    let took = began.elapsed();
    println!("after {:.1} s: {error}", took.as_secs_f64());
    assert!(error.contains(expected), "{error}");
    assert!(took < PATIENCE, "{took:?}: {error}");
}

#[test]
fn a_locked_chip_is_named_and_its_program_is_closed() {
    let chip = with_options(0xFAEF_FCBB);
    let began = Instant::now();
    assert_said(reached(&chip), began, "the chip is locked");
    // A debugger that does not ask first does not get it either.
    let mut bytes = [0; 4];
    let read = chip.ask(move |bench| bench.emulator.debugger_reads(0x0800_0000, &mut bytes));
    assert!(read.is_err_and(|error| error.contains("locked")));
    let ram = chip.ask(move |bench| bench.emulator.debugger_reads(0x2000_0000, &mut bytes));
    assert_eq!(ram, Ok(()));
}

#[test]
fn a_chip_that_lets_nobody_in_does_not_answer() {
    let chip = with_options(0xFAEF_FCCC);
    let began = Instant::now();
    assert_said(reached(&chip), began, "no answer");
}

#[test]
fn a_second_session_is_turned_away_and_the_first_goes_on() {
    let chip = Emulated::start(HaltedTime::Running, new);
    let mut first = chip.attach().unwrap();
    let began = Instant::now();
    assert_said(reached(&chip), began, "is another debugger using it");
    first.core(0).unwrap().halt(PATIENCE).unwrap();
    drop(first);
    reached(&chip).unwrap();
}

#[test]
fn a_probe_that_disappears_ends_the_session() {
    let chip = Emulated::start(HaltedTime::Running, new);
    let probe = find(&which(&chip)).unwrap();
    let mut chip = Some(chip);
    let mut began = Instant::now();
    let ended = memory::with_chip(
        probe,
        |mut target: memory::Target<'_>, say: &dyn Fn(())| loop {
            target.words::<1>(0x2000_0000)?;
            say(());
        },
        |()| {
            if chip.take().is_some() {
                began = Instant::now();
            }
            Ok(())
        },
    );
    assert_said(ended, began, "cannot be read");
}

#[test]
fn a_flash_that_does_not_take_the_firmware_is_said() {
    let chip = Emulated::start(HaltedTime::Running, || {
        let mut bench = new()?;
        bench.emulator.deliver()?;
        bench.emulator.chip().faults.worn.protected = true;
        Ok(bench)
    });
    let began = Instant::now();
    let written = flash(find(&which(&chip)).unwrap(), &firmware().unwrap());
    assert_said(
        written.map(|()| [0]),
        began,
        "could not be written to the chip",
    );
}
