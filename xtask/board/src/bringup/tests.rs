use super::*;
use link::LAYOUT;
use link::bringup::*;
use link::host::bringup::Stream;
use link::view::Words;

/// How a pin of the test's board reads.
const HELD_LOW: u32 = 0;
const HELD_HIGH: u32 = level::PULLED_UP | level::PULLED_DOWN;
const FOLLOWS: u32 = level::PULLED_UP;

/// A mean and a little noise: 32 conversions that are `level` and one above it by turns.
fn samples(level: u32) -> SampleWords {
    SampleWords {
        first: level,
        sum: 16,
        squares: 16,
    }
}

/// Readings of a board on which all is well, as the manual and the plate have them.
fn healthy() -> Readings {
    let mut words = ReportWords::take(&mut || 0);
    words.magic = REPORT_MAGIC;
    words.layout = LAYOUT;
    words.stage = Stage::Done.word();
    words.expected = expected();
    words.clock = clock();
    convert(&mut words);
    trip_comparators(&mut words);
    break_timers(&mut words);
    try_pins(&mut words);
    turn_encoders(&mut words);
    words.flash = FlashWords {
        address: 0x0807_F800,
        done: flash::WAS_OURS | flash::ERASED,
        status: [1, 0],
        erase: 22 * 170_000,
        program: FLASH_DOUBLE_WORDS * 85 * 170,
        right: FLASH_DOUBLE_WORDS,
    };
    Readings {
        report: words,
        meter_v: None,
        stream: Some(Stream {
            bytes: 500_000,
            seconds: 1.0,
            wrong: 0,
        }),
        drive: None,
        crash: None,
    }
}

fn expected() -> ExpectedWords {
    ExpectedWords {
        core_hz: 170_000_000,
        crystal_hz: 24_000_000,
        adc_hz: 42_500_000,
        adc_counts: 4096,
        zero_sixteenths: 2048 * 16,
        zero_tolerance: 256,
        microamperes: 2441,
        bus_microvolts: 110_000,
        amplifiers_sleep: 0,
        gate_pull_down_ohm: 10_000,
        calibrated: 1655,
        sensors: [SensorWords {
            platinum: 0,
            ohm: 10_000,
            beta_k: 3977,
            divider_ohm: 4700,
            at_reference: 0,
            range: [654, 3959],
        }; 2],
    }
}

fn clock() -> ClockWords {
    ClockWords {
        apb1enr1: 1 << 28,
        pwr_cr1: 1 << 9,
        pwr_cr5: 0,
        pwr_sr2: 0,
        flash_acr: 7 << 8 | 4,
        flash_optr: 0xFAEF_FCAA,
        idcode: 0x2003_0469,
        rcc_cr: 0b11 << 24 | 0b11 << 16,
        rcc_cfgr: 0b1111,
        rcc_pllcfgr: 3,
        // 170 counts a period of 1 MHz; 5312.5 of 32 kHz.
        hsi: 256 * 170,
        lsi: 32 * 5312,
    }
}

/// What the ADCs' channels see.
fn convert(words: &mut ReportWords) {
    let signals = [
        (Signal::ScrewA, 1, 1, 6, 2050),
        (Signal::ScrewBus, 1, 6, 1, 2),
        (Signal::ScrewHeatSink, 1, 7, 6, 2785),
        (Signal::ScrewB, 2, 2, 8, 2045),
        (Signal::ScrewC, 2, 4, 8, 2051),
        (Signal::NutHeatSink, 2, 8, 2, 2785),
        (Signal::NutB, 3, 12, 5, 2047),
        (Signal::NutC, 3, 5, 12, 2046),
        (Signal::NutA, 4, 4, 3, 2049),
        (Signal::NutBus, 4, 3, 4, 1),
        (Signal::Reference, 4, 18, 3, 1504),
    ];
    for (channel, (signal, adc, number, before, level)) in words.channels.iter_mut().zip(signals) {
        *channel = ChannelWords {
            signal: signal.word(),
            adc,
            channel: number,
            before,
            sampling: 1,
            samples: [samples(level); 8],
        };
    }
}

fn trip_comparators(words: &mut ReportWords) {
    let comparators = [
        (3, Signal::ScrewA),
        (1, Signal::ScrewB),
        (2, Signal::ScrewC),
        (7, Signal::NutA),
        (4, Signal::NutB),
        (5, Signal::NutC),
    ];
    for (words, (number, signal)) in words.comparators.iter_mut().zip(comparators) {
        *words = ComparatorWords {
            number,
            signal: signal.word(),
            start: 1,
            up: 2060,
            down: 2036,
            changes: 2,
        };
    }
}

