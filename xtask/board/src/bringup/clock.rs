//! Crystal, oscillators, power range, wait states.

use super::Item;
use link::bringup::{
    ClockWords, EDGES_A_CAPTURE, ExpectedWords, HSI_CAPTURES, LSI_CAPTURES, ReportWords,
};

const GROUP: &str = "Clock and power";

/// HSI16 as it reaches the timer, Hz, and how far it may be off: 1 % by the features page; half a percent more for its
/// drift with temperature (memory).
const HSI_HZ: f64 = 1e6;
const HSI_OFF: f64 = 0.015;
/// LSI, Hz, as the watchdog's time is computed, and what it may be over supply and temperature.
const LSI_HZ: f64 = 32e3;
const LSI_RANGE_HZ: [f64; 2] = [29.5e3, 34e3];
/// Crystals that boards have, MHz.
const CRYSTALS: [f64; 9] = [4.0, 8.0, 12.0, 16.0, 20.0, 24.0, 25.0, 32.0, 48.0];

pub(super) fn items(words: &ReportWords) -> Vec<Item> {
    let (clock, expected) = (&words.clock, &words.expected);
    let core_hz = core_hz(clock);
    vec![
        source(clock),
        crystal(expected, core_hz),
        watchdog(clock, core_hz.unwrap_or(f64::from(expected.core_hz))),
        boost(clock),
        wait_states(clock),
    ]
}

/// The core's clock by HSI16.
fn core_hz(clock: &ClockWords) -> Option<f64> {
    let periods = f64::from(HSI_CAPTURES * EDGES_A_CAPTURE);
    (clock.hsi > 0).then(|| f64::from(clock.hsi) / periods * HSI_HZ)
}

fn source(clock: &ClockWords) -> Item {
    const HSE_READY: u32 = 1 << 17;
    const PLL_READY: u32 = 1 << 25;
    let switch = clock.rcc_cfgr >> 2 & 3;
    let pll = clock.rcc_pllcfgr & 3;
    let ready = clock.rcc_cr & (HSE_READY | PLL_READY) == HSE_READY | PLL_READY;
    let switched = ["nothing", "HSI16", "the crystal (HSE)", "the PLL"][switch as usize];
    let from = ["nothing", "nothing", "HSI16", "the crystal"][pll as usize];
    let item = Item::new(
        GROUP,
        "clock.source",
        "what the core runs from",
        "RM0440 7.4.3 and 7.4.4, RCC_CFGR.SWS and RCC_PLLCFGR.PLLSRC",
    )
    .expected("the PLL, fed by the crystal")
    .read(match switch {
        3 => format!("{switched}, fed by {from}"),
        _ => switched.into(),
    });
    if switch == 3 && pll == 3 && ready {
        item
    } else {
        item.finding(
            "The core is not clocked as the firmware set it up: the crystal has failed since, or never started.",
            "Check crystal and load capacitors; on a NUCLEO the solder bridges of X3.",
        )
    }
}

fn crystal(expected: &ExpectedWords, core_hz: Option<f64>) -> Item {
    let nominal = f64::from(expected.crystal_hz);
    let item = Item::new(
        GROUP,
        "clock.crystal",
        "crystal, by the core's clock against HSI16",
        "DS12288, features: HSI16 within 1 %; RM0440 31.4.5: TIM16 captures MCO",
    )
    .expected(format!(
        "{:.2} MHz within {:.1} %",
        nominal / 1e6,
        100.0 * HSI_OFF
    ));
    let Some(core_hz) = core_hz else {
        return item.read("no edge of HSI16 / 16").finding(
            "HSI16 does not start, or TIM16 does not capture it, so the crystal is not known.",
            "Another chip: both are inside it.",
        );
    };
    let hz = nominal * core_hz / f64::from(expected.core_hz);
    let item = item.read(format!(
        "{:.2} MHz (core {:.1} MHz)",
        hz / 1e6,
        core_hz / 1e6
    ));
    if (hz / nominal - 1.0).abs() <= HSI_OFF {
        return item;
    }
    let nearest = CRYSTALS
        .iter()
        .copied()
        .find(|mhz| (hz / 1e6 / mhz - 1.0).abs() <= HSI_OFF);
    let looks = nearest.map_or("It is none of the usual ones".to_owned(), |mhz| {
        format!("It looks like one of {mhz} MHz")
    });
    item.finding(
        format!(
            "The crystal is not the one that the firmware is built for. {looks}. Every time in the drive is off by the \
             same factor: PWM, dead time, speeds, watchdogs."
        ),
        "Fit the right crystal, or give the firmware the right dividers (`firmware/src/hw/clock.rs`).",
    )
}

