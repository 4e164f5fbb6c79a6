//! ADC channels: supply, bus, zeros, settling, temperatures; and the noise of the currents, for the second stage.

use super::Item;
use control::controller_supply::{SUPPLY_MV, SupplyReading};
use control::thermometer::{Side, TemperaturePlate, Thermometer};
use link::bringup::{
    BUS_LIMIT_V, CONVERSIONS, ChannelWords, CurrentWords, ExpectedWords, NOTHING, ReportWords,
    SAMPLING_HALVES, SampleWords, SensorWords, Signal, StageWords, time_constant_s,
};

/// The longest sampling time's code: what the others are compared with.
const LONGEST: usize = 7;
/// A channel has settled when its mean is as near to that of the longest sampling time, counts, or as its noise lets it be.
const SETTLED: f64 = 2.0;
/// Less between a channel and the one before it shows no settling, counts.
const APART: f64 = 100.0;
/// Most noise, standard deviation in counts. Our limit: twice what the simulated boards are tested with, and more.
const NOISE: f64 = 4.0;

/// The entries that are there.
pub(super) fn channels(
    words: &ReportWords,
) -> impl Iterator<Item = (&ChannelWords, Signal)> + Clone {
    words
        .channels
        .iter()
        .filter_map(|channel| Some((channel, Signal::of_word(channel.signal)?)))
}

/// Mean of a channel's conversions at a sampling time, counts.
fn mean(samples: &SampleWords) -> f64 {
    f64::from(samples.first) + f64::from(samples.sum) / f64::from(CONVERSIONS)
}

/// Standard deviation of conversions, counts.
fn deviation(conversions: u32, sum: i32, squares: u32) -> f64 {
    let (n, sum) = (f64::from(conversions), f64::from(sum));
    ((f64::from(squares) - sum * sum / n) / (n - 1.0))
        .max(0.0)
        .sqrt()
}

/// The currents of both motors: screw's, nut's.
pub(super) const PHASES: [[Signal; 3]; 2] = [
    [Signal::ScrewA, Signal::ScrewB, Signal::ScrewC],
    [Signal::NutA, Signal::NutB, Signal::NutC],
];

/// A current channel in the second stage, and its power stage.
pub(super) fn current(words: &ReportWords, signal: Signal) -> Option<(&StageWords, &CurrentWords)> {
    let stages = words.stages.iter().zip(PHASES);
    stages
        .flat_map(|(stage, phases)| {
            phases
                .into_iter()
                .zip(&stage.currents)
                .map(move |c| (stage, c))
        })
        .find(|(_, (other, _))| *other == signal)
        .map(|(stage, (_, current))| (stage, current))
}

/// The amplifiers of motor 0 or 1 give more than 0 V: their driver is awake, or they have another supply.
pub(super) fn amplifiers_work(words: &ReportWords, motor: usize) -> bool {
    let mut levels = PHASES[motor]
        .iter()
        .filter_map(|signal| level(words, *signal));
    words.expected.amplifiers_sleep == 0 || levels.any(|level| level >= f64::from(NOTHING))
}

/// What a signal reads, counts: at the longest sampling time, or a current in the second stage with its driver awake.
pub(super) fn level(words: &ReportWords, signal: Signal) -> Option<f64> {
    if let Some((stage, current)) = current(words, signal)
        && stage.conversions > 0
    {
        let off = f64::from(current.sum) / f64::from(stage.conversions);
        return Some(f64::from(current.levels[1]) + off);
    }
    channels(words)
        .find(|(_, other)| *other == signal)
        .map(|(channel, _)| mean(&channel.samples[LONGEST]))
}

fn sampling_ns(expected: &ExpectedWords, code: usize) -> f64 {
    f64::from(SAMPLING_HALVES[code & 7]) / 2.0 / f64::from(expected.adc_hz.max(1)) * 1e9
}

pub(super) fn slug(signal: Signal) -> String {
    format!("{signal:?}").to_lowercase()
}

