//! Faults, provoked: the bridge's output enable falls in time, and the state says why.

use link::codes::{Demand, EventKind, Fault, Origin, ResetReason, State};
use link::host::Memory;
use link::view::DriveView;
use plant::machine::Coupling;
use plant::model::Model;
use std::mem::offset_of;
use tests::bench::{Bench, FAULT, READY, RUNNING, plate_of};
use tests::chip::wiring::Wiring;
use tests::chip::{CORE_HZ, Reset};
use tests::pins::Motor;

const PERIOD_S: f64 = 50e-6;

/// A drive at 300 rpm with the table moving.
fn running() -> Result<Bench, String> {
    running_on(Wiring::Nucleo)
}

fn running_on(board: Wiring) -> Result<Bench, String> {
    let mut bench = Bench::on(board, &Model::coupled(), Coupling::Coupled)?.running(0.4)?;
    assert!(enabled(&mut bench, Motor::Screw) && enabled(&mut bench, Motor::Nut));
    Ok(bench)
}

fn enabled(bench: &mut Bench, motor: Motor) -> bool {
    bench.emulator.chip().pwm[motor as usize].bridge().enabled
}

/// Time from now until the bridge of `motor` is off, s, to 0.1 us and an emulated block.
fn until_off(bench: &mut Bench, motor: Motor, at_most: f64) -> Result<f64, String> {
    let start = bench.emulator.chip().now;
    let what = format!("the {motor:?}'s bridge off");
    bench.until(&what, at_most, 1e-7, |bench| Ok(!enabled(bench, motor)))?;
    Ok((bench.emulator.chip().now - start) as f64 / CORE_HZ as f64)
}

fn assert_cause(bench: &mut Bench, cause: Fault) -> Result<(), String> {
    let status = bench.status()?;
    assert_eq!((status.state, status.fault), (FAULT, cause.word()));
    Ok(())
}

#[test]
fn an_over_current_opens_the_bridge_in_hardware() -> Result<(), String> {
    // A current into the motor raises the default board's counts and lowers the mains board's.
    for (board, motor, other, cause, counts) in [
        (
            Wiring::Nucleo,
            Motor::Screw,
            Motor::Nut,
            Fault::ScrewBreak,
            4000,
        ),
        (
            Wiring::Nucleo,
            Motor::Nut,
            Motor::Screw,
            Fault::NutBreak,
            4000,
        ),
        (
            Wiring::Mains,
            Motor::Screw,
            Motor::Nut,
            Fault::ScrewBreak,
            90,
        ),
        (Wiring::Mains, Motor::Nut, Motor::Screw, Fault::NutBreak, 90),
    ] {
        let mut bench = running_on(board)?;
        // In the middle of a period, with no interrupt near.
        bench.settle_untold()?;
        bench.pass(PERIOD_S / 4.0)?;
        bench.emulator.chip().short_circuit(motor, counts);
        // The break's filter waits for 0.75 us; no interrupt is near.
        let off = until_off(&mut bench, motor, 2e-6)?;
        assert!(
            off <= 1e-6,
            "{motor:?}: off after {off} s, not with the filter's end"
        );
        bench.pass(6.0 * PERIOD_S)?;
        assert_cause(&mut bench, cause)?;
        // The other motor brings the table to rest: `tests/bench/tests/fault_matrix.rs`.
        assert!(enabled(&mut bench, other) && !enabled(&mut bench, motor));
        // It stays off while the current is there, whatever is asked.
        bench.demand(Demand::Reset)?;
        bench.pass(1e-3)?;
        assert_cause(&mut bench, cause)?;
        assert!(!enabled(&mut bench, motor));
        // Once it is gone a reset leaves the fault, and the drive runs again.
        bench.emulator.chip().end_short_circuit(motor);
        bench.wait_for(READY, 0.2)?;
        bench.demand(Demand::Run)?;
        bench.pass(10e-3)?;
        assert_eq!(bench.status()?.state, RUNNING);
        assert!(enabled(&mut bench, motor));
    }
    Ok(())
}

