//! A part of the fault matrix, whose number of unsafe cells may only fall; and what its mends are for.

use bench::faults::{Cell, Defect, Input, Matrix, Outcome, Pair, Situation};
use control::fault::Fault;
use control::supervisor::State;
use hal_sim::boards::BoardKind;
use plant::Axis;

fn outcomes(cells: &[Cell]) -> Vec<Outcome> {
    Matrix::of(cells).unwrap().run_all(cells).unwrap()
}

/// Each so-many-th cell, prime to the number of situations, so that all are among them.
const EVERY: usize = 19;
/// Unsafe cells of these.
const UNSAFE: usize = 0;

#[test]
fn unsafe_cells_do_not_become_more() {
    let cells: Vec<Cell> = Cell::all().into_iter().step_by(EVERY).collect();
    let outcomes = outcomes(&cells);
    let hazardous: Vec<String> = cells
        .iter()
        .zip(&outcomes)
        .filter(|(_, outcome)| !outcome.hazards.is_empty())
        .map(|(cell, outcome)| format!("{}: {:?}", cell.name(), outcome.hazards))
        .collect();
    assert_eq!(
        hazardous.len(),
        UNSAFE,
        "of {} cells, unsafe are:\n{}",
        cells.len(),
        hazardous.join("\n")
    );
    // What is counted can be dangerous at all.
    let detected = outcomes.iter().filter(|o| o.detected_s.is_some()).count();
    assert!(detected > cells.len() / 3, "{detected} of {}", cells.len());
}

#[test]
fn the_matrix_has_what_it_must_and_repeats_bit_for_bit() {
    let cells = Cell::all();
    assert!(cells.len() >= 1500, "{} cells", cells.len());
    let some: Vec<Cell> = cells.into_iter().step_by(311).collect();
    assert_eq!(outcomes(&some), outcomes(&some));
}

fn cell(board: BoardKind, input: Input, defect: Defect, situation: Situation) -> Cell {
    Cell {
        board,
        input,
        defect,
        situation,
    }
}

/// Its outcome, which ends in `fault`.
fn ends_in(cell: Cell, fault: Fault) -> Outcome {
    let outcome = outcomes(&[cell]).remove(0);
    assert_eq!(
        outcome.state,
        State::Fault(fault),
        "{}: {outcome:?}",
        cell.name()
    );
    outcome
}

/// With three sensors a wrong one shows in their sum, while the drive comes to rest.
#[test]
fn a_current_sensor_that_is_wrong_is_named_by_the_sum_of_three() {
    for (axis, fault) in [
        (Axis::Screw, Fault::ScrewCurrentSum),
        (Axis::Nut, Fault::NutCurrentSum),
    ] {
        let input = Input::Current(axis, 1);
        let cell = cell(
            BoardKind::Nucleo,
            input,
            Defect::Offset,
            Situation::Stopping,
        );
        let outcome = ends_in(cell, fault);
        assert_eq!(outcome.hazards, [], "{}: {outcome:?}", cell.name());
    }
}

/// Two sensors show no sum: with two, channels of the mains board that died or froze left up to 46 A for up to 85 periods.
#[test]
fn a_channel_of_the_mains_board_that_dies_or_freezes_at_speed_leaves_no_over_current() {
    let mut cells = Vec::new();
    for axis in Axis::ALL {
        for phase in 0..3 {
            for defect in [Defect::Missing, Defect::Frozen] {
                let input = Input::Current(axis, phase);
                cells.push(cell(BoardKind::Mains, input, defect, Situation::Ddfs));
            }
        }
    }
    for (cell, outcome) in cells.iter().zip(outcomes(&cells)) {
        assert_eq!(outcome.hazards, [], "{}: {outcome:?}", cell.name());
    }
}

/// Where a bus that reads nothing makes currents that the comparators see first, it is named all the same.
#[test]
fn a_bus_that_reads_nothing_is_named_in_place_of_the_break_that_it_causes() {
    let input = Input::Bus(Axis::Nut);
    let cell = cell(
        BoardKind::Mains,
        input,
        Defect::StuckLow,
        Situation::Stopping,
    );
    ends_in(cell, Fault::UnderVoltage);
}

/// With both bridges open the two motors coast apart, 2.6 mm in the first of these; the nut's shaft that seizes leaves 5.7 mm.
#[test]
fn the_motor_that_is_left_brings_the_table_to_rest() {
    for (board, input, defect, situation) in [
        (
            BoardKind::Mains,
            Input::DriverFault(Axis::Nut),
            Defect::Missing,
            Situation::Reversing,
        ),
        (
            BoardKind::Mains,
            Input::Encoder(Axis::Nut),
            Defect::WrongSign,
            Situation::Ready,
        ),
        (
            BoardKind::Nucleo,
            Input::Encoder(Axis::Screw),
            Defect::Missing,
            Situation::Ddfs,
        ),
    ] {
        let cell = cell(board, input, defect, situation);
        let outcome = outcomes(&[cell]).remove(0);
        assert!(
            outcome.hazards.is_empty() && outcome.travel_m < 0.5e-3,
            "{}: {outcome:?}",
            cell.name()
        );
    }
}