pub(super) fn items(words: &ReportWords) -> Vec<Item> {
    let expected = &words.expected;
    let mut items: Vec<Item> = channels(words)
        .map(|(channel, signal)| {
            let level = mean(&channel.samples[LONGEST]);
            match signal {
                Signal::ScrewBus | Signal::NutBus => bus(expected, signal, level),
                Signal::ScrewHeatSink => temperature(expected, 0, signal, level),
                Signal::NutHeatSink => temperature(expected, 1, signal, level),
                Signal::Reference => supply(expected, level),
                _ => {
                    let motor = usize::from(!PHASES[0].contains(&signal));
                    match amplifiers_work(words, motor) {
                        true => zero(expected, signal, level),
                        false => asleep(signal),
                    }
                }
            }
        })
        .collect();
    let order = |item: &Item| match item.group {
        SUPPLY => 0,
        BUS => 1,
        ZEROS => 2,
        _ => 3,
    };
    items.sort_by_key(order);
    // The reference is on no pin, and its sampling time is the datasheet's.
    let at_pins = channels(words).filter(|(_, signal)| *signal != Signal::Reference);
    items.extend(at_pins.map(|(channel, signal)| settles(words, channel, signal)));
    items
}

const SUPPLY: &str = "Controller's supply";
const BUS: &str = "Bus voltage";
const ZEROS: &str = "Current channels, no current";
const HEAT: &str = "Heat sinks";
const SETTLING: &str = "Sampling times";
const NOISES: &str = "Noise";

fn bus(expected: &ExpectedWords, signal: Signal, level: f64) -> Item {
    let volts = level * f64::from(expected.bus_microvolts) * 1e-6;
    let item = Item::new(
        BUS,
        format!("bus.{}", slug(signal)),
        signal.name(),
        "link::bringup::BUS_LIMIT_V: below the lock-out of gate drivers",
    )
    .expected(format!("less than {BUS_LIMIT_V:.0} V"))
    .read(format!("{volts:.1} V"));
    if volts < BUS_LIMIT_V {
        return item;
    }
    item.finding(
        format!(
            "There is {volts:.0} V on the bus: a bring-up pulls at gate drivers and enables timers, and is done without."
        ),
        "Switch the bus off, let its capacitors discharge, and start again.",
    )
}

fn supply(expected: &ExpectedWords, level: f64) -> Item {
    let counts = |value: f64| value.round().clamp(0.0, u16::MAX.into()) as u16;
    let reading = SupplyReading {
        reference: counts(level),
        calibrated: counts(expected.calibrated.into()),
    };
    let volts = |millivolts: u16| f64::from(millivolts) / 1e3;
    let item = Item::new(
        SUPPLY,
        "supply.controller",
        Signal::Reference.name(),
        "`control::controller_supply`; the chip's own calibration",
    )
    .expected(format!(
        "{:.1} to {:.1} V",
        volts(SUPPLY_MV.least),
        volts(SUPPLY_MV.most)
    ))
    .read(format!(
        "{:.2} V ({level:.0} counts, {} at 3.0 V)",
        volts(reading.millivolts()),
        expected.calibrated
    ));
    if SUPPLY_MV.has(reading.millivolts()) {
        return item;
    }
    item.finding(
        "The chip's supply is not 3.3 V, or its maker has not written what the reference reads: the drive would not leave its fault.",
        "Measure 3.3 V at the chip, VDDA and VREF+ too; where they are right, the chip is a copy or damaged: take another.",
    )
}

/// A current channel in the first stage, whose driver sleeps.
fn asleep(signal: Signal) -> Item {
    Item::new(
        ZEROS,
        format!("zero.{}", slug(signal)),
        signal.name(),
        "the board's AMPLIFIERS_SLEEP; the second stage reads the zeros",
    )
    .expected("asleep: 0 V")
    .read("asleep, as expected without supply")
}

pub(super) fn zero(expected: &ExpectedWords, signal: Signal, level: f64) -> Item {
    let nominal = f64::from(expected.zero_sixteenths) / 16.0;
    let tolerance = f64::from(expected.zero_tolerance);
    let amperes = f64::from(expected.microamperes) * 1e-6;
    let off = level - nominal;
    let item = Item::new(
        ZEROS,
        format!("zero.{}", slug(signal)),
        signal.name(),
        "the board's plate (`zero_counts`); control::sense::ZERO_TOLERANCE_COUNTS",
    )
    .expected(format!("{nominal:.0} counts, \u{B1}{tolerance:.0}"))
    .read(format!("{level:.1} counts ({:+.3} A)", off * amperes));
    if off.abs() <= tolerance {
        return item;
    }
    let top = f64::from(expected.adc_counts) - 1.0;
    let (means, todo) = if level <= 8.0 {
        (
            "The channel reads ground: the amplifier has no supply, its output is shorted to ground, or the wire is \
             another one.",
            "Measure the amplifier's supply, and its output at the pin against what is expected.",
        )
    } else if level >= top - 8.0 {
        (
            "The channel reads the reference: the amplifier's output is at its upper end, or shorted to the supply.",
            "Measure the amplifier's output at the pin; an open input of the amplifier does this too.",
        )
    } else {
        (
            "The zero is not where the amplifier should put it: another amplifier, another offset, or a current that \
             flows.",
            "Compare the amplifier's offset with the board's plate; check that nothing drives a current.",
        )
    };
    item.finding(means, todo)
}

