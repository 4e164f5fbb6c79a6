//! Which sensor sees which fault of a power stage, and when: with sensors in the motor's lines and with low-side shunts.
//! The README's table of what stops the bridges is these figures.

use hal_sim::sensors::CurrentSensing::{self, InLine, LowSide};
use plant::machine::Coupling;
use plant::model::Model;
use std::f64::consts::TAU;
use tests::bench::{Bench, READY, RUNNING, power_stage};
use tests::chip::CORE_HZ;
use tests::chip::power::PowerFault::{self, Motor as Overload, ShootThrough, ToMinus};
use tests::chip::wiring::Wiring;
use tests::pins::Motor;

/// A driver that says nothing: the comparators alone.
const SILENT: f64 = f64::INFINITY;

fn running() -> Result<Bench, String> {
    let mut bench = Bench::new(&Model::paper(), Coupling::Lumped)?;
    bench.wait_for(READY, 0.2)?;
    bench.ask(2.5e-3, 300.0 * TAU / 60.0)?;
    bench.run(1)?;
    bench.pass(0.1)?;
    assert_eq!(bench.status()?.state, RUNNING);
    Ok(bench)
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

#[test]
fn each_sensor_sees_what_it_can() -> Result<(), String> {
    // The comparators' limit is 4.5 A, the analog watchdogs' 4.75.
    let overload = Overload([6.0, -3.0, -3.0]);
    let negative = Overload([-6.0, 3.0, 3.0]);
    let phases = Overload([20.0, -20.0, 0.0]);
    let earth = ToMinus {
        phase: 0,
        amps: 20.0,
    };
    let through = ShootThrough {
        phase: 0,
        amps: 50.0,
    };
    const DRIVER_A: f64 = 9.0;
    // us by the comparators and the watchdogs alone: the filter's 1 at the look's grain, a period, or the watchdogs' 300.
    const AT_ONCE: f64 = 1.25;
    const PERIOD: f64 = 51.0;
    const WATCHED: f64 = 300.0;
    let cases: [(&str, CurrentSensing, f64, PowerFault, Option<f64>); 14] = [
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
            Some(WATCHED),
        ),
        ("phase to phase", InLine, SILENT, phases, Some(AT_ONCE)),
        ("phase to earth", InLine, SILENT, earth, Some(PERIOD)),
        ("shoot-through", InLine, SILENT, through, None),
        (
            "over-current into the motor",
            LowSide,
            SILENT,
            overload,
            Some(WATCHED),
        ),
        (
            "over-current out of the motor",
            LowSide,
            SILENT,
            negative,
            Some(PERIOD),
        ),
        ("phase to phase", LowSide, SILENT, phases, Some(PERIOD)),
        ("phase to earth", LowSide, SILENT, earth, None),
        ("shoot-through", LowSide, SILENT, through, Some(AT_ONCE)),
        (
            "phase to phase, driver",
            LowSide,
            DRIVER_A,
            phases,
            Some(AT_ONCE),
        ),
        (
            "phase to earth, driver",
            LowSide,
            DRIVER_A,
            earth,
            Some(PERIOD),
        ),
        (
            "shoot-through, driver",
            LowSide,
            DRIVER_A,
            through,
            Some(AT_ONCE),
        ),
        (
            "shoot-through, driver",
            InLine,
            DRIVER_A,
            through,
            Some(AT_ONCE),
        ),
    ];
    let mut wrong = Vec::new();
    for (name, sensing, driver_a, fault, expected) in cases {
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
