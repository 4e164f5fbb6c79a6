//! Which sensor sees which fault of a power stage, and when: with sensors in the motor's lines and with low-side shunts.
//! The table of what stops the bridges (`docs/firmware.md`) is these figures.

use hal_sim::sensors::CurrentSensing::{self, InLine, LowSide};
use plant::machine::Coupling;
use plant::model::Model;
use tests::bench::{Bench, over_current_a, power_stage};
use tests::chip::CORE_HZ;
use tests::chip::power::PowerFault::{self, Motor as Overload, ShootThrough, ToMinus};
use tests::chip::wiring::Wiring;
use tests::pins::Motor;

/// A driver that says nothing: the comparators alone.
const SILENT: f64 = f64::INFINITY;

fn running() -> Result<Bench, String> {
    Bench::new(&Model::paper(), Coupling::Lumped)?.running(0.1)
}

/// Time from the fault until the screw's bridge is off, us; `None`: not within a millisecond.
fn off_after(
    sensing: CurrentSensing,
    driver_a: f64,
    fault: PowerFault,
) -> Result<Option<f64>, String> {
    let mut bench = running()?;
    // While all low sides conduct, the way down begins: an interrupt is half a period away.
    bench.settle_untold()?;
    bench.pass(6e-6)?;
    let stage = power_stage(Wiring::Nucleo, sensing, driver_a);
    let chip = bench.emulator.chip();
    let start = chip.now;
    chip.power_fault(Motor::Screw, Some((stage, fault)));
    for _ in 0..4000 {
        let chip = bench.emulator.chip();
        if !chip.pwm[0].bridge().enabled {
            return Ok(Some((chip.now - start) as f64 / CORE_HZ as f64 * 1e6));
        }
        bench.pass(0.25e-6)?;
    }
    Ok(None)
}

/// us: the filter's 0.75 at the grain of this test's looks; until the switch closes that shows it; until the next sample
/// has been looked at and its period is over.
const AT_ONCE: f64 = 1.25;
const PERIOD: f64 = 52.0;
const SAMPLED: f64 = 105.0;
/// Until the speed task has taken the analog watchdogs' flags.
const WATCHED: f64 = 300.0;

/// A fault, the sensors, the current at which the driver opens the bridge, and when the bridge is off at the latest, us.
type Case = (&'static str, CurrentSensing, f64, PowerFault, Option<f64>);

fn cases() -> [Case; 15] {
    let limit = over_current_a(Wiring::Nucleo);
    let phases = |factors: [f64; 3]| Overload(factors.map(|factor| factor * limit));
    let overload = phases([1.3, -0.65, -0.65]);
    let negative = phases([-1.3, 0.65, 0.65]);
    let short = phases([1.3, -1.3, 0.0]);
    let earth = ToMinus {
        phase: 0,
        amps: 1.5 * limit,
    };
    let through = ShootThrough {
        phase: 0,
        amps: 3.0 * limit,
    };
    let driver = 1.2 * limit;
    [
        (
            "over-current into the motor",
            InLine,
            SILENT,
            overload,
            Some(AT_ONCE),
        ),
        (
            "over-current out of the motor",
            InLine,
            SILENT,
            negative,
            Some(SAMPLED),
        ),
        ("phase to phase", InLine, SILENT, short, Some(AT_ONCE)),
        ("phase to earth", InLine, SILENT, earth, Some(PERIOD)),
        ("shoot-through", InLine, SILENT, through, None),
        (
            "over-current into the motor",
            LowSide,
            SILENT,
            overload,
            Some(PERIOD),
        ),
        (
            "over-current out of the motor",
            LowSide,
            SILENT,
            negative,
            Some(SAMPLED),
        ),
        ("phase to phase", LowSide, SILENT, short, Some(PERIOD)),
        ("phase to earth", LowSide, SILENT, earth, None),
        ("shoot-through", LowSide, SILENT, through, Some(WATCHED)),
        (
            "over-current out of the motor, driver",
            LowSide,
            driver,
            negative,
            Some(AT_ONCE),
        ),
        (
            "phase to phase, driver",
            LowSide,
            driver,
            short,
            Some(AT_ONCE),
        ),
        (
            "phase to earth, driver",
            LowSide,
            driver,
            earth,
            Some(PERIOD),
        ),
        (
            "shoot-through, driver",
            LowSide,
            driver,
            through,
            Some(AT_ONCE),
        ),
        (
            "shoot-through, driver",
            InLine,
            driver,
            through,
            Some(AT_ONCE),
        ),
    ]
}

#[test]
fn each_sensor_sees_what_it_can() -> Result<(), String> {
    let mut wrong = Vec::new();
    for (name, sensing, driver_a, fault, expected) in cases() {
        let off = off_after(sensing, driver_a, fault)?;
        println!("{sensing:?}, {name}: {off:.1?} us, at most {expected:?}");
        let right = match (off, expected) {
            (Some(off), Some(at_most)) => off <= at_most,
            (None, None) => true,
            _ => false,
        };
        if !right {
            wrong.push(format!("{sensing:?}, {name}: {off:?} us, not {expected:?}"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    Ok(())
}
