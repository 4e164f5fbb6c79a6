//! The flashed ELF turns the motors of the simulated machine.

use link::codes::Demand;
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;
use std::f64::consts::TAU;
use tests::bench::{Bench, READY, RUNNING, plate_of};
use tests::chip::wiring::Wiring;

/// Mean speeds of screw and nut over `seconds`, rad/s.
fn mean_speeds(bench: &mut Bench, seconds: f64) -> Result<[f64; 2], String> {
    let angles = |bench: &Bench| {
        [Axis::Screw, Axis::Nut].map(|axis| bench.joint.borrow().board.machine.motor(axis).theta)
    };
    let before = angles(bench);
    bench.pass(seconds)?;
    let after = angles(bench);
    Ok([
        (after[0] - before[0]) / seconds,
        (after[1] - before[1]) / seconds,
    ])
}

#[test]
fn boots_calibrates_runs_in_both_modes_and_stops() -> Result<(), String> {
    for (board, model, coupling) in [
        (Wiring::Nucleo, Model::paper(), Coupling::Lumped),
        (Wiring::Nucleo, Model::coupled(), Coupling::Coupled),
        // The screw's encoder on SPI, the nut's with index.
        (Wiring::Mains, Model::coupled(), Coupling::Coupled),
    ] {
        let mut bench = Bench::on(board, &model, coupling)?;
        bench.wait_for(READY, 0.2)?;
        for base_rpm in [0.0, 300.0] {
            let base = base_rpm * TAU / 60.0;
            bench.start(2.5e-3, base)?;
            bench.pass(0.5)?;
            let status = bench.status()?;
            assert_eq!(
                status.state, RUNNING,
                "{board:?}, {coupling:?} at {base_rpm} rpm: {status:?}"
            );
            // Three beats of the motors' 6th harmonics at 30 rpm of difference: 66.7 ms each with five pole pairs.
            let beat = 1.0 / (6.0 * f64::from(plate_of(board).motors[0].pole_pairs) * 0.5);
            let [screw, nut] = mean_speeds(&mut bench, 3.0 * beat)?;
            let table = (screw - nut) * model.feed.lead_m / TAU;
            assert!(
                (table - 2.5e-3).abs() < 2.5e-5,
                "{board:?}, {coupling:?} at {base_rpm} rpm: the table moves at {table} m/s"
            );
            assert!(
                (nut - base).abs() < 0.01 * base + 0.05,
                "{board:?}, {coupling:?}: the nut turns at {nut} rad/s, not {base}"
            );
        }
        bench.demand(Demand::Rest)?;
        bench.wait_for(READY, 1.0)?;
        // The current loops follow the supervisor in their next periods.
        bench.pass(100e-6)?;
        let chip = bench.emulator.chip();
        assert!(
            chip.pwm.iter().all(|timer| !timer.bridge().enabled),
            "a drive at rest has its bridges off"
        );
        assert_eq!(bench.look()?.words().encoder_wrong, [0; 2], "{board:?}");
    }
    Ok(())
}

/// From the reset on, until it is asked to run, and after it has come to rest.
#[test]
fn no_bridge_is_closed_before_it_is_asked_to_run() -> Result<(), String> {
    for board in [Wiring::Nucleo, Wiring::Mains] {
        let mut bench = Bench::on(board, &Model::paper(), Coupling::Lumped)?;
        bench.emulator.chip().tops = Some(Vec::new());
        bench.wait_for(READY, 0.2)?;
        bench.pass(20e-3)?;
        let tops = bench.emulator.chip().tops.take().unwrap_or_default();
        assert!(tops.len() > 800, "{} tops of both timers", tops.len());
        let closed = tops.iter().find(|top| top.bridge.enabled);
        assert!(
            closed.is_none(),
            "{board:?}: a bridge is closed before the drive was asked to run: {closed:?}"
        );
    }
    Ok(())
}
