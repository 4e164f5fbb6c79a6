//! A drive that does not know where its rotors stand finds them, or says why it cannot.

use bench::alignment::{
    drawn, loose, margin_nm, miswirings, of_board, switch_on, switch_on_with, turned_round, unknown,
};
use control::alignment::Reason;
use control::encoder::Interface;
use control::fault::Part;
use hal_sim::boards::BoardKind;
use hal_sim::start::Start;
use plant::Axis;

/// Largest error of the electrical angle, degrees; furthest that the table may move, m; largest torque, N m.
const ERROR_DEG: f64 = 2.0;
const TRAVEL_M: f64 = 50e-6;
const TORQUE_NM: f64 = 0.45;

#[test]
fn drawn_machines_are_aligned() {
    for seed in [2, 4, 8, 13, 17, 19] {
        let outcome = switch_on(&drawn(seed)).unwrap();
        assert!(outcome.is_ready(), "seed {seed}: {outcome:?}");
        let error = outcome.error_deg_worst();
        assert!(
            error < ERROR_DEG,
            "seed {seed}: {error} degrees of {ERROR_DEG}"
        );
        let travel = outcome.travel_m;
        assert!(travel < TRAVEL_M, "seed {seed}: {travel} m of {TRAVEL_M}");
    }
}

/// Loads of seven tenths and more of what friction holds. Torque harmonics help such a load over some angles: with the bridges open
/// between two torques it ran on (348: 79 um), or pushed the table down a micrometre with each (391: 88 um), and the start was refused.
#[test]
fn a_load_near_what_friction_holds_is_braked_and_the_table_brought_back() {
    for seed in [348, 391] {
        let outcome = switch_on(&drawn(seed)).unwrap();
        assert!(outcome.is_ready(), "seed {seed}: {outcome:?}");
        let travel = outcome.travel_m;
        assert!(travel < TRAVEL_M, "seed {seed}: {travel} m of {TRAVEL_M}");
    }
}

/// Each probe that goes with the load moves the table by a micrometre or two, and none back: it crept to its limit while the nut was
/// located, on a drawn machine and on one with two phases swapped, which was then told as a table that moved.
#[test]
fn a_table_that_creeps_with_the_probes_is_brought_back_by_both_motors() {
    let outcome = switch_on(&drawn(293)).unwrap();
    assert!(outcome.is_ready(), "{outcome:?}");
    let swapped = miswirings(1_000_000)
        .into_iter()
        .find(|miswiring| miswiring.name == "nut: phases b and c swapped")
        .unwrap();
    let outcome = switch_on(&swapped.start).unwrap();
    assert_eq!(outcome.misalignment, swapped.expected, "{outcome:?}");
}

/// The count of an encoder with index begins anywhere, and jumps where the index is passed; after that it is the index's.
#[test]
fn an_index_is_passed_while_aligning() {
    for (seed, angles) in [(2, [1.0, 2.0]), (4, [6.2, 0.1]), (8, [3.0, 6.2])] {
        let mut start = drawn(seed);
        start.angles = angles;
        for k in 0..2 {
            let interface = Interface::IncrementalWithIndex;
            start.board.sensors.encoders[k].interface = interface;
            start.plate.motors[k].encoder.interface = interface;
        }
        let mut passed = [false; 2];
        let outcome = switch_on_with(&start, |drive| {
            for axis in Axis::ALL {
                let alignment = drive.exchange(axis).alignment();
                passed[axis.index()] |= alignment.is_some_and(|found| !found.index_awaited);
            }
        })
        .unwrap();
        assert!(outcome.is_ready(), "{angles:?}: {outcome:?}");
        assert_eq!(passed, [true; 2], "{angles:?}: the index was awaited");
        let error = outcome.error_deg_worst();
        assert!(
            error < ERROR_DEG,
            "{angles:?}: {error} degrees of {ERROR_DEG}"
        );
    }
}

/// The speed task asks for what it knew before the current loop passed the index: for 0.2 ms the angle was then wrong by as much
/// as the count had jumped, and a current of 0.94 A made 0.52 N m.
#[test]
fn an_index_that_is_passed_makes_no_torque() {
    for seed in [104, 115, 243] {
        let outcome = switch_on(&drawn(seed)).unwrap();
        let torque = outcome.torque_nm;
        assert!(
            torque < TORQUE_NM,
            "seed {seed}: {torque} N m of {TORQUE_NM}"
        );
    }
}

/// An index that moves the count by 23 to 50 of 40,000 looked like a speed: the speed loop answered with its whole limit, and the
/// current loop's overshoot made 0.38 to 0.45 N m of it, of 0.39.
#[test]
fn an_index_that_moves_the_count_by_little_is_an_index() {
    for seed in [59, 523, 1139] {
        let outcome = switch_on(&of_board(BoardKind::Mains, seed)).unwrap();
        assert!(outcome.is_ready(), "seed {seed}: {outcome:?}");
        let torque = outcome.torque_nm;
        assert!(torque < 0.3, "seed {seed}: {torque} N m");
    }
}

/// An index that is passed while the rotors are located, here of a nut whose bridge is open, makes its observer follow the count
/// for some milliseconds. That is no motion: it was taken for 50 um of the table where it had moved by 5.
#[test]
fn an_index_that_is_passed_while_locating_is_no_motion() {
    for start in [
        drawn(160),
        of_board(BoardKind::Mains, 160),
        of_board(BoardKind::Mains, 174),
    ] {
        let outcome = switch_on(&start).unwrap();
        assert!(outcome.is_ready(), "{outcome:?}");
    }
}

