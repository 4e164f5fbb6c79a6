//! The wiring page of the default board against sources that are not ours: where the Nucleo's connectors have a pin, and
//! what the chip's database says that the pin can be. That the firmware puts the pins in these functions is tested with the
//! emulated chip, in `tests/tests/chip/wiring.rs`.

use std::collections::HashSet;
use std::path::PathBuf;
use stm32_metapac::metadata::METADATA;
use xtask::wiring::{Row, committed, drawing, rows};

/// The morpho connectors of a NUCLEO-G474RE, from Zephyr's `boards/st/nucleo_g474re/st_morpho_connector.dtsi` (commit
/// e0513a2): connector (7 is its left one), place, pin.
const MORPHO: [(u8, u8, &str); 50] = [
    (7, 1, "PC10"),
    (7, 2, "PC11"),
    (7, 3, "PC12"),
    (7, 4, "PD2"),
    (7, 13, "PA13"),
    (7, 15, "PA14"),
    (7, 17, "PA15"),
    (7, 21, "PB7"),
    (7, 23, "PC13"),
    (7, 25, "PC14"),
    (7, 27, "PC15"),
    (7, 28, "PA0"),
    (7, 29, "PF0"),
    (7, 30, "PA1"),
    (7, 31, "PF1"),
    (7, 32, "PA4"),
    (7, 34, "PB0"),
    (7, 35, "PC2"),
    (7, 36, "PC1"),
    (7, 37, "PC3"),
    (7, 38, "PC0"),
    (10, 1, "PC9"),
    (10, 2, "PC8"),
    (10, 3, "PB8"),
    (10, 4, "PC6"),
    (10, 5, "PB9"),
    (10, 6, "PC5"),
    (10, 11, "PA5"),
    (10, 12, "PA12"),
    (10, 13, "PA6"),
    (10, 14, "PA11"),
    (10, 15, "PA7"),
    (10, 16, "PB12"),
    (10, 17, "PB6"),
    (10, 18, "PB11"),
    (10, 19, "PC7"),
    (10, 21, "PA9"),
    (10, 22, "PB2"),
    (10, 23, "PA8"),
    (10, 24, "PB1"),
    (10, 25, "PB10"),
    (10, 26, "PB15"),
    (10, 27, "PB4"),
    (10, 28, "PB14"),
    (10, 29, "PB5"),
    (10, 30, "PB13"),
    (10, 31, "PB3"),
    (10, 33, "PA10"),
    (10, 34, "PC4"),
    (10, 35, "PA2"),
];

/// Its Arduino connectors, from `arduino_r3_connector.dtsi` beside it (commit 0225b4d).
const ARDUINO: [(&str, &str); 22] = [
    ("A0", "PA0"),
    ("A1", "PA1"),
    ("A2", "PA4"),
    ("A3", "PB0"),
    ("A4", "PC1"),
    ("A5", "PC0"),
    ("D0", "PC5"),
    ("D1", "PC4"),
    ("D2", "PA10"),
    ("D3", "PB3"),
    ("D4", "PB5"),
    ("D5", "PB4"),
    ("D6", "PB10"),
    ("D7", "PA8"),
    ("D8", "PA9"),
    ("D9", "PC7"),
    ("D10", "PB6"),
    ("D11", "PA7"),
    ("D12", "PA6"),
    ("D13", "PA5"),
    ("D14", "PB9"),
    ("D15", "PB8"),
];

/// What the Nucleo uses itself: the ST-LINK's serial port and debugger, LED, button, crystals, BOOT0.
const TAKEN: [&str; 12] = [
    "PA2", "PA3", "PA5", "PA13", "PA14", "PB8", "PC13", "PC14", "PC15", "PF0", "PF1", "PG10",
];

fn root() -> PathBuf {
    xtask::tools::root().unwrap()
}

fn table() -> Vec<Row> {
    rows(&root()).unwrap_or_else(|error| panic!("{error:#}"))
}

#[test]
fn each_pin_is_where_the_connectors_have_it() {
    for row in table() {
        let header = MORPHO
            .iter()
            .find(|(_, _, pin)| *pin == row.pin)
            .map(|(connector, place, _)| format!("CN{connector}-{place}"));
        assert_eq!(
            Some(&row.header),
            header.as_ref(),
            "{}: its header",
            row.pin
        );
        let arduino = ARDUINO.iter().find(|(_, pin)| *pin == row.pin);
        let arduino = arduino.map_or("", |(name, _)| name);
        assert_eq!(row.arduino, arduino, "{}: its Arduino name", row.pin);
    }
}

#[test]
fn each_pin_can_be_what_the_table_says() {
    for row in table() {
        for function in &row.functions {
            let Some((peripheral, signal)) = function.split_once('_') else {
                assert!(
                    ["GPIO output", "GPIO input"].contains(&function.as_str()),
                    "{}: {function} is no function of a chip",
                    row.pin
                );
                continue;
            };
            let known = METADATA
                .peripherals
                .iter()
                .filter(|known| known.name == peripheral)
                .flat_map(|known| known.pins)
                .any(|known| known.pin == row.pin && known.signal == signal);
            assert!(known, "{} cannot be {function} by ST's database", row.pin);
        }
    }
}

#[test]
fn no_pin_or_line_is_wired_twice_and_none_that_the_nucleo_needs() {
    let rows = table();
    let pins: HashSet<_> = rows.iter().map(|row| &row.pin).collect();
    assert_eq!(pins.len(), rows.len(), "a pin stands in two rows");
    let lines: HashSet<_> = rows.iter().map(|row| (&row.at, &row.line)).collect();
    assert_eq!(lines.len(), rows.len(), "a line goes to two pins");
    for row in &rows {
        assert!(
            !TAKEN.contains(&row.pin.as_str()),
            "{} is the Nucleo's",
            row.pin
        );
    }
    // Both stages have the same lines.
    let of = |stage: &str| -> HashSet<String> {
        let rows = rows.iter().filter(|row| row.at == stage);
        rows.map(|row| row.line.clone()).collect()
    };
    assert_eq!(of("screw stage"), of("nut stage"));
}

#[test]
fn the_drawing_is_that_of_the_table() {
    let committed = committed(&root()).unwrap_or_else(|error| panic!("{error:#}"));
    assert!(
        committed == drawing(&table()),
        "the drawing is not the table's: run `cargo xtask wiring`"
    );
}