fn plate(words: &SensorWords) -> TemperaturePlate {
    let ohm = f64::from(words.ohm);
    TemperaturePlate {
        sensor: match words.platinum {
            0 => Thermometer::Ntc {
                r25_ohm: ohm,
                beta_k: f64::from(words.beta_k),
            },
            _ => Thermometer::Platinum { r0_ohm: ohm },
        },
        side: match words.at_reference {
            0 => Side::Ground,
            _ => Side::Reference,
        },
        divider_ohm: f64::from(words.divider_ohm),
        max_celsius: 0.0,
        min_celsius: 0.0,
    }
}

/// The temperature at which the channel reads `level`, by bisection.
fn celsius(words: &SensorWords, adc_counts: u32, level: f64) -> f64 {
    let plate = plate(words);
    let (mut cold, mut hot) = (-80.0, 250.0);
    let rises = plate.counts(hot, adc_counts) > plate.counts(cold, adc_counts);
    for _ in 0..60 {
        let middle = (cold + hot) / 2.0;
        if (plate.counts(middle, adc_counts) < level) == rises {
            cold = middle;
        } else {
            hot = middle;
        }
    }
    (cold + hot) / 2.0
}

fn temperature(expected: &ExpectedWords, index: usize, signal: Signal, level: f64) -> Item {
    let words = &expected.sensors[index];
    let [least, most] = words.range.map(f64::from);
    let at = |counts| celsius(words, expected.adc_counts, counts);
    let (one, other) = (at(least), at(most));
    let item = Item::new(
        HEAT,
        format!("temperature.{}", slug(signal)),
        signal.name(),
        "the board's plate (`GuardPlate::temperatures`)",
    )
    .expected(format!(
        "{:.0} to {:.0} \u{B0}C",
        one.min(other),
        one.max(other)
    ));
    if (least..=most).contains(&level) {
        return item.read(format!("{:.1} \u{B0}C ({level:.0} counts)", at(level)));
    }
    let item = item.read(format!("{level:.0} counts"));
    let at_reference = level > f64::from(expected.adc_counts) / 2.0;
    // At the sensor's end of the divider or at the other.
    let torn = at_reference == (words.at_reference == 0);
    let past_end = level < 32.0 || level > f64::from(expected.adc_counts) - 33.0;
    match (past_end, torn) {
        (true, true) => item.finding(
            "The channel reads what it would without a sensor: the sensor is torn off, or its connector open.",
            "Check the sensor's two wires; cold, it should have the plate's resistance.",
        ),
        (true, false) => item.finding(
            "The channel reads what it would with the sensor bridged: its wires are shorted.",
            "Check the sensor's two wires against each other and against ground.",
        ),
        (false, _) => item.finding(
            format!(
                "That would be {:.0} \u{B0}C: it is that hot or cold, or the sensor or the divider is another one.",
                at(level)
            ),
            "Compare sensor and divider with the board's plate.",
        ),
    }
}

/// How a channel settles: away from the longest sampling time's mean, by sampling time.
pub(super) fn settling(words: &ReportWords) -> Vec<(String, Vec<(f64, f64)>)> {
    channels(words)
        .map(|(channel, signal)| {
            let last = mean(&channel.samples[LONGEST]);
            let points = channel.samples[..LONGEST]
                .iter()
                .enumerate()
                .map(|(code, samples)| {
                    (
                        sampling_ns(&words.expected, code),
                        (mean(samples) - last).abs(),
                    )
                })
                .collect();
            (signal.name().to_owned(), points)
        })
        .collect()
}

