//! Comparators, their DACs, and the timers' breaks.

use super::Item;
use super::analog::{PHASES, amplifiers_work, level};
use link::bringup::{
    BreakSource, BreakWords, ComparatorWords, Owner, PinUse, ReportWords, Signal,
    level as pin_level, seen,
};

const COMPARATORS: &str = "Comparators";
const BREAKS: &str = "Breaks";

/// The reference, V.
const REFERENCE_V: f64 = 3.3;
/// How far a comparator may trip from its pin's level, V: its offset of some 10 mV, half its hysteresis, the DAC's offset
/// without buffer, and a step of the sweep (DS12288, comparator and DAC characteristics; memory).
const OFF_V: f64 = 0.035;
/// No change.
const NONE: u32 = 4096;

/// The DAC at each comparator's inverting input 4 (RM0440 24.3.2, table 199).
const DACS: [&str; 7] = [
    "DAC3 channel 1",
    "DAC3 channel 2",
    "DAC3 channel 1",
    "DAC3 channel 2",
    "DAC4 channel 1",
    "DAC4 channel 2",
    "DAC4 channel 1",
];

fn dac(comparator: &ComparatorWords) -> &'static str {
    DACS[(comparator.number as usize - 1) % DACS.len()]
}

/// Those whose amplifiers work: at 0 V a comparator does not trip.
fn comparators(words: &ReportWords) -> impl Iterator<Item = &ComparatorWords> + Clone {
    let work = [0, 1].map(|motor| amplifiers_work(words, motor));
    words.comparators.iter().filter(move |comparator| {
        let of_screw = PHASES[0].map(Signal::word).contains(&comparator.signal);
        (1..=7).contains(&comparator.number) && work[usize::from(!of_screw)]
    })
}

/// Comparators and their DACs.
pub(super) fn comparator_items(words: &ReportWords) -> Vec<Item> {
    let mut items: Vec<Item> = Vec::new();
    let mut dacs: Vec<&str> = comparators(words).map(dac).collect();
    dacs.sort_unstable();
    dacs.dedup();
    let dead: Vec<&str> = dacs
        .iter()
        .copied()
        .filter(|name| {
            comparators(words)
                .filter(|comparator| dac(comparator) == *name)
                .all(|comparator| comparator.changes == 0)
        })
        .collect();
    items.extend(dacs.iter().map(|name| converter(words, name, &dead)));
    items.extend(comparators(words).map(|one| comparator(words, one, &dead)));
    if [0, 1].iter().any(|motor| !amplifiers_work(words, *motor)) {
        let item = Item::new(
            COMPARATORS,
            "comparators",
            "comparators of amplifiers that sleep",
            "the board's AMPLIFIERS_SLEEP",
        )
        .expected("asleep: 0 V")
        .read("asleep");
        items.push(item.open(
            "At 0 V a comparator does not trip.",
            "`cargo xtask bringup --powered` asks those whose driver wakes.",
        ));
    }
    items
}

/// Comparators, their DACs, and the breaks.
pub(super) fn items(words: &ReportWords) -> Vec<Item> {
    let mut items = comparator_items(words);
    let asked = words.breaks.iter().filter_map(|one| {
        Some((
            one,
            Owner::of_word(one.owner)?,
            BreakSource::of_word(one.source)?,
        ))
    });
    let mut any = false;
    for (one, owner, source) in asked {
        any = true;
        let by_comparator = matches!(source, BreakSource::Comparator | BreakSource::Configured);
        if by_comparator && !amplifiers_work(words, usize::from(owner != Owner::Screw)) {
            continue;
        }
        items.push(breaks(words, one, owner, source));
    }
    if !any {
        items.push(
            Item::new(BREAKS, "breaks", "all breaks", "firmware, bringup::breaks")
                .expected("each source tried")
                .read("none tried")
                .finding(
                    "The bridges' pins could not be made inputs, so no timer was enabled.",
                    "A fault of the firmware: report it.",
                ),
        );
    }
    items
}

fn converter(words: &ReportWords, name: &str, dead: &[&str]) -> Item {
    let on_it: Vec<String> = comparators(words)
        .filter(|comparator| dac(comparator) == name)
        .map(|comparator| format!("COMP{}", comparator.number))
        .collect();
    let item = Item::new(
        COMPARATORS,
        format!("dac.{}", name.to_lowercase().replace(' ', "-")),
        format!("{name}, threshold of {}", on_it.join(" and ")),
        "RM0440 24.3.2, table 199: which DAC is at which comparator",
    )
    .expected("moves over its range");
    if !dead.contains(&name) {
        return item.read("moves");
    }
    let item = item.read("does not move");
    let alone = on_it.len() == 1;
    item.finding(
        if alone {
            "Its only comparator does not change over the whole range: the DAC does not move, or the comparator is dead."
        } else {
            "None of its comparators changes over the whole range: the DAC does not move, and these comparators stop \
             nothing."
        },
        "Check that the DAC has its clock, is enabled and connected inside the chip (DAC_MCR mode 3); check VREF+.",
    )
}

