//! The digital pins by their pull resistors.

use super::Item;
use link::bringup::{Owner, PinUse, PinWords, ReportWords, level};

const GROUP: &str = "Pins";
const SOURCE: &str =
    "DS12288, I/O static characteristics: pull resistors of 25 to 55 kohm; the board's plate";

/// How a pin behaves.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Behaviour {
    Follows,
    Low,
    High,
    Against,
}

impl Behaviour {
    fn of(pin: &PinWords) -> Self {
        let bit = |bit| pin.levels & bit != 0;
        match (bit(level::PULLED_UP), bit(level::PULLED_DOWN)) {
            (true, false) => Self::Follows,
            (false, false) => Self::Low,
            (true, true) => Self::High,
            (false, true) => Self::Against,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Follows => "follows its pull",
            Self::Low => "held low",
            Self::High => "held high",
            Self::Against => "changes by itself",
        }
    }
}

/// A pin's name on the chip.
fn name(pin: &PinWords) -> String {
    let port = char::from(b'A' + (pin.pin >> 8 & 7) as u8);
    format!("P{port}{}", pin.pin & 0xFF)
}

fn there(words: &ReportWords) -> impl Iterator<Item = (usize, &PinWords, PinUse, Owner)> + Clone {
    words.pins.iter().enumerate().filter_map(|(index, pin)| {
        Some((
            index,
            pin,
            PinUse::of_word(pin.function)?,
            Owner::of_word(pin.owner)?,
        ))
    })
}

pub(super) fn items(words: &ReportWords) -> Vec<Item> {
    there(words)
        .map(|(index, pin, function, owner)| {
            let followers = followers(words, index);
            item(words, pin, function, owner, &followers)
        })
        .collect()
}

/// The pins that go with a pin, whichever way it was seen.
fn followers(words: &ReportWords, index: usize) -> Vec<String> {
    let own = words.pins[index].raised | words.pins[index].lowered;
    there(words)
        .filter(|(other, pin, ..)| {
            let theirs = pin.raised | pin.lowered;
            own >> other & 1 != 0 || theirs >> index & 1 != 0
        })
        .filter(|(other, ..)| *other != index)
        .map(|(_, pin, ..)| name(pin))
        .collect()
}

fn is_gate(function: PinUse) -> bool {
    matches!(
        function,
        PinUse::HighA | PinUse::HighB | PinUse::HighC | PinUse::LowA | PinUse::LowB | PinUse::LowC
    )
}

fn item(
    words: &ReportWords,
    pin: &PinWords,
    function: PinUse,
    owner: Owner,
    followers: &[String],
) -> Item {
    let ohm = words.expected.gate_pull_down_ohm;
    let strong = is_gate(function) && ohm > 0;
    let (expected, good): (String, &[Behaviour]) = match function {
        _ if strong => (
            format!("held low by the stage's {} kohm", ohm / 1000),
            &[Behaviour::Low],
        ),
        _ if is_gate(function) => (
            "follows its pull, or low".into(),
            &[Behaviour::Follows, Behaviour::Low],
        ),
        PinUse::EncoderA | PinUse::EncoderB | PinUse::Index => (
            "held by the encoder, low or high".into(),
            &[Behaviour::Low, Behaviour::High],
        ),
        PinUse::Fault if pin.levels & level::IDLE_HIGH != 0 => (
            "not held at its fault level, low".into(),
            &[Behaviour::Follows, Behaviour::High],
        ),
        PinUse::Fault => (
            "not held at its fault level, high".into(),
            &[Behaviour::Follows, Behaviour::Low],
        ),
        PinUse::DataIn | PinUse::Select => (
            "follows its pull, or high".into(),
            &[Behaviour::Follows, Behaviour::High],
        ),
        _ => ("follows its pull".into(), &[Behaviour::Follows]),
    };
    let behaviour = Behaviour::of(pin);
    let item = Item::new(
        GROUP,
        format!("pin.{}", name(pin)),
        format!("{}: {}, {}", name(pin), owner.name(), function.name()),
        SOURCE,
    )
    .expected(format!("{expected}, alone"))
    .read(match followers {
        [] => behaviour.name().to_owned(),
        others => format!("{}, with {}", behaviour.name(), others.join(" and ")),
    });
    if let [_, ..] = followers {
        return item.finding(
            format!(
                "{} goes where this pin is pulled: the two are connected.",
                followers.join(" and ")
            ),
            "Do not switch the bus on. Look for a solder bridge between them, on the board, its connector and the cable.",
        );
    }
    if function == PinUse::Fault && !good.contains(&behaviour) && behaviour != Behaviour::Against {
        return item.open(
            "The fault line is at its fault level. Many drivers hold it there while they sleep or have no supply; a short \
             looks the same.",
            "With the bus on and the drivers awake it must be gone: `cargo xtask attach` shows no driver fault.",
        );
    }
    if !good.contains(&behaviour) {
        let (means, todo) = against(function, strong, behaviour);
        return item.finding(means, todo);
    }
    if pin.levels & level::DRIVEN != 0 && pin.levels & level::DRIVEN_HIGH != 0 {
        return item.finding(
            "The timer drives the pin to its idle level, low, and it reads high: the pin is not in the timer's function, \
             or is shorted.",
            "Do not switch the bus on. Measure the pin; it must be below 0.4 V.",
        );
    }
    item
}

/// What it means that a pin behaves as it should not.
fn against(function: PinUse, strong: bool, behaviour: Behaviour) -> (&'static str, &'static str) {
    let gate = is_gate(function);
    match behaviour {
        Behaviour::High if gate => (
            "The gate driver's input is held high: the transistor would be on as soon as the driver has its supply. The \
             pin is shorted to the supply or to something that drives it.",
            "Do not switch the bus on. Look for the short with an ohmmeter, board off.",
        ),
        Behaviour::Follows if strong => (
            "Nothing holds the gate driver's input low: its pull-down is missing, or the wire to the power stage is open. \
             While the chip starts, the input floats.",
            "Check the wire; fit a resistor of the plate's value from the driver's input to ground.",
        ),
        Behaviour::Follows => (
            "Nothing drives the pin: the encoder is not connected, has no supply, or has open outputs without pull-up \
             resistors.",
            "Check plug, supply and ground of the encoder; give open outputs 1 to 4.7 kohm to 3.3 V.",
        ),
        Behaviour::Low => (
            "The pin is held low: it is shorted to ground, or something else drives it.",
            "Look for the short with an ohmmeter, board off.",
        ),
        Behaviour::High => (
            "The pin is held high: it is shorted to the supply, or something else drives it.",
            "Look for the short with an ohmmeter, board off.",
        ),
        Behaviour::Against => (
            "The pin changes while it is looked at: something drives it, or it is a long open wire.",
            "Run again with all shafts at rest; then disconnect what is on the pin.",
        ),
    }
}