/// One of the enable switch's contacts is welded, and the switch is opened: with one contact the table went on, 21 mm and more.
#[test]
fn an_enable_switch_with_a_welded_contact_stops_the_drive() {
    for board in [BoardKind::Nucleo, BoardKind::Mains] {
        for contact in [0, 1] {
            let cell = cell(
                board,
                Input::Enable(contact),
                Defect::StuckLow,
                Situation::Ddfs,
            );
            assert_eq!(outcomes(&[cell])[0].hazards, [], "{}", cell.name());
        }
    }
}

/// A homed table has soft limits, which stop it where a welded end switch does not: without them it went on, 20 mm and more.
#[test]
fn a_welded_end_switch_leaves_the_soft_limit() {
    for board in [BoardKind::Nucleo, BoardKind::Mains] {
        for (input, situation) in [
            (Input::EndForward, Situation::Ddfs),
            (Input::EndBackward, Situation::Reversing),
        ] {
            let cell = cell(board, input, Defect::StuckLow, situation);
            let outcome = outcomes(&[cell]).remove(0);
            assert_eq!(outcome.hazards, [], "{}: {outcome:?}", cell.name());
        }
    }
}

/// A bus that reads nothing is named before the alignment misreads what follows from it.
#[test]
fn a_bus_that_reads_nothing_is_named_while_aligning() {
    for axis in Axis::ALL {
        let cell = cell(
            BoardKind::Nucleo,
            Input::Bus(axis),
            Defect::StuckLow,
            Situation::Boot,
        );
        let outcome = &outcomes(&[cell])[0];
        assert_eq!(
            outcome.state,
            State::Fault(Fault::UnderVoltage),
            "{}: {outcome:?}",
            cell.name()
        );
    }
}

/// A loop whose channels are exchanged is unstable: its current doubles in few periods, and its bridge opens with the sample past the
/// limit. Where it was taken to open a period later, there were 21 A for two and a half periods.
#[test]
fn exchanged_channels_end_within_a_period_of_the_limit() {
    for (axis, phase) in [(Axis::Screw, 0), (Axis::Nut, 1), (Axis::Nut, 2)] {
        let input = Input::Current(axis, phase);
        let cell = cell(BoardKind::Nucleo, input, Defect::Swapped, Situation::Cdfs);
        let outcome = outcomes(&[cell]).remove(0);
        assert_eq!(outcome.hazards, [], "{}: {outcome:?}", cell.name());
    }
}

/// An index that moves its own count by more than can be lost is the evidence whose angle is wrong. By the scale alone, which sees it as
/// soon but not whose it is, both motors coasted apart: 9 mm.
#[test]
fn an_index_that_moves_its_count_for_good_is_an_encoders_fault() {
    for situation in [Situation::Ddfs, Situation::Reversing] {
        let input = Input::Index(Axis::Nut);
        let outcome = ends_in(
            cell(BoardKind::Mains, input, Defect::Offset, situation),
            Fault::NutEncoder,
        );
        assert_eq!(outcome.hazards, [], "{situation:?}: {outcome:?}");
    }
}

/// What moves while the screw is located is the nut's encoder alone; an index is passed once, and what jumps again is none.
#[test]
fn a_disturbed_encoder_is_no_wiring() {
    let (nucleo, mains) = (BoardKind::Nucleo, BoardKind::Mains);
    for (board, input, situation) in [
        (nucleo, Input::Encoder(Axis::Nut), Situation::Aligning),
        (mains, Input::Index(Axis::Nut), Situation::Boot),
        (mains, Input::Index(Axis::Nut), Situation::Aligning),
    ] {
        let cell = cell(board, input, Defect::Noisy, situation);
        let outcome = ends_in(cell, Fault::NutAlignment);
        assert_eq!(outcome.hazards, [], "{}: {outcome:?}", cell.name());
    }
}

/// What comes of two faults at once.
fn of_pair(board: BoardKind, faults: [(Input, Defect); 2], situation: Situation) -> Outcome {
    let pair = Pair {
        board,
        faults,
        situation,
    };
    let matrix = Matrix::of_pairs(&[pair]).unwrap();
    matrix.run_pair(&pair).unwrap()
}

/// The motor that is left follows a scale that does not count: it is believed for a
/// millimetre at most, then both coast. Followed for as long as a motor is, it left 54 mm.
#[test]
fn a_scale_that_died_with_the_encoder_is_not_followed() {
    for board in [BoardKind::Nucleo, BoardKind::Mains] {
        for situation in [Situation::Ddfs, Situation::Reversing] {
            let faults = [
                (Input::Encoder(Axis::Screw), Defect::StuckLow),
                (Input::Scale, Defect::Frozen),
            ];
            let outcome = of_pair(board, faults, situation);
            assert_eq!(outcome.hazards, [], "{board:?}, {situation:?}: {outcome:?}");
        }
    }
}

