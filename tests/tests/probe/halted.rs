//! A core halted while the drive turns at 800 rpm under load: what the board does meanwhile and afterwards.

use crate::emulated::{Emulated, PATIENCE};
use crate::figures::keep;
use control::journal::Event;
use hal_sim::experiment::RPM;
use link::codes::{EventKind, Fault};
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;
use serde_json::json;
use std::thread;
use std::time::Duration;
use tests::bench::{Bench, FAULT, READY, RUNNING};
use tests::chip::{CORE_HZ, Top};
use tests::emulator::HaltedTime;

/// What the table moves at most while the machine takes a step, m: 0.2 m/s for 25 us.
const STEP_M: f64 = 5e-6;
/// How long the core is halted.
const HALT: Duration = Duration::from_millis(100);

fn at_800_rpm() -> Result<Bench, String> {
    let mut bench = Bench::new(&Model::paper(), Coupling::Lumped)?;
    bench.wait_for(READY, 0.2)?;
    bench.start(2.5e-3, 800.0 * RPM)?;
    bench.pass(1.0)?;
    bench.emulator.chip().tops = Some(Vec::new());
    // What comes later is of the halt.
    bench.log()?;
    assert_eq!(bench.status()?.state, RUNNING);
    Ok(bench)
}

fn table(bench: &Bench) -> f64 {
    bench.joint.borrow().board.machine.table_position()
}

fn currents(bench: &Bench) -> f64 {
    let joint = bench.joint.borrow();
    let all = Axis::ALL.map(|axis| joint.board.machine.phase_currents(axis));
    all.iter()
        .flatten()
        .fold(0.0, |most, current| current.abs().max(most))
}

#[test]
fn on_a_running_board_the_bridges_open_at_once_and_the_drive_says_why() {
    // To attach, the library halts the core for a moment: meanwhile the board waits, so that the halt below is the first.
    let chip = Emulated::start(HaltedTime::Frozen, at_800_rpm);
    let mut session = chip.attach().unwrap();
    let mut core = session.core(0).unwrap();
    chip.ask(|bench| bench.emulator.halted_time = HaltedTime::Running);
    let tops = |bench: &mut Bench| bench.emulator.chip().tops.take().unwrap_or_default();
    core.halt(PATIENCE).unwrap();
    let opened = chip.ask(|bench| {
        let chip = bench.emulator.chip();
        let opened = [0, 1].map(|motor: usize| chip.pwm[motor].held());
        (chip.nvic.held(), opened)
    });
    let (Some(halted), [Some(screw), Some(nut)]) = opened else {
        panic!("the bridges' timers do not stop with the core: {opened:?}");
    };
    let bridges_open_us = (screw.max(nut) - halted) as f64 / (CORE_HZ as f64 * 1e-6);
    let open = chip.ask(|bench| {
        let chip = bench.emulator.chip();
        chip.pwm.iter().all(|timer| !timer.bridge().enabled)
    });
    assert!(open, "the bridges are driven while the core is halted");
    thread::sleep(HALT);
    let (passed, there, current) = chip.ask(move |bench| {
        (
            bench.emulator.time() - halted,
            table(bench),
            currents(bench),
        )
    });
    let passed_s = passed as f64 / CORE_HZ as f64;
    assert!(
        passed_s >= 0.9 * HALT.as_secs_f64(),
        "{passed_s} s of the board's time"
    );
    assert!(current < 0.05, "{current} A flow through open bridges");
    // The same machine, whose bridges are opened without a debugger, goes as far.
    let mut twin = at_800_rpm().unwrap();
    let until_halt = (halted - twin.emulator.time()) as f64 / CORE_HZ as f64;
    twin.pass(until_halt).unwrap();
    let place = table(&twin);
    let half = twin.emulator.chip().pwm[0].period() / 2;
    let mut joint = twin.joint.borrow_mut();
    for axis in Axis::ALL {
        joint.board.trip_break(axis);
    }
    for _ in 0..passed / half {
        joint.board.advance();
    }
    drop(joint);
    let expected = table(&twin);
    assert!(
        (there - expected).abs() < STEP_M,
        "{there} m, without a debugger {expected} m"
    );
    core.run().unwrap();
    let after = chip.ask(move |bench| {
        bench.pass(20e-3)?;
        let resets = bench.emulator.resets.clone();
        Ok::<_, String>((bench.status()?, bench.log()?, resets, tops(bench)))
    });
    let (status, log, resets, tops) = after.unwrap();
    // The watchdog stood with the core.
    assert_eq!(resets, []);
    assert_eq!(status.state, FAULT, "{status:?}");
    let fault = Fault::of_word(status.fault).expect("the fault has a name");
    // `drive faults` tells it afterwards, too.
    let journal = chip.ask(|bench| bench.journal()).unwrap();
    let told = |event: Event| (event.kind, event.code) == (EventKind::Fault.word(), status.fault);
    assert!(
        journal.latest().any(told),
        "{:#?}",
        journal.latest().collect::<Vec<_>>()
    );
    keep(
        "halted.running",
        json!({
            "halted_s": passed_s,
            "bridges_open_us": bridges_open_us,
            "travel_um": 1e6 * (there - place),
            "current_a": current,
            "fault": fault.name(),
            "log": log,
        }),
    );
    let driven = |top: &&Top| top.time > halted && top.bridge.enabled;
    assert_eq!(
        tops.iter().filter(driven).count(),
        0,
        "the bridges are driven again"
    );
}

#[test]
fn on_a_frozen_board_a_halt_changes_nothing() {
    let chip = Emulated::start(HaltedTime::Frozen, at_800_rpm);
    let mut session = chip.attach().unwrap();
    let mut core = session.core(0).unwrap();
    core.halt(PATIENCE).unwrap();
    let before = chip.ask(|bench| (bench.emulator.time(), table(bench), currents(bench)));
    thread::sleep(HALT);
    let after = chip.ask(|bench| (bench.emulator.time(), table(bench), currents(bench)));
    assert_eq!(before, after);
    assert!(
        before.2 > 0.1,
        "the motors carry {} A, and should be at work",
        before.2
    );
    core.run().unwrap();
    let status = chip.ask(|bench| {
        bench.pass(20e-3)?;
        bench.status()
    });
    let status = status.unwrap();
    assert_eq!((status.state, status.fault), (RUNNING, 0));
    keep(
        "halted.frozen",
        json!({
            // They stay closed.
            "bridges_open_us": null,
            "travel_um": 1e6 * (after.1 - before.1),
            "current_a": after.2,
            "fault": null,
        }),
    );
}
