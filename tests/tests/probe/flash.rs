//! The firmware written to the chip by the target's own algorithm, started, and its log.

use crate::emulated::Emulated;
use crate::figures::keep;
use anyhow::bail;
use board::flash::{flash, listen};
use ddfeed::probe::{Image, find};
use ddfeed::session::Which;
use plant::machine::Coupling;
use plant::model::Model;
use std::time::Instant;
use tests::bench::{Bench, READY, firmware};
use tests::emulator::HaltedTime;

fn new() -> Result<Bench, String> {
    Bench::new(&Model::paper(), Coupling::Lumped)
}

/// As it is shipped.
fn blank() -> Result<Bench, String> {
    let mut bench = new()?;
    bench.emulator.deliver()?;
    Ok(bench)
}

fn which(chip: &Emulated) -> Which {
    Which {
        probe: Some(chip.address.to_string()),
    }
}

#[test]
fn a_blank_chip_is_flashed_by_the_targets_own_algorithm_and_starts() {
    let chip = Emulated::start(HaltedTime::Running, blank);
    let elf = firmware().unwrap();
    let began = Instant::now();
    flash(find(&which(&chip)).unwrap(), &Image::read(&elf).unwrap()).unwrap();
    keep("flash_s", began.elapsed().as_secs_f64());
    // What is there is what the file has.
    let segments = chip.ask(|bench| bench.image.segments.clone());
    for (start, bytes) in segments {
        let size = bytes.len();
        let there = chip.ask(move |bench| bench.emulator.bytes(start, size));
        assert!(there == Ok(bytes), "{size} bytes at {start:#010x} differ");
    }
    assert_eq!(chip.ask(|bench| bench.wait_for(READY, 0.5)), Ok(()));
    let refused = chip.ask_all(|served| served.server.refused.clone());
    assert_eq!(refused, [""; 0]);
}

#[test]
fn the_log_at_the_probe_is_the_chips() {
    let mut alone = new().unwrap();
    alone.wait_for(READY, 0.5).unwrap();
    let truth = alone.log().unwrap();
    assert!(
        !truth.is_empty(),
        "the firmware says nothing when it starts"
    );
    let wanted = truth.len();
    let chip = Emulated::start(HaltedTime::Running, new);
    let image = Image::read(&firmware().unwrap()).unwrap();
    let began = Instant::now();
    let mut lines = Vec::new();
    let ended = listen(find(&which(&chip)).unwrap(), &image, |line| {
        lines.push(line.message);
        if lines.len() == wanted {
            bail!("enough")
        }
        Ok(())
    });
    assert_eq!(ended.unwrap_err().to_string(), "enough");
    println!("{wanted} lines in {:.1} s", began.elapsed().as_secs_f64());
    assert_eq!(lines, truth);
}