/// Sums of the motor that follows are looked at in each of its steps, and before it follows at all: with them unseen, 69 periods above
/// the limit.
#[test]
fn a_current_that_is_wrong_in_the_motor_that_is_left_ends_it() {
    use Defect::{Missing, StuckHigh, StuckLow, WrongSign};
    let (screw, nut) = (Axis::Screw, Axis::Nut);
    let (mains, nucleo) = (BoardKind::Mains, BoardKind::Nucleo);
    for (board, first, second, situation) in [
        (
            mains,
            (nut, 1, WrongSign),
            (screw, 2, WrongSign),
            Situation::Cdfs,
        ),
        (
            mains,
            (screw, 0, StuckHigh),
            (nut, 1, StuckHigh),
            Situation::Cdfs,
        ),
        (
            nucleo,
            (screw, 2, Missing),
            (nut, 2, StuckLow),
            Situation::Ddfs,
        ),
        (
            nucleo,
            (nut, 2, StuckLow),
            (screw, 1, StuckLow),
            Situation::Cdfs,
        ),
    ] {
        let faults =
            [first, second].map(|(axis, phase, defect)| (Input::Current(axis, phase), defect));
        let outcome = of_pair(board, faults, situation);
        assert_eq!(outcome.hazards, [], "{faults:?}: {outcome:?}");
    }
}

/// A scale that is late makes the loop swing by which the motor that is left follows it.
#[test]
fn a_late_scale_is_not_followed_for_long() {
    let faults = [
        (Input::Scale, Defect::Late),
        (Input::Encoder(Axis::Screw), Defect::Missing),
    ];
    let outcome = of_pair(BoardKind::Nucleo, faults, Situation::Reversing);
    assert_eq!(outcome.hazards, [], "{outcome:?}");
}

/// A scale that is wrong while both motors turn fast costs no more than a stop of both; with both bridges open they coast apart, 9.4 mm on
/// the mains board.
#[test]
fn a_scale_that_is_wrong_at_speed_ends_in_a_stop_of_both() {
    for (board, situation) in [
        (BoardKind::Nucleo, Situation::Ddfs),
        (BoardKind::Mains, Situation::Ddfs),
        (BoardKind::Mains, Situation::Reversing),
    ] {
        let cell = cell(board, Input::Scale, Defect::Offset, situation);
        let outcome = ends_in(cell, Fault::Scale);
        let name = cell.name();
        assert!(outcome.travel_m < 0.1e-3, "{name}: {outcome:?}");
    }
}

/// As the chip's manual has it, and the emulated chip's tests hold the firmware to it.
#[test]
fn a_controller_that_fails_opens_both_bridges_and_begins_anew_where_it_can() {
    use Defect::{Dips, Late, Missing, Offset, StuckLow};
    let supply_low = State::Fault(Fault::ControllerSupply);
    for (input, defect, state, detected) in [
        (Input::Clock, Missing, State::Boot, true),
        (Input::Clock, Offset, State::Running, false),
        (Input::Clock, Late, State::Running, false),
        (Input::Supply, Missing, State::Boot, true),
        (Input::Supply, StuckLow, supply_low, true),
        (Input::Supply, Offset, supply_low, true),
        (Input::Supply, Dips, State::Ready, true),
    ] {
        for board in [BoardKind::Nucleo, BoardKind::Mains] {
            let cell = cell(board, input, defect, Situation::Ddfs);
            let outcome = outcomes(&[cell]).remove(0);
            let name = cell.name();
            assert_eq!(outcome.hazards, [], "{name}: {outcome:?}");
            assert_eq!(outcome.state, state, "{name}");
            // Two looks of the supervision.
            let at_once = outcome.detected_s.map(|seconds| seconds < 3e-3);
            assert_eq!(at_once, detected.then_some(true), "{name}: {outcome:?}");
        }
    }
}

/// What is measured of the supply stops both motors in order while they can be; where it opens both bridges in a reversal of the mains
/// board, they coast apart by 9.4 mm.
#[test]
fn a_supply_that_falls_or_is_noisy_ends_in_a_stop_of_both() {
    for defect in [Defect::Falls, Defect::Noisy] {
        let cell = cell(
            BoardKind::Mains,
            Input::Supply,
            defect,
            Situation::Reversing,
        );
        let outcome = ends_in(cell, Fault::ControllerSupply);
        let name = cell.name();
        assert_eq!(outcome.hazards, [], "{name}: {outcome:?}");
        assert!(outcome.travel_m < 0.5e-3, "{name}: {outcome:?}");
    }
}