/// Ringing, or the dip of an ADC's sampling capacitor, is over before the filter is.
#[test]
fn a_spike_shorter_than_the_filter_is_no_fault() -> Result<(), String> {
    let mut bench = running()?;
    bench.settle_untold()?;
    bench.pass(PERIOD_S / 4.0)?;
    bench.emulator.chip().short_circuit(Motor::Screw, 4000);
    bench.pass(0.5e-6)?;
    bench.emulator.chip().end_short_circuit(Motor::Screw);
    bench.pass(10e-3)?;
    assert_eq!(bench.status()?.state, RUNNING);
    assert!(enabled(&mut bench, Motor::Screw));
    Ok(())
}

#[test]
fn a_drivers_fault_opens_its_bridge_in_hardware() -> Result<(), String> {
    for (motor, other, cause) in [
        (Motor::Screw, Motor::Nut, Fault::ScrewDriver),
        (Motor::Nut, Motor::Screw, Fault::NutDriver),
    ] {
        let mut bench = running()?;
        bench.settle_untold()?;
        bench.pass(PERIOD_S / 4.0)?;
        bench.emulator.chip().driver_fault(motor, true);
        let off = until_off(&mut bench, motor, 2e-6)?;
        println!(
            "{motor:?}: off {:.2} us after the driver's fault",
            1e6 * off
        );
        assert!(off <= 1e-6, "{motor:?}: off after {off} s");
        bench.pass(6.0 * PERIOD_S)?;
        assert_cause(&mut bench, cause)?;
        assert!(enabled(&mut bench, other) && !enabled(&mut bench, motor));
        bench.emulator.chip().driver_fault(motor, false);
        bench.demand(Demand::Reset)?;
        bench.wait_for(READY, 0.2)?;
    }
    Ok(())
}

/// A current loop and the dead-man's interrupt write a fault of their own into the view: the first cause stands there again
/// with the next step.
#[test]
fn the_view_goes_back_to_the_first_cause() -> Result<(), String> {
    let mut bench = running()?;
    bench.emulator.chip().driver_fault(Motor::Nut, true);
    bench.wait_for(FAULT, 1e-3)?;
    let at = bench.image.symbol("DRIVE_VIEW")? + offset_of!(DriveView, fault) as u32;
    let other = Fault::LoopHung.word();
    bench
        .emulator
        .write(at, other)
        .map_err(|error| error.to_string())?;
    assert_eq!(bench.status()?.fault, other);
    bench.pass(1e-3)?;
    assert_cause(&mut bench, Fault::NutDriver)
}

/// A count of a 20-bit encoder comes several times a period, so that one that stands is seen at once; 16,000 counts a turn
/// come in every fourth, and how far the observer may turn meanwhile is the plate's.
#[test]
fn a_stuck_encoder_opens_its_bridge_before_its_angle_is_wrong() -> Result<(), String> {
    const TURNS_PER_S: f64 = 300.0 / 60.0;
    for (board, motor, cause) in [
        (Wiring::Nucleo, Motor::Screw, Fault::ScrewEncoder),
        (Wiring::Nucleo, Motor::Nut, Fault::NutEncoder),
        (Wiring::Mains, Motor::Nut, Fault::NutEncoder),
    ] {
        let plate = plate_of(board);
        let config = plate.config().map_err(|misfit| misfit.to_string())?;
        let watch = config.current_loops[motor as usize].encoder_watch;
        let travel = f64::from(watch.travel_max) / 2.0_f64.powi(32);
        let electrical_degrees =
            360.0 * f64::from(plate.motors[motor as usize].pole_pairs) * travel;
        assert!(
            electrical_degrees < 10.0,
            "{board:?}: {electrical_degrees} electrical degrees cost torque"
        );
        let mut bench = running_on(board)?;
        bench.settle_untold()?;
        let chip = bench.emulator.chip();
        let last = chip.last_count(motor);
        chip.provoked.stuck_encoder[motor as usize] = Some(last);
        // From the first sample that is wrong; the screw's is 3 us away, the nut's half a period more.
        let to_sample = bench.time_to_top(motor);
        let off = until_off(&mut bench, motor, 2e-3)? - to_sample;
        println!(
            "{board:?}, {motor:?}: off {:.0} us after the first wrong sample",
            1e6 * off
        );
        let limit = 1.1 * travel / TURNS_PER_S + PERIOD_S;
        assert!(
            off < limit,
            "{board:?}: off {off} s after the first wrong sample of the {motor:?}, at most {limit} s"
        );
        bench.pass(1e-3)?;
        assert_cause(&mut bench, cause)?;
        let closed = [Motor::Screw, Motor::Nut].map(|one| enabled(&mut bench, one));
        assert_eq!(closed, [Motor::Screw, Motor::Nut].map(|one| one != motor));
    }
    Ok(())
}