fn break_timers(words: &mut ReportWords) {
    let all = seen::ENABLED
        | seen::CLEARED
        | seen::FLAG
        | seen::HELD
        | seen::RECOVERED
        | seen::OTHER_STAYED;
    let mut breaks = Vec::new();
    for (owner, numbers) in [(Owner::Screw, [3, 1, 2]), (Owner::Nut, [7, 4, 5])] {
        breaks.push((owner, BreakSource::Software, 0));
        breaks.extend(numbers.map(|number| (owner, BreakSource::Comparator, number)));
        breaks.push((owner, BreakSource::Configured, 0));
    }
    for (words, (owner, source, comparator)) in words.breaks.iter_mut().zip(breaks) {
        *words = BreakWords {
            owner: owner.word(),
            source: source.word(),
            comparator,
            seen: all,
        };
    }
}

fn try_pins(words: &mut ReportWords) {
    let pins = [
        (
            0x0008,
            PinUse::HighA,
            Owner::Screw,
            HELD_LOW | level::DRIVEN,
        ),
        (
            0x0009,
            PinUse::HighB,
            Owner::Screw,
            HELD_LOW | level::DRIVEN,
        ),
        (0x000F, PinUse::EncoderA, Owner::Screw, HELD_HIGH),
        (0x0103, PinUse::EncoderB, Owner::Screw, HELD_LOW),
        (0x0006, PinUse::DataIn, Owner::Nut, FOLLOWS),
        (
            0x010A,
            PinUse::Fault,
            Owner::Nut,
            FOLLOWS | level::IDLE_HIGH,
        ),
    ];
    for (words, (pin, function, owner, levels)) in words.pins.iter_mut().zip(pins) {
        *words = PinWords {
            pin,
            function: function.word(),
            owner: owner.word(),
            levels,
            raised: 0,
            lowered: 0,
        };
    }
}

fn turn_encoders(words: &mut ReportWords) {
    let [screw, nut] = &mut words.encoders;
    screw.kind = EncoderKind::IncrementalWithIndex.word();
    screw.counts_per_turn = 40_000;
    screw.looks = 200_000;
    screw.changes = 60_000;
    screw.most = 60_000;
    screw.indices = 2;
    nut.kind = EncoderKind::Mt6835.word();
    nut.counts_per_turn = 1 << 21;
    nut.looks = 2000;
    nut.first = 77;
}

#[test]
fn a_healthy_board_has_no_finding() {
    let report = judge(&healthy());
    let found: Vec<_> = report.of(Verdict::Finding).collect();
    assert!(found.is_empty(), "{found:#?}");
    let open: Vec<_> = report.of(Verdict::Open).map(|item| &item.id).collect();
    // Two channels of one ADC, both at their zero.
    assert_eq!(open, ["settling.nutb", "settling.nutc"]);
    assert!(report.result.starts_with("No finding."));
    page::check_sound(&report);
}

mod page {
    /// The page holds together, and says each finding.
    pub fn check_sound(report: &super::Report) {
        let html = crate::bringup::page(report);
        ::page::check::sound(&html).unwrap();
        for item in report.of(super::Verdict::Finding) {
            let means = askama::filters::escape(&item.means, askama::filters::Html);
            let means = means.expect("a text").to_string();
            assert!(html.contains(&means), "not on the page: {means}");
        }
    }
}

/// A fault: how the readings change, which items are findings, and words that one of them says.
type Fault = (fn(&mut Readings), &'static [&'static str], &'static str);