fn comparator(words: &ReportWords, one: &ComparatorWords, dead: &[&str]) -> Item {
    let expected = &words.expected;
    let counts = f64::from(expected.adc_counts.max(1));
    let signal = Signal::of_word(one.signal);
    let name = signal.map_or("unknown", Signal::name);
    // A phase that is compared but not converted: where it should be.
    let pin = signal
        .and_then(|signal| level(words, signal))
        .unwrap_or(f64::from(expected.zero_sixteenths) / 16.0);
    let volts = |dac: f64| dac / counts * REFERENCE_V;
    let item = Item::new(
        COMPARATORS,
        format!("comparator.{}", one.number),
        format!("COMP{} on {name}", one.number),
        "its pin by the ADC; offsets and hysteresis: DS12288, comparator and DAC characteristics (memory)",
    )
    .expected(format!(
        "trips at {:.3} V \u{B1}{:.0} mV, once each way",
        volts(pin),
        1e3 * OFF_V
    ));
    if dead.contains(&dac(one)) {
        return item
            .read("no change")
            .open("Its DAC does not move.", "See the DAC.");
    }
    if one.changes == 0 {
        return item
            .read(format!(
                "always {}",
                if one.start == 1 { "high" } else { "low" }
            ))
            .finding(
                "The comparator does not answer although the DAC moves: it is off, its input is another pin, or that pin \
                 is beyond the reference. It stops nothing.",
                "Measure the pin; compare the comparator's input with the board's table of pins.",
            );
    }
    if one.up == NONE || one.down == NONE || one.changes > 2 {
        return item
            .read(format!("{} changes", one.changes))
            .finding(
                "The comparator changes more than once each way, or one way only: the pin moves while the DAC does.",
                "Check what drives the pin, and its noise above.",
            );
    }
    let (up, down) = (volts(f64::from(one.up)), volts(f64::from(one.down)));
    let middle = (up + down) / 2.0;
    let item = item.read(format!("{up:.3} V up, {down:.3} V down"));
    let off = middle - volts(pin);
    if off.abs() <= OFF_V {
        return item;
    }
    let amperes = off / REFERENCE_V * counts * f64::from(expected.microamperes) * 1e-6;
    item.finding(
        format!(
            "It trips {:+.0} mV from where the ADC sees its pin, so the over-current threshold is off by {:.2} A.",
            1e3 * off,
            amperes.abs()
        ),
        "Check VREF+ and the ground between amplifier and chip; another pin at the comparator does this too.",
    )
}

/// What must be seen of a break.
fn needed(source: BreakSource) -> u32 {
    let held = match source {
        BreakSource::Software => 0,
        _ => seen::HELD,
    };
    seen::ENABLED | seen::CLEARED | seen::FLAG | held | seen::RECOVERED | alone(source)
}

/// The other timer's output must stay. Both motors' comparators have one threshold, so that with all enabled each trips both timers.
fn alone(source: BreakSource) -> u32 {
    match source {
        BreakSource::Configured => 0,
        _ => seen::OTHER_STAYED,
    }
}

/// A break as it was seen.
fn break_item(one: &BreakWords, owner: Owner, source: BreakSource) -> Item {
    let name = match source {
        BreakSource::Comparator => format!("COMP{}", one.comparator),
        _ => source.name().to_owned(),
    };
    let id = match source {
        BreakSource::Comparator => format!("break.{}.comparator{}", owner.name(), one.comparator),
        BreakSource::Software => format!("break.{}.software", owner.name()),
        BreakSource::Pin => format!("break.{}.pin", owner.name()),
        BreakSource::Configured => format!("break.{}.configured", owner.name()),
    };
    let timer = match owner {
        Owner::Screw => "TIM1",
        _ => "TIM8",
    };
    let says = |bit, yes: &'static str, no: &'static str| match one.seen & bit {
        0 => no,
        _ => yes,
    };
    let alone = alone(source);
    Item::new(
        BREAKS,
        id,
        format!("{timer} ({}) by {name}", owner.name()),
        "RM0440 29.3.16 and 29.6.20: MOE is cleared by a break and held off while it lasts",
    )
    .expected(match alone {
        0 => "output enable cleared and held off",
        _ => "output enable cleared and held off, the other timer's not",
    })
    .read(match alone {
        0 => says(seen::CLEARED, "cleared", "not cleared").to_owned(),
        _ => format!(
            "{}, {}",
            says(seen::CLEARED, "cleared", "not cleared"),
            says(seen::OTHER_STAYED, "the other stayed", "the other went too"),
        ),
    })
}

