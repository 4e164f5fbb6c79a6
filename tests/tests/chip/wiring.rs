//! The pins that the firmware claims are those of the default board's wiring page, in the functions that it names. What the
//! page says of connectors and chip is tested in `xtask/tests/wiring.rs`.

use link::codes::Demand;
use plant::machine::Coupling;
use plant::model::Model;
use std::path::Path;
use stm32_metapac::metadata::METADATA;
use tests::bench::{Bench, READY};
use tests::chip::outside::Circuit;
use xtask::wiring::{Row, rows};

const INPUT: u32 = 0;
const OUTPUT: u32 = 1;
const ALTERNATE: u32 = 2;
const ANALOG: u32 = 3;

/// The debugger's, in their functions from reset on, and its serial port.
const DEBUGGER: [&str; 4] = ["PA13", "PA14", "PA2", "PA3"];

/// Mode and alternate function that a row of the page asks for, by ST's database.
fn asked(row: &Row) -> (u32, u32) {
    let Some((peripheral, signal)) = row.functions[0].split_once('_') else {
        return match row.functions[0].as_str() {
            "GPIO input" => (INPUT, 0),
            _ => (OUTPUT, 0),
        };
    };
    let pin = METADATA
        .peripherals
        .iter()
        .filter(|known| known.name == peripheral)
        .flat_map(|known| known.pins)
        .find(|known| known.pin == row.pin && known.signal == signal)
        .unwrap_or_else(|| panic!("{} cannot be {}", row.pin, row.functions[0]));
    match pin.af {
        Some(function) => (ALTERNATE, u32::from(function)),
        None => (ANALOG, 0),
    }
}

#[test]
fn the_firmware_claims_the_pins_of_the_wiring_page_and_no_others() -> Result<(), String> {
    let root = Path::new("..");
    let rows = rows(root).map_err(|error| format!("{error:#}"))?;
    let mut bench = Bench::new(&Model::paper(), Coupling::Lumped)?;
    let system = |bench: &mut Bench, port: usize, pin: u32| {
        bench.emulator.chip().system.pin_function(port, pin)
    };
    let all: Vec<(usize, u32)> = (0..4)
        .flat_map(|port| (0..16).map(move |pin| (port, pin)))
        .collect();
    let before: Vec<_> = all
        .iter()
        .map(|&(port, pin)| system(&mut bench, port, pin))
        .collect();
    bench.wait_for(READY, 0.2)?;
    for (&(port, pin), before) in all.iter().zip(before) {
        let name = format!("P{}{pin}", ['A', 'B', 'C', 'D'][port]);
        let (mode, function) = system(&mut bench, port, pin);
        let row = rows.iter().find(|row| row.pin == name);
        match row {
            Some(row) => {
                let now = (mode, if mode == ALTERNATE { function } else { 0 });
                assert_eq!(
                    now,
                    asked(row),
                    "{name} is {} on the wiring page",
                    row.functions.join(", ")
                );
            }
            // Analog is what the chip's pins are from reset on, but for the debugger's.
            None => assert!(
                (mode, function) == before && mode != INPUT && mode != OUTPUT
                    || DEBUGGER.contains(&name.as_str()),
                "{name} is claimed, in mode {mode} with function {function}, and not on the wiring page"
            ),
        }
    }
    Ok(())
}

/// The chip pulls PB6 down with 5.1 kohm while PA9 is high (RM0440 6.4.3, UCPD1_DBDIS): a scale whose output has a pull-up
/// of 10 kohm instead of a driver would read low with each pulse of the screw's phase b.
#[test]
fn the_scale_is_not_loaded_by_the_bridges_pulses() -> Result<(), String> {
    const PB6: (usize, u32) = (1, 6);
    const PA9: (usize, u32) = (0, 9);
    let mut bench = Bench::new(&Model::paper(), Coupling::Lumped)?;
    let outside = &mut bench.emulator.chip().outside;
    outside.circuits.insert(PB6, Circuit::PullUp(10e3));
    bench.wait_for(READY, 0.2)?;
    bench.demand(Demand::Run)?;
    bench.pass(10e-3)?;
    let mut pulses = 0;
    for _ in 0..200 {
        bench.pass(0.7e-6)?;
        let chip = bench.emulator.chip();
        pulses += u32::from(chip.level(PA9));
        assert!(
            chip.level(PB6),
            "PB6, which a scale holds high through 10 kohm, reads low while PA9 is {}",
            if chip.level(PA9) { "high" } else { "low" }
        );
    }
    assert!(
        (20..180).contains(&pulses),
        "PA9 was high in {pulses} of 200 looks, expected about half"
    );
    Ok(())
}