#[test]
fn a_hung_speed_task_is_noticed_and_the_watchdog_resets_the_chip() -> Result<(), String> {
    let mut bench = running()?;
    bench.hang("FMAC")?;
    // Its next step is due within four periods, and a reference holds for eight: then each current loop opens its own
    // bridge in the period in which it finds the reference too old.
    let screw = until_off(&mut bench, Motor::Screw, 1e-3)?;
    let nut = until_off(&mut bench, Motor::Nut, 1e-3)?;
    assert!(screw < 12.0 * PERIOD_S, "{screw}");
    assert!(nut < 1.0 * PERIOD_S, "within a period of the other: {nut}");
    assert_cause(&mut bench, Fault::SpeedTaskLate)?;
    bench.pass(30e-3)?;
    assert_eq!(bench.emulator.resets, [Reset::Watchdog]);
    bench.wait_for(READY, 0.2)?;
    assert_eq!(
        bench.look()?.reset_reason(),
        Some(ResetReason::IndependentWatchdog)
    );
    // What led to it is still known, in its order, and so is what came after it; not the fault, for the hung task holds up the
    // supervision, which writes. A state that lasts for less than a millisecond is seen or not.
    let journal = bench.journal()?;
    let mut events: Vec<_> = journal
        .latest()
        .map(|event| (event.kind, event.code))
        .collect();
    events.reverse();
    let state = |state: State| (EventKind::State.word(), state.word());
    let start = |reason: ResetReason| (EventKind::Start.word(), reason.word());
    let own = (EventKind::Settings.word(), Origin::Own.word());
    events.retain(|event| *event != state(State::Ready));
    assert_eq!(
        events,
        [
            start(ResetReason::Power),
            own,
            state(State::SelfTest),
            state(State::Running),
            start(ResetReason::IndependentWatchdog),
            own,
            state(State::SelfTest),
        ],
        "{:#?}",
        journal.latest().collect::<Vec<_>>()
    );
    Ok(())
}

#[test]
fn a_hung_current_loop_has_both_bridges_opened_above_its_head_and_is_reset() -> Result<(), String> {
    for (handler, motor) in [("ADC1_2", Motor::Screw), ("ADC4", Motor::Nut)] {
        let mut bench = running()?;
        bench.settle_untold()?;
        bench.hang(handler)?;
        let to_hang = bench.time_to_top(motor);
        // The screw's loop ended before that, and is waited for two and a half periods.
        let screw = until_off(&mut bench, Motor::Screw, 1e-3)?;
        let nut = until_off(&mut bench, Motor::Nut, 1e-3)?;
        let off = screw + nut - to_hang;
        println!("{handler}: off {:.0} us after it hung", 1e6 * off);
        assert!(off < 2.5 * PERIOD_S, "{handler}: {off} s");
        assert_cause(&mut bench, Fault::LoopHung)?;
        bench.pass(30e-3)?;
        assert_eq!(bench.emulator.resets, [Reset::Watchdog]);
        assert!(!enabled(&mut bench, Motor::Screw) && !enabled(&mut bench, Motor::Nut));
    }
    Ok(())
}

/// What the timers then do is the chip's: here it is shown that it is asked for.
#[test]
fn a_halted_or_locked_up_core_takes_the_bridges_with_it() -> Result<(), String> {
    const TIM1: u32 = 1 << 11;
    const TIM8: u32 = 1 << 13;
    const WATCHDOG: u32 = 1 << 12;
    let mut bench = running()?;
    let system = &bench.emulator.chip().system;
    assert_eq!(system.stops_with_the_core(), [WATCHDOG, TIM1 | TIM8]);
    assert!(system.lockup_breaks());
    Ok(())
}