fn breaks(words: &ReportWords, one: &BreakWords, owner: Owner, source: BreakSource) -> Item {
    let item = break_item(one, owner, source);
    let missing = |bit| needed(source) & bit != 0 && one.seen & bit == 0;
    if one.seen & needed(source) == needed(source) {
        return item;
    }
    let at_fault_level = source == BreakSource::Pin && missing(seen::ENABLED);
    if at_fault_level && !missing(seen::HELD) {
        return item.read("the line is at its fault level and holds the output off");
    }
    if answers_nothing(words, one, source) {
        return item.open("Its comparator does not change.", "See the comparators.");
    }
    if missing(seen::ENABLED) {
        return item.finding(
            "The output could not be enabled to begin with: a break is active already, or the timer does not take it.",
            "See comparators and fault pins: one says over-current or fault now.",
        );
    }
    if missing(seen::CLEARED) {
        return not_cleared(words, item, one, source);
    }
    if missing(seen::OTHER_STAYED) {
        return item.finding(
            "It stopped the other motor's timer too: the sources of the two are mixed.",
            "Compare TIMx_AF1 with the board's comparators.",
        );
    }
    if missing(seen::RECOVERED) {
        return item.finding(
            "The output could not be enabled again after the source was gone.",
            "Check that the comparator's pin is well away from the threshold.",
        );
    }
    item.finding(
        "The output could be enabled while the break was active, or its flag was not set.",
        "Check polarity and filter of the break (TIMx_BDTR).",
    )
}

fn not_cleared(words: &ReportWords, item: Item, one: &BreakWords, source: BreakSource) -> Item {
    match source {
        BreakSource::Comparator => item.finding(
            "The comparator trips and the timer goes on: it is not wired to the timer's break. An over-current of this \
             phase would stop nothing.",
            "Do not switch the bus on. Check TIMx_AF1 against the board's comparators.",
        ),
        BreakSource::Software => item.finding(
            "The timer's break does nothing: it is not enabled.",
            "Do not switch the bus on. Check TIMx_BDTR.BKE.",
        ),
        BreakSource::Pin if fault_level(words, one) => item.finding(
            "The fault line is at its fault level and the output could be enabled: the pin does not reach the timer's break. \
             A driver's fault would stop nothing.",
            "Do not switch the bus on. Check the pin's alternate function, TIMx_AF1.BKINE and its polarity.",
        ),
        BreakSource::Pin => item.open(
            "The chip's own pull resistor does not bring the fault line to its active level: the driver, or its pull-up \
             resistor, holds it. That is as it should be for a line with a strong pull-up.",
            "Bring the fault line to its active level by hand (1 kohm) while `cargo xtask attach` runs: the fault must show.",
        ),
        BreakSource::Configured => item.finding(
            "With the timer as the drive runs it, no comparator stops it.",
            "Do not switch the bus on. Compare TIMx_AF1 and TIMx_BDTR with the board's module.",
        ),
    }
}

/// The fault line of a break's owner is held at its fault level.
fn fault_level(words: &ReportWords, one: &BreakWords) -> bool {
    words.pins.iter().any(|pin| {
        let held = pin.levels & (pin_level::PULLED_UP | pin_level::PULLED_DOWN);
        let fault = match pin.levels & pin_level::IDLE_HIGH {
            0 => pin_level::PULLED_UP | pin_level::PULLED_DOWN,
            _ => 0,
        };
        pin.function == PinUse::Fault.word() && pin.owner == one.owner && held == fault
    })
}

/// A comparator that a break depends on does not change: what the break does then says nothing of the break.
fn answers_nothing(words: &ReportWords, one: &BreakWords, source: BreakSource) -> bool {
    let screw = [Signal::ScrewA, Signal::ScrewB, Signal::ScrewC].map(Signal::word);
    let of_owner = |comparator: &ComparatorWords| {
        screw.contains(&comparator.signal) == (one.owner == Owner::Screw.word())
    };
    comparators(words)
        .filter(|comparator| comparator.changes == 0)
        .any(|comparator| match source {
            BreakSource::Comparator => comparator.number == one.comparator,
            BreakSource::Configured => of_owner(comparator),
            BreakSource::Software | BreakSource::Pin => false,
        })
}
