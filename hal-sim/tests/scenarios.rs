//! What may happen at work, and short samples of the long runs: `cargo xtask bench faults --soak` makes them longer.

use hal_sim::boards::BoardKind;
use hal_sim::faults::{Scenario, healthy, run_scenario, soak};

/// Those that end past a limit, and why: where the nut is held at once, the screw's kinetic energy goes on into the table; where
/// the bus is full and has no chopper, a stop takes longer.
const PAST: [(BoardKind, Scenario); 3] = [
    (BoardKind::Nucleo, Scenario::LinkPulled),
    (BoardKind::Nucleo, Scenario::NutSeized),
    (BoardKind::Mains, Scenario::NutSeized),
];

#[test]
fn each_scenario_keeps_its_limits() {
    for board in [BoardKind::Nucleo, BoardKind::Mains] {
        for scenario in Scenario::ALL {
            let story = run_scenario(board, scenario).unwrap();
            let expected = !PAST.contains(&(board, scenario));
            assert_eq!(
                story.within(),
                expected,
                "{board:?}, {}: {:.2} mm of {} mm, {:.1} A of {} A, {:.0} V of {} V, ended as {:?}",
                scenario.name(),
                1e3 * story.travel_m,
                1e3 * story.travel_max_m,
                story.peak_a,
                story.peak_max_a,
                story.bus_v,
                story.bus_max_v,
                story.state
            );
        }
    }
}

#[test]
fn hard_but_healthy_running_has_no_fault() {
    for board in [BoardKind::Nucleo, BoardKind::Mains] {
        let seen = healthy(board, 20.0, 3).unwrap();
        assert!(
            seen.stopped.is_empty() && seen.stuck == 0 && seen.commands > 10,
            "{board:?}: {seen:?}"
        );
    }
}

#[test]
fn after_each_fault_and_its_reset_it_is_ready_again() {
    for board in [BoardKind::Nucleo, BoardKind::Mains] {
        let seen = soak(board, 30.0, 3).unwrap();
        assert!(seen.stuck == 0 && seen.faults > 4, "{board:?}: {seen:?}");
    }
}
