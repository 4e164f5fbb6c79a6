//! What the supervision and the analog watchdogs guard, provoked.

use plant::machine::Coupling;
use plant::model::Model;
use std::f64::consts::TAU;
use tests::bench::{Bench, FAULT, READY, RUNNING, counts_at, plate};
use tests::chip::wiring::Wiring;
use tests::pins::Motor;

/// Numbers of `control::supervisor::Fault`.
#[derive(Clone, Copy)]
enum Cause {
    NutEncoder = 6,
    OverVoltage = 8,
    UnderVoltage = 9,
    ScrewTemperature = 10,
    NutTemperature = 11,
    ScrewOverCurrent = 12,
    NutOverCurrent = 13,
    ScrewLoopLate = 14,
}

fn running_on(board: Wiring) -> Result<Bench, String> {
    let mut bench = Bench::on(board, &Model::paper(), Coupling::Lumped)?;
    bench.wait_for(READY, 0.2)?;
    bench.ask(2.5e-3, 300.0 * TAU / 60.0)?;
    bench.run(1)?;
    bench.pass(0.4)?;
    assert_eq!(bench.status()?.state, RUNNING);
    Ok(bench)
}

fn running() -> Result<Bench, String> {
    running_on(Wiring::Nucleo)
}

fn on(bench: &mut Bench) -> bool {
    let pwm = &bench.emulator.chip().pwm;
    pwm.iter().any(|timer| timer.bridge().enabled)
}

/// Time until both bridges are off, s, and the cause is this.
fn stops(bench: &mut Bench, cause: Cause, at_most: f64) -> Result<f64, String> {
    const LOOK: f64 = 20e-6;
    let mut passed = 0.0;
    while on(bench) {
        if passed > at_most {
            return Err(format!(
                "a bridge is on after {passed} s: {:?}",
                bench.status()?
            ));
        }
        bench.pass(LOOK)?;
        passed += LOOK;
    }
    let status = bench.status()?;
    assert_eq!((status.state, status.fault), (FAULT, cause as u32));
    Ok(passed)
}

/// The cause is gone: a reset leaves the fault and the drive runs again.
fn runs_again(bench: &mut Bench) -> Result<(), String> {
    bench.run(2)?;
    bench.wait_for(READY, 1.0)?;
    bench.run(1)?;
    bench.pass(20e-3)?;
    assert_eq!(bench.status()?.state, RUNNING);
    Ok(())
}

#[test]
fn the_bus_above_or_below_its_limits_opens_the_bridges() -> Result<(), String> {
    let mut bench = running()?;
    for (volts, cause, at_most) in [
        // The analog watchdog's flag, taken by the speed task.
        (405.0, Cause::OverVoltage, 500e-6),
        // Two looks of the supervision.
        (50.0, Cause::UnderVoltage, 3.5e-3),
    ] {
        bench.joint.borrow_mut().board.set_bus_voltage(volts);
        let took = stops(&mut bench, cause, at_most)?;
        println!("{volts} V: off after {:.0} us", 1e6 * took);
        bench.joint.borrow_mut().board.set_bus_voltage(310.0);
        runs_again(&mut bench)?;
    }
    Ok(())
}

#[test]
fn a_hot_heat_sink_or_a_torn_sensor_opens_the_bridges() -> Result<(), String> {
    for board in [Wiring::Nucleo, Wiring::Custom] {
        let mut bench = running_on(board)?;
        let cool = counts_at(board, 40.0);
        let warm = counts_at(board, 84.0);
        bench.joint.borrow_mut().temperatures = warm;
        bench.pass(30e-3)?;
        assert_eq!(bench.status()?.state, RUNNING, "{board:?} at 84 degrees");
        for (temperatures, cause) in [
            (
                [counts_at(board, 92.0)[0], cool[1]],
                Cause::ScrewTemperature,
            ),
            ([cool[0], 4095], Cause::NutTemperature),
        ] {
            bench.joint.borrow_mut().temperatures = temperatures;
            let took = stops(&mut bench, cause, 20e-3)?;
            println!("{board:?}: off after {:.1} ms", 1e3 * took);
            bench.joint.borrow_mut().temperatures = cool;
            runs_again(&mut bench)?;
        }
    }
    Ok(())
}

