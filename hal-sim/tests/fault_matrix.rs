//! A part of the fault matrix, whose number of unsafe cells may only fall.

use hal_sim::faults::{Cell, Matrix, Outcome};

fn outcomes(cells: &[Cell]) -> Vec<Outcome> {
    Matrix::of(cells).unwrap().run_all(cells).unwrap()
}

/// Each so-many-th cell, prime to the number of situations, so that all are among them.
const EVERY: usize = 19;
/// Unsafe cells of these.
const UNSAFE: usize = 12;

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
    let count = hazardous.len();
    assert!(
        count <= UNSAFE,
        "{count} of {} cells are unsafe, {UNSAFE} were:\n{}",
        cells.len(),
        hazardous.join("\n")
    );
    assert!(
        count == UNSAFE,
        "{count} of {} cells are unsafe, {UNSAFE} were: lower the number here",
        cells.len()
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