/// So many of the board's machines of which friction holds the rotors at every angle are aligned.
fn the_held_are_aligned(board: BoardKind, make: fn(BoardKind, u64) -> Start, count: usize) {
    let held = (0..).map(|seed| (seed, make(board, seed)));
    for (seed, start) in held.filter(|(_, start)| margin_nm(start) > 0.0).take(count) {
        let outcome = switch_on(&start).unwrap();
        assert!(outcome.is_ready(), "{board:?}, seed {seed}: {outcome:?}");
        let (error, travel) = (outcome.error_deg_worst(), outcome.travel_m);
        assert!(
            error < ERROR_DEG && travel < TRAVEL_M,
            "{board:?}, seed {seed}: {error} degrees of {ERROR_DEG}, {travel} m of {TRAVEL_M}"
        );
    }
}

/// On the boards' own machines, where friction holds the rotors at every angle; where it does not, one that leaves an angle where
/// it just stands goes on to the next by itself.
#[test]
fn the_boards_own_machines_are_aligned_where_friction_holds_their_rotors() {
    for board in [BoardKind::Nucleo, BoardKind::Mains] {
        the_held_are_aligned(board, of_board, 10);
    }
}

/// Friction is elastic over 1 to 10 um of the table, hot and cold, and nobody says how the encoders count. Probes that ended within that
/// travel took one in five (mains) or two in three (default board) for miswired, and moved a table by 98 um.
#[test]
fn elastic_friction_misleads_no_direction() {
    for board in [BoardKind::Nucleo, BoardKind::Mains] {
        the_held_are_aligned(board, unknown, 20);
    }
}

/// A motor with 2 pole pairs swings by a quarter of the electrical angle of one with 8. The pair's friction carries torque from one to
/// the other: weighed by the electrical angles, it did not drop out of the sum, and directions were wrong.
#[test]
fn motors_of_few_and_of_many_pole_pairs_are_aligned() {
    for (seed, pole_pairs) in
        (0..12).map(|seed| (seed, if seed % 2 == 0 { [2, 8] } else { [8, 2] }))
    {
        let mut start = unknown(BoardKind::Mains, seed);
        for (k, axis) in Axis::ALL.into_iter().enumerate() {
            let motor = start.model.motor_mut(axis);
            // The same torque of an ampere.
            let flux = f64::from(motor.pole_pairs) / f64::from(pole_pairs[k]);
            motor.pole_pairs = pole_pairs[k];
            motor.flux_wb *= flux;
            start.plate.motors[k].pole_pairs = pole_pairs[k];
            start.plate.motors[k].flux_wb *= flux;
        }
        let outcome = switch_on(&start).unwrap();
        assert!(
            outcome.is_ready(),
            "{pole_pairs:?}, seed {seed}: {outcome:?}"
        );
    }
}

#[test]
fn what_is_wired_wrongly_is_named() {
    let mut wrong = Vec::new();
    for miswiring in miswirings(1000) {
        let outcome = switch_on(&miswiring.start).unwrap();
        let right = match miswiring.expected {
            Some(expected) => outcome.misalignment == Some(expected),
            None => outcome.is_ready() && outcome.error_deg_worst() < ERROR_DEG,
        };
        if !right || outcome.travel_m > TRAVEL_M || outcome.torque_nm > TORQUE_NM {
            wrong.push(format!("{}: {outcome:?}", miswiring.name));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Each motor is driven by itself with the other's encoder: where the pair's friction does not take the other along, the one that was
/// meant seems held and the other to move. Six of a hundred (the last four) were refused for the table's travel, or a rotor that is not
/// to be found or held, though it had been seen; of 400 one still is.
#[test]
fn exchanged_encoders_are_named() {
    for seed in (20_000..20_024).chain([1_000_000, 50_032, 50_083, 50_140, 50_225]) {
        let exchanged = miswirings(seed).pop().unwrap();
        let outcome = switch_on(&exchanged.start).unwrap();
        assert_eq!(
            outcome.misalignment, exchanged.expected,
            "seed {seed}: {outcome:?}"
        );
    }
}

#[test]
fn a_load_that_nothing_holds_is_refused() {
    for seed in 0..10 {
        let outcome = switch_on(&loose(seed)).unwrap();
        let found = outcome.misalignment.map(|found| (found.part, found.reason));
        assert_eq!(
            found,
            Some((Part::Pair, Reason::LoadMoves)),
            "seed {seed}: {outcome:?}"
        );
    }
}

/// Two phases and the encoder's channels swapped: of one motor alone nothing is wrong.
#[test]
fn a_motor_that_is_turned_round_is_refused() {
    for (seed, motor) in [(1, 0), (2, 1), (3, 0), (4, 1), (5, 0), (6, 1)] {
        let outcome = switch_on(&turned_round(seed, motor)).unwrap();
        let found = outcome.misalignment.map(|found| (found.part, found.reason));
        assert!(
            matches!(found, Some((Part::Pair, Reason::Opposed | Reason::Travel))),
            "seed {seed}: {outcome:?}"
        );
    }
}
