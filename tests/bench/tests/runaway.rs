//! A wrong electrical angle stops the drive, named, before the machine runs away; hard running does not; a motor that
//! something holds at its torque limit is stopped; a stop does not lift the bus to its limit.

use bench::runaway::{NUT_RPM, VELOCITY, WrongAngle, until_safe};
use control::fault::Fault;
use control::supervisor::{Demand, State};
use hal_sim::board::BoardConfig;
use hal_sim::boards::BoardKind;
use hal_sim::drive::Drive;
use hal_sim::experiment::{RPM, Setup};
use hal_sim::plates::REGENERATION;
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;

/// A sample of what `cargo xtask bench runaway` runs.
#[test]
fn a_wrong_angle_is_named_before_the_machine_runs_away() {
    let sample = [30.0, -60.0, 90.0, -90.0, -120.0, 180.0];
    for board in [None, Some(BoardKind::Mains), Some(BoardKind::Nucleo)] {
        let setup = WrongAngle::setup(board);
        let plate = setup.plate();
        let mut tried = 0;
        for wrong in WrongAngle::all().filter(|wrong| sample.contains(&wrong.degrees)) {
            let (outcome, limits) = (wrong.run(&setup).unwrap(), wrong.limits(&plate));
            assert!(
                outcome.names(wrong.axis) && outcome.within(&limits),
                "{board:?}, {wrong:?}: {outcome:?}, allowed are {limits:?}"
            );
            tried += 1;
        }
        assert_eq!(tried, 4 * sample.len());
    }
}

#[test]
fn hard_running_is_no_runaway() {
    let setup = Setup::real(Model::coupled(), Coupling::Coupled);
    let mut drive = setup.drive().unwrap();
    for (velocity, rpm, bus_v) in [
        (50e-3, 2000.0, 310.0),
        (-50e-3, -2000.0, 310.0),
        (VELOCITY, 1500.0, 310.0),
        (VELOCITY, 1500.0, 110.0),
        (VELOCITY, 1500.0, 310.0),
        (-80e-3, -1500.0, 310.0),
        (0.0, 0.0, 310.0),
    ] {
        drive.board.set_bus_voltage(bus_v);
        drive.command(velocity, rpm * RPM).unwrap();
        let outcome = until_safe(&mut drive, 0.7);
        let expected = if (velocity, rpm) == (0.0, 0.0) {
            State::Holding
        } else {
            State::Running
        };
        assert_eq!(
            outcome.state, expected,
            "{velocity} m/s, {rpm} rpm, {bus_v} V after {} s",
            outcome.seconds
        );
    }
}

/// An axis that is blocked: full current, no speed, no error that any other watch sees. The same of an angle wrong by a
/// quarter turn on a shaft whose friction keeps it from turning with the current.
#[test]
fn a_motor_that_stands_at_its_torque_limit_is_stopped() {
    for (degrees, blocked_nm) in [(0.0, 3.0), (90.0, 3.0), (-90.0, 0.4)] {
        let mut model = Model::coupled();
        model.motor_mut(Axis::Screw).coulomb_nm = blocked_nm;
        let setup = Setup::real(model, Coupling::Coupled);
        let mut drive = setup.drive().unwrap();
        drive.period();
        drive.misalign(Axis::Screw, degrees / 360.0);
        drive.command(0.0, NUT_RPM * RPM).unwrap();
        let outcome = until_safe(&mut drive, 2.0);
        let stall_s = setup.plate().runaway.stall_s;
        let State::Fault(fault) = outcome.state else {
            panic!("{degrees} degrees, {blocked_nm} N m: {outcome:?}, expected a fault");
        };
        assert!(
            fault == Fault::ScrewStalled || degrees != 0.0 && outcome.names(Axis::Screw),
            "{degrees} degrees, {blocked_nm} N m: {outcome:?}"
        );
        assert!(
            outcome.seconds < stall_s + 0.3,
            "{degrees} degrees, {blocked_nm} N m: stopped after {} s, expected {stall_s} s after the ramp",
            outcome.seconds
        );
    }
}

/// The stop of both motors from 3000 rpm on the mains board's 470 uF with no chopper: two motors' 71 J, of which the
/// capacitors take 13 J to the guard's 390 V.
#[test]
fn a_stop_from_full_speed_does_not_lift_the_bus_to_its_limit() {
    const TRIP: f64 = 390.0;
    let mut highest = [0.0; 2];
    for (folds, highest) in [true, false].into_iter().zip(&mut highest) {
        let mut setup = Setup::real(Model::coupled(), Coupling::Coupled);
        setup.board = BoardConfig {
            bus_f: 470e-6,
            ..setup.board
        };
        let mut plate = setup.plate();
        if !folds {
            // Beyond what this bus can reach, but within what the ADC reads.
            (plate.bridge.brake_fade_from_v, plate.bridge.brake_fade_to_v) = (440.0, 445.0);
        }
        let mut drive = Drive::aligned(&setup.model, setup.coupling, setup.board, &plate).unwrap();
        drive.command(0.0, 2950.0 * RPM).unwrap();
        let run = until_safe(&mut drive, 2.0);
        let speed = drive.board.machine.motor(Axis::Nut).omega / RPM;
        assert!(
            run.state == State::Running && speed > 2900.0,
            "{run:?}, {speed} rpm"
        );
        drive.request.demand = Demand::Rest;
        let mut seconds = 0.0;
        while drive.state() != State::Ready && seconds < 20.0 && *highest < TRIP {
            drive.period();
            seconds += 50e-6;
            *highest = f64::max(*highest, drive.board.bus_voltage());
        }
        if folds {
            assert_eq!(drive.state(), State::Ready, "after {seconds} s");
        }
    }
    let [folded, unfolded] = highest;
    let [from, full] = REGENERATION.map(|part| part * 310.0);
    assert!(
        folded > from && folded < full + 2.0,
        "the bus rose to {folded:.1} V, expected {from} V to {full} V, where braking ends; the trip is at {TRIP} V"
    );
    assert!(
        unfolded >= TRIP,
        "without fading the bus rose to {unfolded:.1} V: this test would see nothing"
    );
}
