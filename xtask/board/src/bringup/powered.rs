//! The second stage, at 12 V with the drivers awake and the bridges off.

use super::Item;
use super::analog::{PHASES, amplifiers_work, channels, current, level, noise, slug, zero};
use super::protection;
use link::bringup::{
    NOTHING, Owner, POWERED_CONVERSIONS, POWERED_V, ReportWords, Signal, Stage, StageWords,
};
use link::host::bringup::Readings;

const BUS: &str = "Bus voltage";
const DRIVERS: &str = "Gate drivers";
const CHIP: &str = "The chip";
/// How far a bus may be from the meter: the dividers' resistors and the reference (wiring page, first power-up).
const BUS_OFF: f64 = 0.02;

pub(super) fn items(readings: &Readings, meter_v: f64) -> Vec<Item> {
    let words = &readings.report;
    let buses = [Signal::ScrewBus, Signal::NutBus]
        .into_iter()
        .zip(&words.stages);
    match readings.stage() {
        Some(Stage::Refused) => buses
            .map(|(signal, _)| refused(words, signal, meter_v))
            .collect(),
        Some(Stage::Done) if words.stages[1].conversions < POWERED_CONVERSIONS => {
            vec![not_converted(words)]
        }
        Some(Stage::Done) => {
            let mut items: Vec<Item> = buses
                .map(|(signal, stage)| bus(words, signal, stage, meter_v))
                .collect();
            for (motor, owner) in [Owner::Screw, Owner::Nut].into_iter().enumerate() {
                items.extend(driver(words, motor, owner));
            }
            items.extend(currents(words));
            items.extend(protection::comparator_items(words));
            items.extend(chip(words));
            items
        }
        _ => Vec::new(),
    }
}

fn volts(words: &ReportWords, counts: f64) -> f64 {
    counts * f64::from(words.expected.bus_microvolts) * 1e-6
}

fn bus_item(signal: Signal) -> Item {
    Item::new(
        BUS,
        format!("bus.{}", slug(signal)),
        signal.name(),
        "the meter; the board's plate (`bus_volts_per_count`)",
    )
}

fn refused(words: &ReportWords, signal: Signal, meter_v: f64) -> Item {
    let [least, most] = POWERED_V;
    let volts = volts(words, level(words, signal).unwrap_or(0.0));
    bus_item(signal)
        .expected(format!("{least:.0} to {most:.0} V"))
        .read(format!("{volts:.1} V"))
        .finding(
            format!(
                "The second stage runs between {least:.0} and {most:.0} V, but the board reads {volts:.1} V, and the meter \
                 {meter_v:.1} V."
            ),
            if volts > most {
                "Set the bus to 12 V, and start again."
            } else {
                "Set the bus to 12 V. If the meter shows 12 V, check the wire and the resistors of the divider."
            },
        )
}

fn not_converted(words: &ReportWords) -> Item {
    Item::new(
        BUS,
        "conversions",
        "conversions by the timers",
        "firmware, bringup::powered",
    )
    .expected(format!("{POWERED_CONVERSIONS} periods"))
    .read(format!("{} periods", words.stages[1].conversions))
    .finding(
        "The timers or the converters do not run.",
        "Run the first stage: `cargo xtask bringup` with the bus off.",
    )
}

fn bus(words: &ReportWords, signal: Signal, stage: &StageWords, meter_v: f64) -> Item {
    let read = volts(words, f64::from(stage.bus) / f64::from(stage.conversions));
    // Two counts of the ADC's own.
    let off = BUS_OFF * meter_v + volts(words, 2.0);
    let item = bus_item(signal)
        .expected(format!("{meter_v:.2} V \u{B1}{off:.2} V, by the meter"))
        .read(format!("{read:.2} V"));
    if (read - meter_v).abs() <= off {
        return item;
    }
    item.finding(
        format!(
            "The board reads {:.3} of what the meter reads: the divider or the meter is another one. Limits of the bus would \
             be wrong by that factor.",
            read / meter_v
        ),
        "Measure at the divider's upper end again. Compare its resistors with the board's plate.",
    )
}