#[test]
fn an_over_current_of_either_sign_is_seen_by_the_analog_watchdogs() -> Result<(), String> {
    // No comparator sees a negative current.
    for (motor, cause) in [
        (Motor::Screw, Cause::ScrewOverCurrent),
        (Motor::Nut, Cause::NutOverCurrent),
    ] {
        let mut bench = running()?;
        bench.settle_untold()?;
        bench.emulator.chip().short_circuit(motor, 90);
        let took = stops(&mut bench, cause, 500e-6)?;
        println!("{motor:?}: off after {:.0} us", 1e6 * took);
        bench.emulator.chip().end_short_circuit(motor);
        runs_again(&mut bench)?;
    }
    Ok(())
}

#[test]
fn late_periods_are_counted_and_past_the_limit_a_fault() -> Result<(), String> {
    let mut bench = running()?;
    const SCREW_MISSED: u32 = 14 + 5;
    let missed = |bench: &Bench| bench.word_of_view(SCREW_MISSED);
    assert_eq!(missed(&bench)?, 0);
    let late = |bench: &mut Bench| -> Result<(), String> {
        bench.settle_untold()?;
        // The loop's next read of its currents takes a period.
        bench.emulator.chip().provoked.slow_read[0] = Some(8500);
        bench.pass(1e-3)
    };
    for expected in 1..=5 {
        late(&mut bench)?;
        assert_eq!(missed(&bench)?, expected);
        assert_eq!(bench.status()?.state, RUNNING, "{expected} late");
        bench.pass(5e-3)?;
    }
    // They are forgiven, a hundred milliseconds each.
    bench.pass(0.6)?;
    for _ in 0..6 {
        late(&mut bench)?;
    }
    stops(&mut bench, Cause::ScrewLoopLate, 1e-3)?;
    assert_eq!(missed(&bench)?, 11);
    runs_again(&mut bench)
}

#[test]
fn a_missing_index_is_counted_and_past_a_limit_a_fault() -> Result<(), String> {
    let mut bench = running_on(Wiring::Custom)?;
    const NUT_ERRORS: u32 = 33;
    // Faster, for each turn has one index: 25 turns/s.
    bench.ask(2.5e-3, 1500.0 * TAU / 60.0)?;
    bench.pass(0.5)?;
    assert_eq!(bench.word_of_view(NUT_ERRORS)?, 0);
    bench.emulator.chip().provoked.no_index[1] = true;
    bench.pass(0.12)?;
    let errors = bench.word_of_view(NUT_ERRORS)?;
    assert!((1..=2).contains(&errors), "{errors} in three turns");
    assert_eq!(bench.status()?.state, RUNNING);
    stops(&mut bench, Cause::NutEncoder, 1.0)?;
    Ok(())
}

/// The scale counts nanometres: 16 bits are over every 26 ms at 2.5 mm/s.
#[test]
fn the_scale_is_followed_through_its_wraps() -> Result<(), String> {
    let mut bench = running()?;
    const SCALE: u32 = 10;
    let position = |bench: &mut Bench| -> Result<(f64, f64), String> {
        bench.settle_untold()?;
        let counts = bench.word_of_view(SCALE)?.cast_signed();
        let metres = bench.joint.borrow().board.machine.table_position();
        Ok((f64::from(counts) * 1e-9, metres))
    };
    let (scale, table) = position(&mut bench)?;
    bench.pass(0.3)?;
    let (scale_then, table_then) = position(&mut bench)?;
    let moved = table_then - table;
    assert!(moved > 10.0 * 65_536e-9, "{moved} m are many wraps");
    // A speed step's time at 2.5 mm/s is half a micrometre.
    let off = scale_then - scale - moved;
    println!(
        "{:.1} um of table, the scale is {:.3} um off",
        1e6 * moved,
        1e6 * off
    );
    assert!(off.abs() < 0.6e-6, "{off} m off after {moved} m");
    assert_eq!(plate().board.speed_divider, 4);
    Ok(())
}
