//! The flash's reserved page, and the stream through the probe.

use super::Item;
use link::bringup::{FLASH_DOUBLE_WORDS, ReportWords, flash};
use link::host::bringup::Readings;

const GROUP: &str = "Flash and probe";

/// Longest erase of a page, s, and programming of a double word, s (DS12288, flash memory characteristics; memory: 24.5 ms
/// and 85 us, taken generously).
const ERASE_S: f64 = 0.030;
const PROGRAM_S: f64 = 125e-6;
/// Bytes of a telemetry row as it is sent, and rows a second (`docs/firmware.md`, `ddfeed record`).
const ROW_BYTES: f64 = 46.6;
const ROWS: [u32; 4] = [5000, 2500, 1000, 500];

/// Errors of FLASH_SR (RM0440 5.7.5).
const ERRORS: [(u32, &str); 9] = [
    (3, "PROGERR: the double word was not erased"),
    (4, "WRPERR: the page is write-protected"),
    (5, "PGAERR: not aligned"),
    (6, "SIZERR: not by words"),
    (7, "PGSERR: wrong order"),
    (8, "MISERR: too late"),
    (9, "FASTERR"),
    (14, "RDERR: the page may not be read"),
    (15, "OPTVERR: option bytes were not loaded"),
];

pub(super) fn items(readings: &Readings) -> Vec<Item> {
    let mut items = vec![page(&readings.report)];
    items.extend(stream(readings));
    items
}

fn page(words: &ReportWords) -> Item {
    let (page, hz) = (&words.flash, f64::from(words.expected.core_hz.max(1)));
    let item = Item::new(
        GROUP,
        "flash.page",
        format!("the reserved page at {:#010x}", page.address),
        "RM0440 5.3.6, 5.3.7; times: DS12288, flash memory characteristics",
    )
    .expected(format!(
        "erased in {:.0} ms, {FLASH_DOUBLE_WORDS} double words right, {:.0} us each, at most",
        1e3 * ERASE_S,
        1e6 * PROGRAM_S
    ));
    if page.done & flash::WAS_OURS == 0 {
        return item.read("holds something else").finding(
            "The page is neither erased nor of an earlier bring-up: something else keeps data there. It was left alone.",
            "Find out what; to free it, erase the chip (`probe-rs erase --chip STM32G474RETx`) and flash again.",
        );
    }
    let erase = f64::from(page.erase) / hz;
    let program = f64::from(page.program) / hz / f64::from(FLASH_DOUBLE_WORDS);
    let item = item.read(format!(
        "{:.1} ms, {} right, {:.0} us each",
        1e3 * erase,
        page.right,
        1e6 * program
    ));
    let said: Vec<&str> = ERRORS
        .iter()
        .filter(|(bit, _)| (page.status[0] | page.status[1]) >> bit & 1 != 0)
        .map(|(_, name)| *name)
        .collect();
    let said = match &said[..] {
        [] => "it reports no error".to_owned(),
        all => all.join("; "),
    };
    if page.done & flash::ERASED == 0 {
        return item.finding(
            format!("The page does not erase ({said})."),
            "Check the option bytes for write protection (WRP2AR, WRP2BR); else the flash is worn out: another chip.",
        );
    }
    if page.right < FLASH_DOUBLE_WORDS {
        return item.finding(
            format!(
                "{} of {FLASH_DOUBLE_WORDS} double words do not read back as written ({said}).",
                FLASH_DOUBLE_WORDS - page.right
            ),
            "The flash is worn out or its supply too low while it programs: measure 3.3 V; else another chip.",
        );
    }
    if erase > ERASE_S || program > PROGRAM_S {
        return item.finding(
            "The flash takes longer than it should: it ages, or the clock is wrong.",
            "See the clock; else expect settings to take longer to store.",
        );
    }
    item
}

fn stream(readings: &Readings) -> Option<Item> {
    let stream = readings.stream?;
    let rate = f64::from(stream.bytes) / stream.seconds.max(1e-9);
    let full = f64::from(ROWS[0]) * ROW_BYTES;
    let item = Item::new(
        GROUP,
        "probe.rate",
        "stream through RTT",
        "docs/firmware.md: `ddfeed record` takes 5000 rows a second of 46.6 bytes",
    )
    .expected(format!("at least {:.0} kB/s, no byte wrong", full / 1e3))
    .read(format!(
        "{:.0} kB/s, {} bytes wrong",
        rate / 1e3,
        stream.wrong
    ));
    if stream.wrong > 0 {
        return Some(item.finding(
            "Bytes arrive wrong: a recording through this probe would be damaged.",
            "A shorter cable to the probe, or a slower wire; another probe.",
        ));
    }
    if rate >= full {
        return Some(item);
    }
    let fits = ROWS
        .iter()
        .find(|rows| f64::from(**rows) * ROW_BYTES <= rate);
    Some(item.finding(
        "The probe is slower than a recording at the full rate.",
        match fits {
            Some(rows) => {
                format!("Record with `--rate {rows}`, or take a faster probe (an ST-LINK V3).")
            }
            None => "Take a faster probe (an ST-LINK V3).".into(),
        },
    ))
}
