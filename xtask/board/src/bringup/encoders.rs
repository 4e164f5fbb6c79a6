//! The motors' encoders.

use super::Item;
use link::bringup::{EncoderKind, EncoderWords, ReportWords};

const GROUP: &str = "Encoders";
/// Bits of an MT6835's status: its datasheet, register 0x005.
const STATUS: [&str; 3] = [
    "the shaft turns too fast",
    "the magnet's field is too weak",
    "its supply is too low",
];

pub(super) fn items(words: &ReportWords) -> Vec<Item> {
    words
        .encoders
        .iter()
        .zip(["screw", "nut"])
        .filter_map(|(encoder, name)| {
            let kind = EncoderKind::of_word(encoder.kind)?;
            let item = Item::new(
                GROUP,
                format!("encoder.{name}"),
                format!("{name}: {}", kind.name()),
                match kind {
                    EncoderKind::Mt6835 => "MT6835 datasheet, SPI: check and status in each frame",
                    _ => "RM0440 30.4.17 (index), 30.6.4 (TERRF: both channels at once)",
                },
            );
            Some(match kind {
                EncoderKind::Mt6835 => frames(item, encoder),
                _ => edges(item, encoder, kind),
            })
        })
        .collect()
}

fn turns(encoder: &EncoderWords) -> f64 {
    f64::from(encoder.most - encoder.least) / f64::from(encoder.counts_per_turn.max(1))
}

fn no_looks(item: Item) -> Item {
    item.read("nothing").finding(
        "The PWM timers do not run, and they are what an encoder is read by.",
        "See clock and breaks.",
    )
}

fn frames(item: Item, encoder: &EncoderWords) -> Item {
    let item = item.expected("a right frame each PWM period");
    if encoder.looks == 0 {
        return no_looks(item);
    }
    let bad = encoder.bad_checks + encoder.bad_status;
    let share = 100.0 * f64::from(bad) / f64::from(encoder.looks);
    let right = encoder.looks - bad.min(encoder.looks);
    if right == 0 && encoder.bad_frame == u32::MAX {
        return item.read("no frame: the line is high").finding(
            "The sensor does not answer: it has no supply, its data wire is open, or its chip select does not reach it.",
            "Measure the sensor's supply; look at clock, select and data with an oscilloscope at the sensor.",
        );
    }
    // A line that is held low passes the check, and so does memory that nothing is written to.
    if right > 0 && encoder.first == 0 && encoder.changes == 0 {
        return item.read("no frame: all zeros").finding(
            "All bits are zero, always: the data line is shorted to ground, or no frame reaches the memory. (Zeros pass the \
             frame's check.)",
            "Look at the data wire with an oscilloscope; see its pin.",
        );
    }
    let item = item.read(format!(
        "{} frames, {} wrong ({share:.1} %), moved {:.2} turns",
        encoder.looks,
        bad,
        turns(encoder)
    ));
    if encoder.bad_status > 0 {
        let said: Vec<&str> = STATUS
            .iter()
            .enumerate()
            .filter(|(bit, _)| encoder.status >> bit & 1 != 0)
            .map(|(_, name)| *name)
            .collect();
        return item.finding(
            format!(
                "The sensor itself says that its angle is not to be trusted: {}.",
                said.join(", ")
            ),
            "Check the magnet's distance and the sensor's supply.",
        );
    }
    if encoder.bad_checks > 0 {
        return item.finding(
            "Frames arrive damaged: the drive bridges one in sixteen, but with the bus off none should be.",
            "Shorten or shield the sensor's cable; check its ground; series resistors of 33 ohm at clock and data help.",
        );
    }
    item
}

fn edges(item: Item, encoder: &EncoderWords, kind: EncoderKind) -> Item {
    let item = item.expected("counts as far as the shaft is turned, no lost edge");
    if encoder.looks == 0 {
        return no_looks(item);
    }
    let indices = match kind {
        EncoderKind::IncrementalWithIndex => format!(", index {} times", encoder.indices),
        _ => String::new(),
    };
    let item = item.read(format!(
        "moved {} counts ({:.2} turns){indices}, {} lost edges",
        encoder.most - encoder.least,
        turns(encoder),
        encoder.transition_errors
    ));
    if encoder.transition_errors > 0 {
        return item.finding(
            "Both channels changed together: an edge was lost, or is noise. The angle drifts with each.",
            "Check shield, ground and termination of the encoder's cable, and the input filter.",
        );
    }
    let moved = encoder.most - encoder.least;
    if moved == 0 {
        return item.open(
            "The shaft was not turned, or the encoder does not count: at rest the two look alike.",
            "`cargo xtask bringup --turn 10`, and turn the shaft by hand, a turn or more each way.",
        );
    }
    if moved == 1 && encoder.changes > 2 {
        return item.finding(
            "The count goes to and fro by one: one channel changes and the other does not.",
            "Check the two channels' wires: one is open or shorted.",
        );
    }
    if kind == EncoderKind::IncrementalWithIndex && encoder.indices == 0 && turns(encoder) > 1.1 {
        return item.finding(
            "The shaft was turned by more than a turn, and the index did not come.",
            "Check the index's wire and polarity.",
        );
    }
    item
}
