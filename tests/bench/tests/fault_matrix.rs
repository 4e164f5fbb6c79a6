//! The fault matrix, of which no cell may be unsafe, and random pairs of its faults; and what its mends are for.

use bench::faults::{
    Cell, Defect, Drives, Hazard, Input, Interruption, Limits, Matrix, Outcome, Pair, Situation,
    alignment_s, interrupt,
};
use control::fault::Fault;
use control::supervisor::State;
use hal_sim::boards::BoardKind;
use hal_sim::parallel::on_all_cores;
use plant::Axis;
use plant::model::Model;
use std::f64::consts::TAU;

fn outcomes(cells: &[Cell]) -> Vec<Outcome> {
    outcomes_of(cells, Drives::SHIPPED)
}

fn outcomes_of(cells: &[Cell], drives: Drives) -> Vec<Outcome> {
    let matrix = Matrix::of(cells, drives).unwrap();
    matrix.run_all(cells).unwrap()
}

/// Every seventh cell, so in each situation, of which there are eight; `cargo xtask bench faults` runs all.
#[test]
fn no_cell_is_unsafe() {
    let cells: Vec<Cell> = Cell::all().into_iter().step_by(7).collect();
    none_is_unsafe(&cells, Drives::SHIPPED);
}

/// Every fifty-third cell, for the quick check, which leaves out the others.
#[test]
fn no_sampled_cell_is_unsafe() {
    let cells: Vec<Cell> = Cell::all().into_iter().step_by(53).collect();
    none_is_unsafe(&cells, Drives::SHIPPED);
}

/// A sample; `cargo xtask bench faults --compensated` runs all.
#[test]
fn no_cell_is_unsafe_with_compensation() {
    let cells: Vec<Cell> = Cell::all().into_iter().step_by(11).collect();
    none_is_unsafe(&cells, Drives::COMPENSATED);
}

fn none_is_unsafe(cells: &[Cell], drives: Drives) {
    let hazardous: Vec<String> = cells
        .iter()
        .zip(outcomes_of(cells, drives))
        .filter(|(_, outcome)| !outcome.hazards.is_empty())
        .map(|(cell, outcome)| format!("{}: {:?}", cell.name(), outcome.hazards))
        .collect();
    assert!(
        hazardous.is_empty(),
        "of {} cells, unsafe are:\n{}",
        cells.len(),
        hazardous.join("\n")
    );
}

/// How many defects an input has, by hand: a defect or an input that the matrix loses shows here.
fn defects(input: Input) -> usize {
    match input {
        Input::Current(..) | Input::Encoder(_) => 9,
        Input::Bus(_) | Input::Temperature(_) | Input::Scale | Input::Command => 7,
        Input::EndForward | Input::EndBackward | Input::Supply => 6,
        Input::Enable(_) => 5,
        Input::DriverFault(_) | Input::Clock => 4,
        Input::Index(_) | Input::Heartbeat | Input::Demand => 3,
        Input::Reset => 2,
    }
}

#[test]
fn the_matrix_has_each_defect_of_each_input_in_each_situation() {
    let cells = Cell::all();
    // Six currents; bus, temperature, encoder and driver of two motors; the nut's index on the mains board; eleven inputs of the pair.
    for (board, inputs) in [
        (BoardKind::Nucleo, 6 + 8 + 11),
        (BoardKind::Mains, 6 + 8 + 1 + 11),
    ] {
        let of_board: Vec<Input> = Input::of(board);
        assert_eq!(of_board.len(), inputs, "{board:?}");
        for input in of_board {
            for situation in Situation::ALL {
                let here =
                    |c: &&Cell| c.board == board && c.input == input && c.situation == situation;
                assert_eq!(
                    cells.iter().filter(here).count(),
                    defects(input),
                    "{board:?}, {}, {}",
                    input.name(),
                    situation.name()
                );
            }
        }
    }
}

#[test]
fn the_matrix_repeats_bit_for_bit() {
    let some: Vec<Cell> = Cell::all().into_iter().step_by(311).collect();
    assert_eq!(outcomes(&some), outcomes(&some));
}