/// ENABLE and nFAULT of a driver.
fn driver(words: &ReportWords, motor: usize, owner: Owner) -> [Item; 2] {
    let stage = &words.stages[motor];
    let name = owner.name();
    let pulled = [0, 1, 2].map(|moment| stage.pulled >> moment & 1 == 1);
    let enable = Item::new(
        DRIVERS,
        format!("enable.{name}"),
        format!("ENABLE of the {name}'s driver"),
        "DRV8323 data sheet: asleep its amplifiers give 0 V, and it pulls nFAULT (wiring page)",
    );
    let (enable, wakes) = if words.expected.amplifiers_sleep == 1 {
        enable_by_amplifiers(words, motor, enable)
    } else {
        enable_by_fault_line(pulled, enable)
    };
    let fault = Item::new(
        DRIVERS,
        format!("nfault.{name}"),
        format!("nFAULT of the {name}'s driver"),
        "DRV8323 data sheet: nFAULT is low until the driver is awake (wiring page)",
    );
    [enable, fault_line(pulled, wakes, fault)]
}

/// How nFAULT is pulled by a driver that is asleep, awake and asleep again.
const GOES_WITH_ENABLE: [bool; 3] = [true, false, true];

/// ENABLE as the amplifiers show it, and whether the driver wakes.
fn enable_by_amplifiers(words: &ReportWords, motor: usize, enable: Item) -> (Item, bool) {
    let levels = [0, 1, 2].map(|moment| {
        let phases = PHASES[motor]
            .iter()
            .filter_map(|signal| current(words, *signal));
        phases
            .map(|(_, current)| current.levels[moment])
            .collect::<Vec<_>>()
    });
    let sleeps = |moment: usize| levels[moment].iter().any(|level| *level < NOTHING);
    let enable = enable
        .expected("amplifiers: 0 V asleep, half the reference awake")
        .read(format!(
            "{:?} counts, {:?}, {:?}",
            levels[0], levels[1], levels[2]
        ));
    if !amplifiers_work(words, motor) {
        let enable = enable.finding(
            "The amplifiers stay at 0 V: ENABLE does not reach the driver, or the driver has no supply.",
            "Close the emergency stop. Measure ENABLE at the driver, at the chip, and the driver's supply.",
        );
        return (enable, false);
    }
    if !(sleeps(0) && sleeps(2)) {
        let enable = enable.finding(
            "The amplifiers work while ENABLE is low: something holds ENABLE high at the driver.",
            "Switch the bus off. Measure ENABLE at the driver: it needs a pull-down.",
        );
        return (enable, false);
    }
    (enable, true)
}

/// ENABLE as nFAULT shows it, and whether the driver wakes as far as that can be seen.
fn enable_by_fault_line(pulled: [bool; 3], enable: Item) -> (Item, bool) {
    let enable = enable
        .expected("nFAULT: low asleep, high awake")
        .read(line(pulled));
    if pulled == GOES_WITH_ENABLE {
        return (enable, true);
    }
    if pulled == [true; 3] {
        let enable = enable.finding(
            "The driver pulls nFAULT although ENABLE is high: ENABLE does not reach it, it has no supply, or nFAULT \
             is shorted to ground.",
            "Close the emergency stop. Measure ENABLE and nFAULT at the driver, and the driver's supply.",
        );
        return (enable, false);
    }
    let enable = enable.open("nFAULT shows nothing of it.", "See nFAULT.");
    (enable, true)
}

/// nFAULT of a driver that wakes with ENABLE, or does not.
fn fault_line(pulled: [bool; 3], wakes: bool, fault: Item) -> Item {
    let fault = fault
        .expected("low asleep, high awake, low asleep again")
        .read(line(pulled));
    if pulled == GOES_WITH_ENABLE {
        return fault;
    }
    if !wakes {
        return fault.open("The driver does not go with ENABLE.", "See ENABLE.");
    }
    if pulled[1] {
        return fault.finding(
            "The awake driver says that it has a fault, or the line is shorted to ground.",
            "Measure nFAULT at the driver. Check its supply and its gates for shorts.",
        );
    }
    fault.finding(
        "The line stays high while the driver sleeps: its wire is torn, or something holds it. A fault of the driver would \
         stop nothing.",
        "Switch the bus off. Check the wire from nFAULT to the chip.",
    )
}

