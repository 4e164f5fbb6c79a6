//! A flashing that ends in the middle.

use crate::emulated::Emulated;
use crate::figures::named;
use crate::program::{Running, board};
use link::codes::State;
use plant::machine::Coupling;
use plant::model::Model;
use std::time::{Duration, Instant};
use tests::bench::{Bench, READY};
use tests::chip::flash::BEGIN;
use tests::emulator::HaltedTime;

/// The failure takes no longer to be said.
const PATIENCE: Duration = Duration::from_secs(8);
/// How long a build and a flashing may take.
const WORK: Duration = Duration::from_secs(60);

/// Where the flash's algorithm is when the probe is pulled.
#[derive(Clone, Copy, Debug)]
enum Pulled {
    /// The first page is erased.
    Erasing,
    /// Some of the program is written.
    Writing,
    /// All is written but the first page.
    AllButFirst,
}

#[test]
fn an_image_that_was_written_in_part_never_starts_until_it_is_written_whole() {
    for pulled in [Pulled::Erasing, Pulled::Writing, Pulled::AllButFirst] {
        let chip = Emulated::start(HaltedTime::Running, move || {
            let mut bench = Bench::new(&Model::paper(), Coupling::Lumped)?;
            bench.wait_for(READY, 0.2)?;
            if matches!(pulled, Pulled::AllButFirst) {
                bench.emulator.deliver()?;
            }
            Ok(bench)
        });
        let mut flash = chip.command(board(), "flash");
        let mut first = Running::start(&mut flash);
        let end = chip.ask(|bench| {
            let segments = &bench.image.segments;
            segments
                .iter()
                .map(|(start, bytes)| start + bytes.len() as u32)
                .max()
                .unwrap()
        });
        let began = Instant::now();
        loop {
            let [start, middle, last] = chip.ask(move |bench| {
                [BEGIN, BEGIN + 0x8000, end - 0x400]
                    .map(|place| bench.emulator.bytes(place, 8) != Ok(vec![0xFF; 8]))
            });
            let there = match pulled {
                Pulled::Erasing => !start,
                Pulled::Writing => !start && middle && !last,
                Pulled::AllButFirst => !start && last,
            };
            if there {
                break;
            }
            assert!(
                began.elapsed() < WORK,
                "{pulled:?} did not come: {start} {middle} {last}"
            );
        }
        chip.ask_all(|served| served.server.hang_up());
        let began = Instant::now();
        first.until("error: ", PATIENCE);
        assert!(!first.ended(PATIENCE));
        println!(
            "{pulled:?}, {:.1} s: {:#?}",
            began.elapsed().as_secs_f64(),
            first.said
        );
        let said = first.said.concat();
        assert!(!said.contains("written and started"), "{said}");
        assert!(
            said.contains("incomplete, and does not start: flash it again"),
            "{said}"
        );
        // Power off and on: nothing of it runs.
        let times = chip.ask(|bench| {
            let time = |bench: &mut Bench| bench.look().map(|view| view.words().uptime_ms);
            bench.emulator.cycle_power()?;
            let before = time(bench)?;
            bench.pass(20e-3)?;
            Ok::<_, String>([before, time(bench)?])
        });
        let [before, after] = times.unwrap();
        assert_eq!(before, after, "{pulled:?}: half an image runs");
        // The residual in RAM of the firmware before it is no drive that runs.
        Running::start(&mut chip.command(board(), "attach")).until("no firmware runs", WORK);
        // Whole, it does.
        assert!(Running::start(&mut flash).ended(WORK));
        assert_eq!(
            chip.ask(|bench| bench.wait_for(State::Unaligned.word(), 0.5)),
            Ok(())
        );
    }
    named("an image written in part");
}
