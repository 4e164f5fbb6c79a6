//! What must hold for the machine to go on moving: a command that is renewed, the enable, no end switch ahead. Each ends in
//! both motors at rest before the bridges open, named.

use bench::runaway::until_safe;
use control::fault::Fault;
use control::interlock::Inputs;
use control::supervisor::{Demand, State};
use hal_sim::drive::Drive;
use hal_sim::experiment::{RPM, Setup};
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;

const RUN: (f64, f64) = (20e-3, 800.0);

fn setup() -> Setup {
    Setup::real(Model::coupled(), Coupling::Coupled)
}

fn running(velocity: f64) -> Drive {
    let mut drive = setup().drive().unwrap();
    drive.command(velocity, RUN.1 * RPM).unwrap();
    let outcome = until_safe(&mut drive, 1.0);
    assert_eq!(outcome.state, State::Running);
    drive
}

fn rpm(drive: &Drive) -> [f64; 2] {
    Axis::ALL.map(|axis| drive.board.machine.motor(axis).omega / RPM)
}

/// The longest that the stop takes, s: the slower of both ramps, with its jerk at either end, and the following.
fn stop_s() -> f64 {
    let feed = setup().plate().feed;
    let table = RUN.0 / feed.acceleration_max + feed.acceleration_max / feed.jerk_max;
    let base =
        RUN.1 * RPM / feed.base_acceleration_max + feed.base_acceleration_max / feed.base_jerk_max;
    table.max(base) + 0.02
}

#[test]
fn each_stops_both_motors_and_is_named() {
    let inputs = Inputs::CLEAR;
    for (fault, wait_s, spoil) in [
        (
            Fault::CommandLost,
            setup().plate().command.heartbeat_s,
            (|drive| drive.attended = false) as fn(&mut Drive),
        ),
        (Fault::Disabled, 1e-3, |drive| {
            drive.request.inputs.enabled[1] = false;
        }),
        (Fault::EndForward, 1e-3, |drive| {
            drive.request.inputs.end_forward = true;
        }),
    ] {
        let mut drive = running(RUN.0);
        spoil(&mut drive);
        let outcome = until_safe(&mut drive, 2.0);
        assert_eq!(outcome.state, State::Fault(fault));
        let longest = wait_s + stop_s();
        assert!(
            outcome.seconds > wait_s && outcome.seconds < longest,
            "{fault:?}: bridges off after {} s, expected between {wait_s} s and {longest} s",
            outcome.seconds
        );
        let speeds = rpm(&drive);
        assert!(
            speeds.iter().all(|speed| speed.abs() < 5.0),
            "{fault:?}: the bridges opened at {speeds:?} rpm, expected both at rest"
        );
        // It goes no further by itself, also when the cause is gone.
        drive.request.inputs = inputs;
        drive.attended = true;
        let later = until_safe(&mut drive, 0.5);
        assert_eq!(later.state, State::Fault(fault));
        (0..10_000).for_each(|_| drive.period());
        assert_eq!(drive.state(), State::Fault(fault), "half a second later");
        drive.request.demand = Demand::Reset;
        (0..4_000).for_each(|_| drive.period());
        assert_eq!(drive.state(), State::Ready);
    }
}

#[test]
fn the_drive_runs_away_from_an_end_switch_and_not_towards_it() {
    for (velocity, ahead, fault) in [
        (
            RUN.0,
            Inputs {
                end_forward: true,
                ..Inputs::CLEAR
            },
            Fault::EndForward,
        ),
        (
            -RUN.0,
            Inputs {
                end_backward: true,
                ..Inputs::CLEAR
            },
            Fault::EndBackward,
        ),
    ] {
        let mut drive = running(-velocity);
        drive.request.inputs = ahead;
        let outcome = until_safe(&mut drive, 0.5);
        assert_eq!(outcome.state, State::Running, "away from {fault:?}");
        drive.command(velocity, 0.0).unwrap();
        let outcome = until_safe(&mut drive, 1.0);
        assert_eq!(outcome.state, State::Fault(fault));
        // Asked again from rest, nothing moves.
        drive.request.demand = Demand::Reset;
        (0..4_000).for_each(|_| drive.period());
        assert_eq!(drive.state(), State::Ready);
        drive.request.demand = Demand::Run;
        for period in 0..200 {
            drive.period();
            let closed = Axis::ALL.map(|axis| drive.compare(axis).enable);
            assert_eq!(closed, [false; 2], "{fault:?}: bridges in period {period}");
        }
        assert_eq!(drive.state(), State::Fault(fault));
    }
}