fn line(pulled: [bool; 3]) -> String {
    pulled
        .map(|pulled| if pulled { "low" } else { "high" })
        .join(", ")
}

/// Zeros and noise of the currents whose amplifiers are awake.
fn currents(words: &ReportWords) -> Vec<Item> {
    let expected = &words.expected;
    let mut zeros = Vec::new();
    let mut noises = Vec::new();
    for (motor, phases) in PHASES.into_iter().enumerate() {
        let there = |signal: &Signal| channels(words).any(|(_, other)| other == *signal);
        for signal in phases.into_iter().filter(there) {
            let Some((stage, current)) = current(words, signal) else {
                continue;
            };
            let level = level(words, signal).unwrap_or(0.0);
            let item = zero(expected, signal, level);
            if amplifiers_work(words, motor) {
                zeros.push(item);
                noises.push(noise(expected, signal, stage, current));
            } else {
                zeros.push(item.open("Its driver does not wake.", "See ENABLE."));
            }
        }
    }
    zeros.extend(noises);
    zeros
}

/// Option bytes and revision.
fn chip(words: &ReportWords) -> [Item; 4] {
    const SOURCE: &str = "RM0440 3.7.8, FLASH_OPTR";
    let optr = words.clock.flash_optr;
    let level = optr >> 8 & 7;
    let bor = Item::new(CHIP, "options.bor", "brown-out level (BOR_LEV)", SOURCE)
        .expected("4")
        .read(level.to_string());
    let bor = match level {
        4 => bor,
        _ => bor.finding(
            "Below 2.8 V the chip is not reset, and its pins are undefined.",
            "`STM32_Programmer_CLI -c port=SWD -ob BOR_LEV=4`",
        ),
    };
    let off = optr >> 24 & 1;
    let parity = Item::new(CHIP, "options.parity", "SRAM parity (SRAM_PE)", SOURCE)
        .expected("0: checked")
        .read(off.to_string());
    let parity = match off {
        0 => parity,
        _ => parity.finding(
            "A wrong bit in RAM does not open the bridges.",
            "`STM32_Programmer_CLI -c port=SWD -ob SRAM_PE=0`",
        ),
    };
    let [by_pin, from_flash] = [26, 27].map(|bit| optr >> bit & 1);
    let boot = Item::new(
        CHIP,
        "options.boot",
        "what boots (nSWBOOT0, nBOOT0)",
        SOURCE,
    )
    .expected("0, 1: the flash, whatever PB8 is")
    .read(format!("{by_pin}, {from_flash}"));
    let boot = match (by_pin, from_flash) {
        (0, 1) => boot,
        _ => boot.finding(
            "The level of PB8 picks what boots, or the chip's loader does.",
            "`STM32_Programmer_CLI -c port=SWD -ob nSWBOOT0=0 nBOOT0=1`",
        ),
    };
    const G474: u32 = 0x469;
    let (device, revision) = (words.clock.idcode & 0xFFF, words.clock.idcode >> 16);
    let silicon = Item::new(
        CHIP,
        "silicon",
        "device and silicon revision",
        "RM0440 47.6.1, DBGMCU_IDCODE (memory)",
    )
    .expected(format!("device {G474:#x}"))
    .read(format!("device {device:#x}, revision {revision:#06x}"));
    let silicon = match device {
        G474 => silicon,
        _ => silicon.finding(
            "The chip is no STM32G471 to G484: pins, errata and flash may differ.",
            "Read the chip's marking, and fit an STM32G474RE.",
        ),
    };
    [bor, parity, boot, silicon]
}