fn watchdog(clock: &ClockWords, core_hz: f64) -> Item {
    let [least, most] = LSI_RANGE_HZ;
    let item = Item::new(
        GROUP,
        "clock.lsi",
        "LSI, the watchdog's clock",
        "DS12288 Rev 6, LSI oscillator: 29.5 to 34 kHz",
    )
    .expected(format!("{:.1} to {:.1} kHz", least / 1e3, most / 1e3));
    let periods = f64::from(LSI_CAPTURES * EDGES_A_CAPTURE);
    if clock.lsi == 0 {
        return item.read("no edge").finding(
            "LSI does not start: the independent watchdog would not bite, and nothing would end a hung supervision.",
            "Another chip.",
        );
    }
    let hz = core_hz * periods / f64::from(clock.lsi);
    let item = item.read(format!("{:.2} kHz", hz / 1e3));
    if (least..=most).contains(&hz) {
        item
    } else {
        item.finding(
            format!("The watchdog's 20 ms are {:.0} ms.", 20.0 * LSI_HZ / hz),
            "Look at the crystal's item first: both are measured by the core's clock.",
        )
    }
}

fn boost(clock: &ClockWords) -> Item {
    const PWR_CLOCK: u32 = 1 << 28;
    const R1MODE: u32 = 1 << 8;
    const VOSF: u32 = 1 << 10;
    let range = clock.pwr_cr1 >> 9 & 3;
    let boosted = clock.pwr_cr5 & R1MODE == 0;
    let settled = clock.pwr_sr2 & VOSF == 0;
    let item = Item::new(
        GROUP,
        "power.boost",
        "voltage range and boost mode",
        "RM0440 6.1.5: above 150 MHz range 1 with boost; 6.4.1, 6.4.19: VOS, R1MODE (0 is boost)",
    )
    .expected("range 1, boost on")
    .read(format!(
        "range {range}, boost {}{}",
        if boosted { "on" } else { "off" },
        if settled {
            ""
        } else {
            ", regulator not settled"
        }
    ));
    if range == 1 && boosted && settled {
        return item;
    }
    let clocked = clock.apb1enr1 & PWR_CLOCK != 0;
    item.finding(
        if clocked {
            "170 MHz run at a core voltage that is meant for 150 MHz: what is computed may be wrong, more so when it is \
             hot or the supply low."
        } else {
            "The power control had no clock (RCC_APB1ENR1.PWREN) when boost mode was written, and did not take it: 170 \
             MHz run at a core voltage that is meant for 150 MHz."
        },
        "Do not switch the bus on. Set PWREN before boost mode is written, and refuse to start unless it reads back \
         (`firmware/src/hw/clock.rs`).",
    )
}

fn wait_states(clock: &ClockWords) -> Item {
    const CACHES: u32 = 7 << 8;
    let (latency, caches) = (clock.flash_acr & 15, clock.flash_acr & CACHES);
    let item = Item::new(
        GROUP,
        "flash.wait",
        "flash wait states",
        "RM0440 5.3.3, table 29: 4 at 170 MHz in range 1 with boost; 5.3.4: prefetch and caches",
    )
    .expected("4, prefetch and caches on")
    .read(format!(
        "{latency}, prefetch and caches {}",
        if caches == CACHES { "on" } else { "not all on" }
    ));
    match latency {
        4 if caches == CACHES => item,
        0..=3 => item.finding(
            "The flash is read faster than it can be: instructions may be read wrong.",
            "Do not switch the bus on; see `firmware/src/hw/clock.rs`.",
        ),
        _ => item.finding(
            "Code in flash runs slower than it could; the current loops are in CCM and do not.",
            "See `firmware/src/hw/clock.rs`.",
        ),
    }
}
