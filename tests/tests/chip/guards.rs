//! What the supervision and the analog watchdogs guard, provoked.

use link::codes::{Demand, Fault};
use plant::machine::Coupling;
use plant::model::Model;
use std::f64::consts::TAU;
use tests::bench::{
    Bench, FAULT, READY, RUNNING, board_config, counts_at, guards_of, plate_of, scale_count_m,
};
use tests::chip::wiring::Wiring;
use tests::pins::Motor;

fn running_on(board: Wiring) -> Result<Bench, String> {
    Bench::on(board, &Model::coupled(), Coupling::Coupled)?.running(0.4)
}

fn running() -> Result<Bench, String> {
    running_on(Wiring::Nucleo)
}

fn on(bench: &mut Bench) -> bool {
    let pwm = &bench.emulator.chip().pwm;
    pwm.iter().any(|timer| timer.bridge().enabled)
}

/// Time until both bridges are off, s, and the cause is this.
fn stops(bench: &mut Bench, cause: Fault, at_most: f64) -> Result<f64, String> {
    let passed = bench.until("both bridges off", at_most, 20e-6, |bench| Ok(!on(bench)))?;
    let status = bench.status()?;
    assert_eq!((status.state, status.fault), (FAULT, cause.word()));
    Ok(passed)
}

/// Time until the bridge of `motor` is off, which happens within `at_most`, s; the other brings the table to rest.
fn opens(bench: &mut Bench, motor: Motor, cause: Fault, at_most: f64) -> Result<f64, String> {
    let closed = |bench: &mut Bench| bench.emulator.chip().pwm[motor as usize].bridge().enabled;
    let passed = bench.until("its bridge off", at_most, 20e-6, |bench| Ok(!closed(bench)))?;
    let status = bench.status()?;
    assert_eq!((status.state, status.fault), (FAULT, cause.word()));
    Ok(passed)
}

/// The cause is gone: a reset leaves the fault and the drive runs again.
fn runs_again(bench: &mut Bench) -> Result<(), String> {
    bench.demand(Demand::Reset)?;
    bench.wait_for(READY, 1.0)?;
    bench.demand(Demand::Run)?;
    bench.pass(20e-3)?;
    let status = bench.status()?;
    assert_eq!(
        status.state, RUNNING,
        "after a reset and a start: {status:?}"
    );
    Ok(())
}

#[test]
fn the_bus_above_or_below_its_limits_opens_the_bridges() -> Result<(), String> {
    let mut bench = running()?;
    let (guards, board) = (guards_of(Wiring::Nucleo), board_config(Wiring::Nucleo));
    for (volts, cause, at_most) in [
        // The analog watchdog's flag, taken by the speed task.
        (1.02 * guards.bus_max_v, Fault::OverVoltage, 500e-6),
        // Two looks of the supervision.
        (0.9 * guards.bus_min_v, Fault::UnderVoltage, 3.5e-3),
    ] {
        bench.joint.borrow_mut().board.set_bus_voltage(volts);
        let took = stops(&mut bench, cause, at_most)?;
        println!("{volts} V: off after {:.0} us", 1e6 * took);
        bench.joint.borrow_mut().board.set_bus_voltage(board.bus_v);
        runs_again(&mut bench)?;
    }
    Ok(())
}

#[test]
fn a_hot_heat_sink_or_a_torn_sensor_brings_both_to_rest() -> Result<(), String> {
    for board in [Wiring::Nucleo, Wiring::Mains] {
        let mut bench = running_on(board)?;
        let feed = plate_of(board).feed;
        // From 300 rpm, the acceleration of a start that is under way taken back first: see `Profile`.
        let (omega, most) = (300.0 * TAU / 60.0, feed.base_acceleration_max);
        let stop = omega / most + 2.0 * most / feed.base_jerk_max;
        let limit = guards_of(board).temperatures[0].max_celsius;
        let cool = counts_at(board, 40.0);
        let warm = counts_at(board, limit - 1.0);
        bench.joint.borrow_mut().temperatures = warm;
        bench.pass(30e-3)?;
        assert_eq!(
            bench.status()?.state,
            RUNNING,
            "{board:?} below its limit of {limit} degrees"
        );
        for (temperatures, cause) in [
            (
                [counts_at(board, limit + 2.0)[0], cool[1]],
                Fault::ScrewTemperature,
            ),
            ([cool[0], 4095], Fault::NutTemperature),
        ] {
            bench.joint.borrow_mut().temperatures = temperatures;
            let took = stops(&mut bench, cause, 20e-3 + stop)?;
            println!("{board:?}: off after {:.1} ms", 1e3 * took);
            bench.joint.borrow_mut().temperatures = cool;
            runs_again(&mut bench)?;
        }
    }
    Ok(())
}

