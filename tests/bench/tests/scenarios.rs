//! What may happen at work, and short samples of the long runs: `cargo xtask bench faults --soak` makes them longer.

use bench::alignment::held_load_n;
use bench::faults::{Drives, Scenario, Steady, healthy, run_scenario, soak};
use control::fault::Fault;
use control::supervisor::{Demand, State};
use hal_sim::board::BoardConfig;
use hal_sim::boards::BoardKind;
use hal_sim::drive::Drive;
use hal_sim::experiment::RPM;
use hal_sim::parallel::on_all_cores;
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;

#[test]
fn each_scenario_keeps_its_limits() {
    for board in [BoardKind::Nucleo, BoardKind::Mains] {
        for scenario in Scenario::ALL {
            let story = run_scenario(board, scenario).unwrap();
            assert!(
                story.within(),
                "{board:?}, {}: {:.2} mm of {} mm, {:.1} A of {} A, {:.0} V of {} V, {:.0} N of {:.0} N, ended as {:?}",
                scenario.name(),
                1e3 * story.travel_m,
                1e3 * story.travel_max_m,
                story.peak_a,
                story.peak_max_a,
                story.bus_v,
                story.bus_max_v,
                story.end_force_n,
                story.end_force_max_n,
                story.state
            );
        }
    }
}

/// Nothing else tells a drive that is not homed, and whose end switch is welded, that its table is at the stop.
#[test]
fn a_table_that_stands_at_its_stop_is_let_go() {
    for board in [BoardKind::Nucleo, BoardKind::Mains] {
        let story = run_scenario(board, Scenario::EndStop).unwrap();
        let stalled = [Fault::ScrewStalled, Fault::NutStalled].map(State::Fault);
        assert!(
            stalled.contains(&story.state),
            "{board:?}: {:?}",
            story.state
        );
    }
}

/// Drives that compensate what repeats, and such that do not.
const DRIVES: [Drives; 2] = [Drives::SHIPPED, Drives::COMPENSATED];

/// The NUCLEO's drive once learned its encoder's counting at 800 rpm, and stopped by its voltage's watch after 9 to 14 s.
#[test]
fn steady_running_with_compensation_has_no_fault() {
    let all = Steady::all();
    let stopped = on_all_cores(&all, |steady| steady.run(Drives::COMPENSATED, 16.0, 1));
    for (steady, stopped) in all.iter().zip(stopped) {
        assert_eq!(stopped.unwrap(), None, "{steady:?}");
    }
}

#[test]
fn hard_but_healthy_running_has_no_fault() {
    for board in [BoardKind::Nucleo, BoardKind::Mains] {
        for drives in DRIVES {
            let seen = healthy(board, drives, 20.0, 3).unwrap();
            assert!(
                seen.stopped.is_empty() && seen.stuck == 0 && seen.commands > 10,
                "{board:?}: {seen:?}"
            );
        }
    }
}

#[test]
fn after_each_fault_and_its_reset_it_is_ready_again() {
    for board in [BoardKind::Nucleo, BoardKind::Mains] {
        for drives in DRIVES {
            let seen = soak(board, drives, 30.0, 3).unwrap();
            assert!(seen.stuck == 0 && seen.faults > 4, "{board:?}: {seen:?}");
        }
    }
}

/// On a board of which the bus is `config`'s, an aligned drive asked to run with the nut at `rpm`.
fn with_bus(board: BoardKind, config: BoardConfig, rpm: f64) -> Drive {
    let mut template = Model::coupled();
    template.feed.load_n = 0.5 * held_load_n(&template);
    let model = board.machine(&template, Coupling::Coupled);
    let mut drive = Drive::aligned(&model, Coupling::Coupled, config, &board.plate()).unwrap();
    drive.command(0.0, rpm * RPM).unwrap();
    drive
}

fn pass(drive: &mut Drive, seconds: f64) {
    let periods = seconds / drive.board.config().pwm_period_s();
    (0..periods as u64).for_each(|_| drive.period());
}

/// A bus that takes nothing keeps no motor from starting: neither has a motion that could be braked.
#[test]
fn a_pair_at_rest_starts_either_way_on_a_full_bus() {
    for board in [BoardKind::Nucleo, BoardKind::Mains] {
        let full = board.plate().bridge.brake_fade_to_v;
        for rpm in [300.0, -300.0] {
            let mut drive = with_bus(board, board.config(), rpm);
            drive.board.set_bus_voltage(full);
            pass(&mut drive, 1.0);
            let reached = Axis::ALL.map(|axis| drive.board.machine.motor(axis).omega / RPM);
            assert!(
                drive.state() == State::Running
                    && reached.iter().all(|n| (n / rpm - 1.0).abs() < 0.1),
                "{board:?} at {full} V: {reached:.0?} rpm of {rpm} rpm, {:?}",
                drive.state()
            );
        }
    }
}

/// A pair that stands under current takes its copper losses from the bus and gives it nothing: what sensors' noise makes the bridges
/// do is no source.
#[test]
fn a_pair_that_holds_does_not_charge_its_bus() {
    for board in [BoardKind::Nucleo, BoardKind::Mains] {
        let config = BoardConfig {
            chopper: None,
            ..board.config_on_its_bus()
        };
        let mut drive = with_bus(board, config, 0.0);
        pass(&mut drive, 2.0);
        let (held, rose) = (drive.state(), drive.board.bus_voltage() - config.bus_v);
        assert!(
            held == State::Holding && rose < 1e-3 * config.bus_v,
            "{board:?}: the bus rose by {rose:.3} V in 2 s, {held:?}"
        );
    }
}

/// The chopper holds what a stop from full speed puts back below where braking fades out: 35 J a motor of which 470 uF take 13.
#[test]
fn a_chopper_takes_the_stop_from_full_speed() {
    let board = BoardKind::Mains;
    let config = board.config_on_its_bus();
    let from = board.plate().bridge.brake_fade_from_v;
    let highest = [config.chopper, None].map(|chopper| {
        let mut drive = with_bus(board, BoardConfig { chopper, ..config }, 2900.0);
        pass(&mut drive, 1.5);
        drive.request.demand = Demand::Rest;
        let mut highest = 0.0f64;
        for _ in 0..20_000 {
            drive.period();
            highest = highest.max(drive.board.bus_voltage());
        }
        highest
    });
    let [chopped, bare] = highest;
    assert!(
        chopped < from && bare > from,
        "{chopped:.1} V with the chopper, {bare:.1} V without, expected below and above {from} V"
    );
}
