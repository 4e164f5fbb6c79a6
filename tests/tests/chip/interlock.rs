//! A command that times out, an open enable, an end switch ahead: the emulated drive comes to rest with both motors, and
//! then opens its bridges and says why, as the host's does (`tests/bench/tests/interlock.rs`).

use link::codes::{Demand, Fault};
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;
use std::f64::consts::TAU;
use tests::bench::{Bench, FAULT, READY, RUNNING, plate_of};
use tests::chip::outside::{Circuit, contacts};
use tests::chip::wiring::Wiring;

fn running(board: Wiring, velocity: f64) -> Result<Bench, String> {
    let mut bench = Bench::on(board, &Model::coupled(), Coupling::Coupled)?;
    bench.wait_for(READY, 0.3)?;
    bench.start(velocity, 300.0 * TAU / 60.0)?;
    bench.wait_for(RUNNING, 0.01)?;
    bench.pass(0.25)?;
    Ok(bench)
}

fn speeds(bench: &Bench) -> [f64; 2] {
    let joint = bench.joint.borrow();
    Axis::ALL.map(|axis| joint.board.machine.motor(axis).omega)
}

/// Each pin by its board, with its own fault. An end switch that opens behind a table that moves away from it is the other one, or
/// torn.
#[test]
fn each_input_and_a_lost_command_stop_the_machine() -> Result<(), String> {
    for board in [Wiring::Nucleo, Wiring::Mains] {
        let [enable, second, forward, backward] = contacts(board);
        for (pin, velocity, fault) in [
            (Some(enable), 2.5e-3, Fault::Disabled),
            (Some(second), 2.5e-3, Fault::Disabled),
            (Some(forward), 2.5e-3, Fault::EndForward),
            (Some(backward), 2.5e-3, Fault::EndsExchanged),
            (None, 2.5e-3, Fault::CommandLost),
            (Some(backward), -2.5e-3, Fault::EndBackward),
        ] {
            let said = format!("{board:?}, {pin:?} at {velocity} m/s");
            let mut bench = running(board, velocity)?;
            let heartbeat_s = plate_of(board).command.heartbeat_s;
            match pin {
                // A broken wire.
                Some(pin) => drop(bench.emulator.chip().outside.circuits.remove(&pin)),
                None => bench.attended = false,
            }
            let before = speeds(&bench);
            if pin.is_none() {
                bench.pass(heartbeat_s - 0.26)?;
                assert_eq!(bench.status()?.state, RUNNING, "{said}: before its time");
            }
            bench.wait_for(FAULT, 0.6)?;
            assert_eq!(bench.status()?.fault, fault.word(), "{said}");
            let after = speeds(&bench);
            let rests = after
                .iter()
                .zip(before)
                .all(|(after, before)| after.abs() < 0.05 * before.abs());
            assert!(
                rests,
                "{said}: the bridges opened at {after:?} rad/s, of {before:?} rad/s, expected at rest"
            );
        }
    }
    Ok(())
}

/// One contact of the enable switch opens and the other does not, as where it is welded: the drive is not armed again before both were
/// seen open.
#[test]
fn an_enable_contact_that_opens_alone_is_told_and_must_open_with_the_other() -> Result<(), String> {
    for board in [Wiring::Nucleo, Wiring::Mains] {
        let [one, other, ..] = contacts(board);
        let mut bench = running(board, 2.5e-3)?;
        let wire = |bench: &mut Bench, pin, closed| {
            let circuits = &mut bench.emulator.chip().outside.circuits;
            match closed {
                true => circuits.insert(pin, Circuit::Driven(false)),
                false => circuits.remove(&pin),
            };
        };
        wire(&mut bench, one, false);
        bench.wait_for(FAULT, 0.6)?;
        assert_eq!(bench.status()?.fault, Fault::Disabled.word(), "{board:?}");
        bench.pass(0.6)?;
        let apart = (FAULT, Fault::EnableApart.word());
        let said = |bench: &mut Bench| bench.status().map(|status| (status.state, status.fault));
        assert_eq!(said(&mut bench)?, apart, "{board:?}: open alone");

        wire(&mut bench, one, true);
        bench.demand(Demand::Reset)?;
        bench.pass(0.05)?;
        assert_eq!(said(&mut bench)?, apart, "{board:?}: closed again");

        for closed in [false, true] {
            wire(&mut bench, one, closed);
            wire(&mut bench, other, closed);
            bench.pass(0.02)?;
        }
        bench.wait_for(READY, 0.2)?;
    }
    Ok(())
}