fn settles(words: &ReportWords, channel: &ChannelWords, signal: Signal) -> Item {
    let expected = &words.expected;
    let code = (channel.sampling & 7) as usize;
    let last = mean(&channel.samples[LONGEST]);
    let errors: Vec<f64> = channel
        .samples
        .iter()
        .map(|samples| mean(samples) - last)
        .collect();
    let item = Item::new(
        SETTLING,
        format!("settling.{}", slug(signal)),
        format!(
            "{} (ADC{} channel {})",
            signal.name(),
            channel.adc,
            channel.channel
        ),
        "RM0440 21.4.12: sampling times; held against the longest one, 640.5 clocks",
    )
    .expected(format!(
        "within {SETTLED:.0} counts in {:.0} ns (code {code})",
        sampling_ns(expected, code)
    ))
    .read(format!("{:+.1} counts", errors[code]));
    let before = channels(words)
        .find(|(other, _)| other.adc == channel.adc && other.channel == channel.before)
        .map_or(last, |(other, _)| mean(&other.samples[LONGEST]));
    // Four standard deviations of a difference of two means.
    let longest = &channel.samples[LONGEST];
    let deviation = deviation(CONVERSIONS, longest.sum, longest.squares);
    let noise = 4.0 * (2.0 / f64::from(CONVERSIONS)).sqrt() * deviation;
    let settled = SETTLED.max(noise);
    if errors[code].abs() > settled {
        let enough =
            (code..LONGEST).find(|code| errors[*code..].iter().all(|error| error.abs() <= SETTLED));
        let todo = match enough {
            Some(enough) => format!(
                "Sample it for {:.0} ns (code {enough}), or put a capacitor of some nF at the pin.",
                sampling_ns(expected, enough)
            ),
            None => "Put a capacitor of some nF at the pin: no sampling time is enough.".into(),
        };
        let ohms = source_ohms(expected, channel.channel, &errors, before - last)
            .map_or(String::new(), |ohms| {
                format!(" Its source has about {:.1} kohm.", ohms / 1e3)
            });
        return item.finding(
            format!(
                "The sampling capacitor does not reach the pin's voltage within its sampling time: what is read depends on \
                 the channel before it.{ohms}"
            ),
            todo,
        );
    }
    if (before - last).abs() < APART {
        return item.open(
            "All channels of this ADC stand at nearly one level, so a sampling time that is too short would not show.",
            "It is judged when another channel of the ADC stands elsewhere.",
        );
    }
    item
}

/// The resistance that the sampling capacitor was charged through: of the two sampling times between which the error falls
/// most clearly.
fn source_ohms(expected: &ExpectedWords, channel: u32, errors: &[f64], start: f64) -> Option<f64> {
    let pairs = errors[..LONGEST].windows(2).enumerate();
    pairs
        .filter(|(_, pair)| {
            pair[0].signum() == pair[1].signum()
                && pair[1].abs() > 2.0 * SETTLED
                && pair[0].abs() < 0.95 * start.abs()
                && pair[0].abs() > 1.1 * pair[1].abs()
        })
        .map(|(code, pair)| {
            let passed = sampling_ns(expected, code + 1) - sampling_ns(expected, code);
            let tau = passed * 1e-9 / (pair[0] / pair[1]).ln();
            let [none, one] = [0.0, 1.0].map(|ohm| time_constant_s(channel, ohm));
            (tau - none) / (one - none)
        })
        .find(|ohms| *ohms > 0.0)
}

/// Noise of a current by the drive's own triggers, while everything else converts.
pub(super) fn noise(
    expected: &ExpectedWords,
    signal: Signal,
    stage: &StageWords,
    current: &CurrentWords,
) -> Item {
    const BARS: [char; 9] = [
        ' ', '\u{2581}', '\u{2582}', '\u{2583}', '\u{2584}', '\u{2585}', '\u{2586}', '\u{2587}',
        '\u{2588}',
    ];
    let counts = deviation(stage.conversions, current.sum, current.squares);
    let milliamperes = counts * f64::from(expected.microamperes).abs() * 1e-3;
    let most = current.histogram.iter().copied().max().unwrap_or(0).max(1);
    let histogram: String = current
        .histogram
        .iter()
        .map(|bin| BARS[(bin * 8).div_ceil(most).min(8) as usize])
        .collect();
    let item = Item::new(
        NOISES,
        format!("noise.{}", slug(signal)),
        signal.name(),
        "our limit, twice what the simulated boards are tested with and more",
    )
    .expected(format!("at most {NOISE:.0} counts"))
    .read(format!(
        "{counts:.1} counts ({milliamperes:.0} mA) |{histogram}|"
    ));
    if counts <= NOISE {
        return item;
    }
    item.finding(
        "The channel is noisier than the drive is tuned for: the current loop would turn it into torque and heat.",
        "Check ground and shield of its wire, the reference's capacitor, and what switches nearby; then a capacitor at the pin.",
    )
}