/// This input with this defect cannot be right for 20 ms at 800 rpm and 20 mm/s. Others look right, are slow or wait for an event.
fn shows_at_once(input: Input, defect: Defect) -> bool {
    use Defect::{Dips, Frozen, Late, Missing, Noisy, Offset, StuckHigh, StuckLow, WrongSign};
    match input {
        // A channel that stands is near its current where that is small.
        Input::Current(..) => matches!(defect, StuckLow | StuckHigh | Offset | WrongSign),
        Input::Bus(_) => matches!(defect, StuckLow | StuckHigh),
        Input::Temperature(_) => matches!(defect, StuckLow | StuckHigh),
        Input::Encoder(_) => !matches!(defect, Noisy | Late),
        Input::Index(_) => defect == Offset,
        Input::DriverFault(_) => defect == StuckLow,
        Input::Scale => matches!(
            defect,
            Frozen | StuckLow | StuckHigh | Offset | Noisy | WrongSign
        ),
        Input::EndForward | Input::EndBackward => matches!(defect, Missing | WrongSign),
        Input::Enable(_) => matches!(defect, Missing | WrongSign | Noisy),
        Input::Command | Input::Heartbeat | Input::Demand => false,
        Input::Clock => defect == Missing,
        Input::Reset => true,
        Input::Supply => matches!(defect, Missing | StuckLow | Offset | Dips),
    }
}