#[test]
fn an_over_current_of_either_sign_is_seen_by_the_analog_watchdogs() -> Result<(), String> {
    // No comparator sees a current out of the motor, which lowers the default board's counts and raises the mains board's.
    for (board, motor, cause, counts) in [
        (Wiring::Nucleo, Motor::Screw, Fault::ScrewOverCurrent, 90),
        (Wiring::Nucleo, Motor::Nut, Fault::NutOverCurrent, 90),
        (Wiring::Mains, Motor::Screw, Fault::ScrewOverCurrent, 4000),
        (Wiring::Mains, Motor::Nut, Fault::NutOverCurrent, 4000),
    ] {
        let mut bench = running_on(board)?;
        bench.settle_untold()?;
        bench.emulator.chip().short_circuit(motor, counts);
        let took = opens(&mut bench, motor, cause, 500e-6)?;
        println!("{board:?}, {motor:?}: off after {:.0} us", 1e6 * took);
        bench.emulator.chip().end_short_circuit(motor);
        runs_again(&mut bench)?;
    }
    Ok(())
}

#[test]
fn late_periods_are_counted_and_past_the_limit_a_fault() -> Result<(), String> {
    let mut bench = running()?;
    let missed = |bench: &mut Bench| bench.look().map(|view| view.words().motors[0].missed);
    assert_eq!(missed(&mut bench)?, 0);
    let late = |bench: &mut Bench| -> Result<(), String> {
        bench.settle_untold()?;
        // The loop's next read of its currents takes a period.
        bench.emulator.chip().provoked.slow_read[0] = Some(8500);
        bench.pass(1e-3)
    };
    for expected in 1..=5 {
        late(&mut bench)?;
        assert_eq!(missed(&mut bench)?, expected);
        assert_eq!(bench.status()?.state, RUNNING, "{expected} late");
        bench.pass(5e-3)?;
    }
    // They are forgiven, a hundred milliseconds each.
    bench.pass(0.6)?;
    for _ in 0..6 {
        late(&mut bench)?;
    }
    stops(&mut bench, Fault::ScrewLoopLate, 1e-3)?;
    assert_eq!(missed(&mut bench)?, 11);
    runs_again(&mut bench)
}

#[test]
fn a_missing_index_is_counted_and_past_a_limit_a_fault() -> Result<(), String> {
    let mut bench = running_on(Wiring::Mains)?;
    let nut_errors = |bench: &mut Bench| bench.look().map(|view| view.words().encoder_errors[1]);
    // Faster, for each turn has one index: 25 turns/s.
    bench.start(2.5e-3, 1500.0 * TAU / 60.0)?;
    bench.pass(0.5)?;
    assert_eq!(nut_errors(&mut bench)?, 0);
    bench.emulator.chip().provoked.no_index[1] = true;
    bench.pass(0.12)?;
    let errors = nut_errors(&mut bench)?;
    assert!((1..=2).contains(&errors), "{errors} in three turns");
    assert_eq!(bench.status()?.state, RUNNING);
    opens(&mut bench, Motor::Nut, Fault::NutEncoder, 1.0)?;
    Ok(())
}

/// The mains board's scale counts 10 nm: 16 bits are over every 0.26 s at 2.5 mm/s.
#[test]
fn the_scale_is_followed_through_its_wraps() -> Result<(), String> {
    let mut bench = running_on(Wiring::Mains)?;
    let count = scale_count_m(Wiring::Mains);
    let position = |bench: &mut Bench| -> Result<(f64, f64), String> {
        bench.settle_untold()?;
        let counts = bench.look()?.words().scale;
        let metres = bench.joint.borrow().board.machine.table_position();
        Ok((f64::from(counts) * count, metres))
    };
    let (scale, table) = position(&mut bench)?;
    bench.pass(0.6)?;
    let (scale_then, table_then) = position(&mut bench)?;
    let moved = table_then - table;
    assert!(
        moved > 2.0 * 65_536.0 * count,
        "{moved} m are not two wraps"
    );
    // A speed step's time at 2.5 mm/s is half a micrometre.
    let off = scale_then - scale - moved;
    println!(
        "{:.1} um of table, the scale is {:.3} um off",
        1e6 * moved,
        1e6 * off
    );
    assert!(off.abs() < 0.6e-6, "{off} m off after {moved} m");
    Ok(())
}