const FAULTS: [Fault; 22] = [
    (
        |r| {
            r.report.clock.hsi = 256 * 177;
            r.report.clock.lsi = 32 * 5533;
        },
        &["clock.crystal"],
        "25 MHz",
    ),
    (
        |r| r.report.clock.hsi = 0,
        &["clock.crystal"],
        "HSI16 does not start",
    ),
    (|r| r.report.clock.lsi = 0, &["clock.lsi"], "does not start"),
    (
        |r| r.report.clock.lsi = 32 * 4000,
        &["clock.lsi"],
        "are 15 ms",
    ),
    (
        |r| {
            r.report.clock.pwr_cr5 = 1 << 8;
            r.report.clock.apb1enr1 = 0;
        },
        &["power.boost"],
        "PWREN",
    ),
    (
        |r| r.report.clock.flash_acr = 7 << 8 | 3,
        &["flash.wait"],
        "faster than it can be",
    ),
    (
        |r| r.report.clock.rcc_cfgr = 0b0101,
        &["clock.source"],
        "not clocked as",
    ),
    (
        |r| r.report.channels[3].samples = [samples(0); 8],
        &["comparator.1", "zero.screwb"],
        "reads ground",
    ),
    (
        |r| r.report.channels[2].samples = [samples(1); 8],
        &["temperature.screwheatsink"],
        "wires are shorted",
    ),
    (
        |r| r.report.expected.calibrated = 0xFFFF,
        &["supply.controller"],
        "maker has not written",
    ),
    (
        |r| (r.report.comparators[1].up, r.report.comparators[1].down) = (2200, 2176),
        &["comparator.1"],
        "off by 0.3",
    ),
    (
        |r| r.report.breaks[0].seen &= !seen::CLEARED,
        &["break.screw.software"],
        "break does nothing",
    ),
    (
        |r| r.report.breaks[1].seen &= !seen::OTHER_STAYED,
        &["break.screw.comparator3"],
        "other motor's timer too",
    ),
    (
        |r| r.report.pins[0].levels |= level::DRIVEN_HIGH,
        &["pin.PA8"],
        "it reads high",
    ),
    (
        |r| r.report.encoders[1].bad_checks = 40,
        &["encoder.nut"],
        "2.0 %",
    ),
    (
        |r| {
            r.report.encoders[1].bad_status = 2000;
            r.report.encoders[1].status = 2;
        },
        &["encoder.nut"],
        "field is too weak",
    ),
    (
        |r| r.report.encoders[0].indices = 0,
        &["encoder.screw"],
        "index did not come",
    ),
    (
        |r| r.report.encoders[0].transition_errors = 3,
        &["encoder.screw"],
        "an edge was lost",
    ),
    (
        |r| (r.report.encoders[0].most, r.report.encoders[0].indices) = (1, 0),
        &["encoder.screw"],
        "to and fro",
    ),
    (
        |r| r.report.flash.right = 7,
        &["flash.page"],
        "1 of 8 double words",
    ),
    (
        |r| r.stream.as_mut().unwrap().bytes = 150_000,
        &["probe.rate"],
        "--rate 2500",
    ),
    (
        |r| r.stream.as_mut().unwrap().wrong = 1,
        &["probe.rate"],
        "damaged",
    ),
];

#[test]
fn each_fault_is_named_and_nothing_else_is() {
    for (break_it, ids, says) in FAULTS {
        let mut readings = healthy();
        break_it(&mut readings);
        let report = judge(&readings);
        let mut found: Vec<_> = report
            .of(Verdict::Finding)
            .map(|item| item.id.as_str())
            .collect();
        found.sort_unstable();
        assert_eq!(found, *ids, "expected to be said: {says}");
        let text = report.text();
        assert!(text.contains(says), "`{says}` is not said:\n{text}");
        assert_eq!(report.findings, ids.len());
        page::check_sound(&report);
    }
}

#[test]
fn a_fault_line_at_its_fault_level_is_no_finding_while_the_driver_sleeps() {
    let mut readings = healthy();
    readings.report.pins[5].levels = HELD_LOW | level::IDLE_HIGH;
    // The break's pin keeps the output off.
    readings.report.breaks[10] = BreakWords {
        owner: Owner::Nut.word(),
        source: BreakSource::Pin.word(),
        comparator: 0,
        seen: seen::HELD | seen::FLAG,
    };
    let report = judge(&readings);
    assert_eq!(report.findings, 0, "{}", report.text());
    assert!(report.of(Verdict::Open).any(|item| item.id == "pin.PB10"));
    let pin = |item: &&Item| item.id == "break.nut.pin";
    assert_eq!(
        report.items.iter().find(pin).unwrap().verdict,
        Verdict::Good
    );
    // If it does not, the pin is not wired to the timer.
    readings.report.breaks[10].seen = seen::ENABLED | seen::RECOVERED | seen::OTHER_STAYED;
    let report = judge(&readings);
    let found: Vec<_> = report.of(Verdict::Finding).map(|item| &item.id).collect();
    assert_eq!(found, ["break.nut.pin"]);
}

#[test]
fn a_firmware_that_stops_on_the_way_is_told_with_what_it_read_before() {
    let mut readings = healthy();
    readings.stream = None;
    readings.report.stage = Stage::Breaks.word();
    let report = judge(&readings);
    let found: Vec<_> = report
        .of(Verdict::Finding)
        .map(|item| item.id.as_str())
        .collect();
    assert_eq!(found, ["stage"]);
    readings.crash = Some("the crystal does not start".into());
    assert!(
        judge(&readings)
            .text()
            .contains("the crystal does not start")
    );
    assert!(report.items.iter().any(|item| item.id == "pin.PA8"));
    assert!(
        !report
            .items
            .iter()
            .any(|item| item.id.starts_with("comparator"))
    );
}

#[test]
fn the_emulated_chip_s_count_has_both_current_loops() {
    assert!(bound("screw current loop").unwrap() > 300);
    assert!(bound("nut current loop").unwrap() > 300);
}