/// A watch that is lost shows here.
#[test]
fn what_cannot_be_right_is_found_within_20_ms() {
    let cells: Vec<Cell> = Cell::all()
        .into_iter()
        .filter(|c| c.situation == Situation::Ddfs && shows_at_once(c.input, c.defect))
        .collect();
    let late: Vec<String> = cells
        .iter()
        .zip(outcomes(&cells))
        .filter(|(_, outcome)| outcome.detected_s.is_none_or(|seconds| seconds > 20e-3))
        .map(|(cell, outcome)| format!("{}: {:?} s", cell.name(), outcome.detected_s))
        .collect();
    assert!(late.is_empty(), "of {}:\n{}", cells.len(), late.join("\n"));
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
    let matrix = Matrix::of_pairs(&[pair], Drives::SHIPPED).unwrap();
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
        // Nothing moves by itself: it waits to be aligned.
        (Input::Supply, Dips, State::Unaligned, true),
        (Input::Reset, Dips, State::Unaligned, true),
        (Input::Reset, StuckLow, State::Boot, true),
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

/// The measured supply stops both motors in order while they can be driven. Where it opens both bridges in a reversal of the mains
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

/// Two faults on a board in a situation.
type Named = (BoardKind, [(Input, Defect); 2], Situation);

/// Pairs of which none is unsafe.
fn assert_safe(pairs: &[Named]) {
    for (board, faults, situation) in pairs {
        let outcome = of_pair(*board, *faults, *situation);
        assert_eq!(
            outcome.hazards,
            [],
            "{board:?}, {faults:?}, {situation:?}: {outcome:?}"
        );
    }
}

/// A scale that counts the wrong way asks the motor that follows it for more and more speed: 41 mm in the second.
#[test]
fn a_scale_of_the_wrong_sign_is_not_followed() {
    let scale = (Input::Scale, Defect::WrongSign);
    let (screw, nut) = (Axis::Screw, Axis::Nut);
    assert_safe(&[
        (
            BoardKind::Nucleo,
            [(Input::DriverFault(nut), Defect::StuckLow), scale],
            Situation::Reversing,
        ),
        (
            BoardKind::Mains,
            [(Input::Current(screw, 1), Defect::WrongSign), scale],
            Situation::Ddfs,
        ),
        (
            BoardKind::Mains,
            [(Input::Current(nut, 1), Defect::StuckLow), scale],
            Situation::Stopping,
        ),
        // The encoder's jump is over before the choice is made.
        (
            BoardKind::Mains,
            [(Input::Encoder(nut), Defect::Offset), scale],
            Situation::Reversing,
        ),
    ]);
}

/// A late scale makes the loop swing that follows it: up to 4.1 mm.
#[test]
fn a_late_scale_is_not_followed_after_a_fault_of_a_current() {
    let late = (Input::Scale, Defect::Late);
    for (axis, phase, defect) in [
        (Axis::Nut, 2, Defect::StuckHigh),
        (Axis::Nut, 0, Defect::Offset),
        (Axis::Nut, 1, Defect::Noisy),
        (Axis::Screw, 1, Defect::WrongSign),
    ] {
        let faults = [(Input::Current(axis, phase), defect), late];
        assert_safe(&[(BoardKind::Nucleo, faults, Situation::Ddfs)]);
    }
}

/// The encoders are preferred after a fault of a current. One whose frames fail leaves a prediction that goes on at the same speed: 54 mm.
#[test]
fn an_encoder_that_died_with_a_current_is_not_followed() {
    let encoder = (Input::Encoder(Axis::Screw), Defect::Missing);
    let current = |phase, defect| (Input::Current(Axis::Screw, phase), defect);
    assert_safe(&[
        (
            BoardKind::Mains,
            [current(0, Defect::StuckHigh), encoder],
            Situation::Reversing,
        ),
        (
            BoardKind::Mains,
            [current(1, Defect::Offset), encoder],
            Situation::Stopping,
        ),
        // One that jumps, and then shows the other motor's angle or stands: 10.7 and 5.1 mm.
        (
            BoardKind::Nucleo,
            [
                current(2, Defect::Offset),
                (Input::Encoder(Axis::Screw), Defect::Swapped),
            ],
            Situation::Stopping,
        ),
        (
            BoardKind::Nucleo,
            [current(1, Defect::Swapped), encoder],
            Situation::Reversing,
        ),
        // Both are slow, and a disagreement ends it.
        (
            BoardKind::Mains,
            [
                current(0, Defect::Swapped),
                (Input::Encoder(Axis::Nut), Defect::Missing),
            ],
            Situation::Cdfs,
        ),
    ]);
}

/// A scale that jumps once is right before and after it. Without it 24 mm.
#[test]
fn a_scale_that_jumps_once_is_followed() {
    let faults = [
        (Input::Encoder(Axis::Nut), Defect::StuckLow),
        (Input::Scale, Defect::Offset),
    ];
    assert_safe(&[(BoardKind::Mains, faults, Situation::Ddfs)]);
}

/// A stop is on its way when an encoder fails: the motor that is left brings it to its end. With both bridges open: 2.1 mm.
#[test]
fn a_stop_that_an_encoder_interrupts_is_brought_to_its_end() {
    let faults = [
        (Input::Enable(0), Defect::Missing),
        (Input::Encoder(Axis::Nut), Defect::WrongSign),
    ];
    assert_safe(&[(BoardKind::Mains, faults, Situation::Cdfs)]);
}

/// An encoder that died at rest is found before its motor is fast. Found by the scale 0.2 mm later: 4.4 mm.
#[test]
fn an_encoder_that_died_at_rest_is_found_at_the_start() {
    for command in [Defect::StuckLow, Defect::StuckHigh] {
        for encoder in [Defect::Frozen, Defect::StuckHigh] {
            let faults = [
                (Input::Command, command),
                (Input::Encoder(Axis::Nut), encoder),
            ];
            assert_safe(&[(BoardKind::Mains, faults, Situation::Ready)]);
        }
    }
}

/// The nut turns at 800 rpm, and the screw too slowly for its voltage to show an angle. With both bridges open: 22.7 mm.
#[test]
fn a_scale_that_is_wrong_while_one_motor_is_fast_ends_in_a_stop_of_both() {
    let faults = [
        (Input::Command, Defect::StuckLow),
        (Input::Scale, Defect::Late),
    ];
    assert_safe(&[(BoardKind::Mains, faults, Situation::Ready)]);
}

/// The sum of three currents is looked at in half of the steps while both motors run. With one look a millisecond, up to 34 periods above
/// the limit; in three steps of eight, up to 5.5.
#[test]
fn a_channel_and_another_or_its_encoder_that_are_wrong_at_once_end_in_time() {
    use Defect::{Frozen, Missing, Swapped, WrongSign};
    let of = |axis, first: (usize, Defect), second: (usize, Defect)| {
        [first, second].map(|(phase, defect)| (Input::Current(axis, phase), defect))
    };
    let (screw, nut) = (Axis::Screw, Axis::Nut);
    let with_encoder = |(phase, defect), encoder| {
        let channel = (Input::Current(screw, phase), defect);
        [channel, (Input::Encoder(screw), encoder)]
    };
    assert_safe(&[
        (
            BoardKind::Mains,
            of(screw, (1, Swapped), (2, Frozen)),
            Situation::Cdfs,
        ),
        (
            BoardKind::Mains,
            of(nut, (2, Missing), (0, WrongSign)),
            Situation::Ddfs,
        ),
        (
            BoardKind::Nucleo,
            of(nut, (0, WrongSign), (1, Frozen)),
            Situation::Cdfs,
        ),
        (
            BoardKind::Mains,
            with_encoder((1, Missing), Defect::Late),
            Situation::Reversing,
        ),
        (
            BoardKind::Mains,
            with_encoder((0, Frozen), Defect::Offset),
            Situation::Ddfs,
        ),
        // Two channels that stand turn the voltage as a wrong angle does. Its sentence names the current sensors too.
        (
            BoardKind::Nucleo,
            of(screw, (0, Frozen), (2, Frozen)),
            Situation::Stopping,
        ),
    ]);
}

/// An end switch that the drive really reached is no wrong cause, also where it is reached sooner than by a healthy drive.
#[test]
fn an_end_switch_that_is_reached_is_a_right_cause() {
    let faults = [
        (Input::Current(Axis::Screw, 2), Defect::Frozen),
        (Input::EndBackward, Defect::Late),
    ];
    let outcome = of_pair(BoardKind::Nucleo, faults, Situation::Cdfs);
    assert_eq!(outcome.state, State::Fault(Fault::EndForward));
    assert!(!outcome.wrong_cause, "{outcome:?}");
}

/// Pairs that no control can mend are judged unsafe still, with their figures. So what is counted can be dangerous.
#[test]
fn what_stays_unsafe_is_known() {
    let mains = BoardKind::Mains;
    let (welded, frozen) = (Defect::StuckLow, Defect::Frozen);
    for (faults, situation, hazard, travel_mm) in [
        // Nobody can see a switch of which both contacts are welded.
        (
            [(Input::Enable(0), welded), (Input::Enable(1), welded)],
            Situation::Cdfs,
            Hazard::Travel,
            2.71,
        ),
        // Each driver opens its bridge and its line opens the other's: both coast, from a speed of the table that a wrong command has asked.
        (
            [
                (Input::Command, Defect::StuckHigh),
                (Input::DriverFault(Axis::Screw), Defect::Swapped),
            ],
            Situation::Ddfs,
            Hazard::Travel,
            3.89,
        ),
        // Two channels of three that stand hide a current in their two phases.
        (
            [0, 2].map(|phase| (Input::Current(Axis::Screw, phase), frozen)),
            Situation::Reversing,
            Hazard::OverCurrent,
            0.0,
        ),
    ] {
        let outcome = of_pair(mains, faults, situation);
        assert_eq!(outcome.hazards, [hazard], "{faults:?}: {outcome:?}");
        assert!(
            outcome.travel_m < 1.1e-3 * travel_mm + 0.1e-3,
            "{faults:?}: {outcome:?}"
        );
    }
}

/// How far a motor of the mains board's machine coasts, m of the table, that turns at `omega` rad/s when its bridge opens:
/// `J omega^2 / 2` over the friction of its bearing and of the pair, with the sign of `omega`.
fn coasts_m(omega: f64) -> f64 {
    let model = Model::coupled();
    let friction_nm = model.nut.coulomb_nm + model.feed.pair_coulomb_nm;
    let energy_j = model.nut.inertia_kg_m2 * omega * omega.abs() / 2.0;
    energy_j / friction_nm * model.feed.travel_per_radian()
}

/// A wrong encoder whose scale is dead too shows in the motor's voltage alone. At the slowest speed where that can be seen, by the
/// watch's floor, the motor coasts too far already.
#[test]
fn a_voltage_shows_a_wrong_angle_only_where_a_motor_coasts_too_far() {
    let plate = BoardKind::Mains.plate();
    let [_, nut] = &plate.motors;
    let [_, limits] = &plate.config().unwrap().runaway;
    // A quantum of the floor is 2^-18 V.
    let floor_v = f64::from(limits.emf_floor) / f64::from(1 << 18);
    let shows_rad_s = floor_v / (f64::from(nut.pole_pairs) * nut.flux_wb);
    let way_m = coasts_m(shows_rad_s);
    assert!(
        way_m > Limits::OF_THE_MATRIX.travel_m,
        "{shows_rad_s} rad/s, {way_m} m"
    );
}

/// Screw and nut coast from the largest velocity that a wrong command asks, each by itself, once hardware has opened both bridges. Their
/// difference is the way of the table.
#[test]
fn two_open_bridges_leave_a_fast_table_too_long_a_way() {
    let plate = BoardKind::Mains.plate();
    let base_rad_s = 800.0 / 60.0 * TAU;
    let table_rad_s = plate.feed.velocity_max * TAU / plate.feed.lead_m;

    let way_m = coasts_m(base_rad_s) - coasts_m(base_rad_s - table_rad_s);
    assert!(way_m > Limits::OF_THE_MATRIX.travel_m, "{way_m} m");
}

/// Pairs of which some are unsafe, and why no control here mends them.
fn is_explained(pair: &Pair) -> bool {
    let has = |input: fn(Input) -> bool, defects: &[Defect]| {
        let mut faults = pair.faults.iter();
        faults.any(|(is, defect)| input(*is) && defects.contains(defect))
    };
    let of_currents = |axis: Axis| {
        let current = |input: &Input| matches!(input, Input::Current(at, _) if *at == axis);
        pair.faults
            .iter()
            .filter(|(input, _)| current(input))
            .count()
    };
    // Two channels of three: the third does not show what flows from one of these phases to the other.
    let unseen = Axis::ALL.into_iter().any(|axis| of_currents(axis) == 2);
    // See `a_voltage_shows_a_wrong_angle_only_where_a_motor_coasts_too_far`.
    let runaway = has(
        |input| matches!(input, Input::Encoder(_)),
        &[Defect::WrongSign, Defect::Swapped],
    );
    // See `two_open_bridges_leave_a_fast_table_too_long_a_way`.
    let exchanged = has(
        |input| matches!(input, Input::DriverFault(_)),
        &[Defect::Swapped],
    );
    let fast = exchanged && has(|input| input == Input::Command, &Defect::ALL);
    let welded = pair
        .faults
        .iter()
        .all(|(input, defect)| matches!(input, Input::Enable(_)) && *defect == Defect::StuckLow);
    unseen || runaway || fast || welded
}

/// `cargo xtask bench faults --pairs 1000 --pair-seed 2` runs others.
#[test]
fn of_random_pairs_at_most_one_is_unsafe_and_it_is_explained() {
    let pairs = Pair::drawn(1000, 1);
    let matrix = Matrix::of_pairs(&pairs, Drives::SHIPPED).unwrap();
    let outcomes = on_all_cores(&pairs, |pair| matrix.run_pair(pair).unwrap());
    let unsafe_pairs: Vec<(&Pair, Outcome)> = pairs
        .iter()
        .zip(outcomes)
        .filter(|(_, outcome)| !outcome.hazards.is_empty())
        .collect();
    let told: Vec<String> = unsafe_pairs
        .iter()
        .map(|(pair, outcome)| format!("{}: {outcome:?}", pair.name()))
        .collect();
    assert!(
        unsafe_pairs.len() <= 1 && unsafe_pairs.iter().all(|(pair, _)| is_explained(pair)),
        "{}",
        told.join("\n")
    );
}

/// An alignment that is interrupted at a few random moments by each cause. `cargo xtask bench faults --interruptions 1000` has more.
#[test]
fn an_interrupted_alignment_rests_and_aligns_again() {
    const MOMENTS: u64 = 3;
    let mut all = Vec::new();
    for board in [BoardKind::Nucleo, BoardKind::Mains] {
        let whole_s = alignment_s(board, 1).unwrap();
        for interruption in Interruption::ALL {
            all.extend((0..MOMENTS).map(|draw| (board, interruption, whole_s, draw)));
        }
    }
    let outcomes = on_all_cores(&all, |(board, interruption, whole_s, draw)| {
        interrupt(*board, *interruption, 1, *whole_s, *draw).unwrap()
    });
    for ((board, interruption, ..), outcome) in all.iter().zip(outcomes) {
        let name = interruption.name();
        assert!(outcome.is_right(), "{board:?}, {name}: {outcome:?}");
    }
}
