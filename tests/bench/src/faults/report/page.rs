//! The matrix as a page: a square for each cell.

use super::{Detail, Report, board_name, worst};
use crate::faults::{Cell, Defect, Input, Limits, Outcome, Situation};
use askama::Template;
use hal_sim::boards::BoardKind;
use page::document::document;
use page::drawing::{Anchor, Point, Shape, drawing};
use page::markup::Markup;
use page::table::Kind;
use std::collections::HashMap;

/// Side of a square, px.
const SIDE: f64 = 11.0;
/// Width of the inputs' names, px.
const NAMES: f64 = 150.0;
/// Height of the situations' names and the defects' letters, px.
const HEAD: f64 = 30.0;
/// Between two situations, px.
const GAP: f64 = 8.0;

/// The page.
pub(super) fn page(report: &Report, cells: &[Cell], outcomes: &[Outcome]) -> String {
    let boards = [BoardKind::Nucleo, BoardKind::Mains].map(|board| {
        let of_board: HashMap<_, _> = cells
            .iter()
            .zip(outcomes)
            .filter(|(cell, _)| cell.board == board)
            .map(|(cell, outcome)| ((cell.input, cell.defect, cell.situation), outcome))
            .collect();
        let name = board_name(board);
        (name, picture(board, &of_board), table(report, name))
    });
    let limits = Limits::OF_THE_MATRIX;
    document(
        "Fault matrix",
        &Body {
            report,
            limits,
            boards,
        },
    )
}

#[derive(Template)]
#[template(path = "faults.html")]
struct Body<'a> {
    report: &'a Report,
    limits: Limits,
    /// Name, matrix and unsafe cells of each board.
    boards: [(&'static str, Markup, Markup); 2],
}

/// The unsafe cells of a board: those of one input and defect that end alike in a row, with the worst of their figures.
fn table(report: &Report, board: &str) -> Markup {
    let details = report.cells_detail.iter();
    let mut rows: Vec<Vec<&Detail>> = Vec::new();
    for detail in details.filter(|d| d.board == board && !d.hazards.is_empty()) {
        let key = |d: &Detail| {
            let cause = d.first_cause.unwrap_or("none");
            (d.input.clone(), d.defect, d.hazards.clone(), cause)
        };
        match rows.iter_mut().find(|row| key(row[0]) == key(detail)) {
            Some(row) => row.push(detail),
            None => rows.push(vec![detail]),
        }
    }
    let rows = rows.into_iter().map(|row| {
        let first = row[0];
        let situations: Vec<_> = row.iter().map(|d| d.situation).collect();
        let of = |figure: fn(&Detail) -> f64| worst(row.iter().map(|d| figure(d)));
        let latest = row.iter().filter_map(|d| d.detection_us).reduce(f64::max);
        [
            format!("{} {}", first.input, first.defect),
            format!("{:.2}", of(|d| d.travel_mm)),
            format!("{:.1}", of(|d| d.overcurrent_periods)),
            format!("{:.1}", of(|d| d.peak_a)),
            latest.map_or("not seen".into(), |us| format!("{:.1}", us / 1e3)),
            situations.join(", "),
            format!(
                "{}; {}",
                first.hazards.join(", "),
                first.first_cause.unwrap_or("no fault")
            ),
        ]
    });
    let columns = [
        ("input, defect", Kind::Text),
        ("travel, mm", Kind::Number),
        ("over, periods", Kind::Number),
        ("peak, A", Kind::Number),
        ("after, ms", Kind::Number),
        ("situations", Kind::Long),
        ("unsafe by; named", Kind::Long),
    ];
    page::table::table("Unsafe cells", columns, rows)
}

/// Above a defect's column.
const fn letter(defect: Defect) -> char {
    match defect {
        Defect::Missing => 'm',
        Defect::Frozen => 'f',
        Defect::StuckLow => 'l',
        Defect::StuckHigh => 'h',
        Defect::Offset => 'o',
        Defect::Noisy => 'n',
        Defect::Late => 'd',
        Defect::WrongSign => 's',
        Defect::Swapped => 'x',
        Defect::Dips => 'p',
        Defect::Falls => 'r',
    }
}

fn picture(board: BoardKind, outcomes: &HashMap<(Input, Defect, Situation), &Outcome>) -> Markup {
    const MUTED: &str = "#5A626B";
    let inputs = Input::of(board);
    let block = Defect::ALL.len() as f64 * SIDE + GAP;
    let (width, height) = (
        NAMES + Situation::ALL.len() as f64 * block,
        HEAD + inputs.len() as f64 * (SIDE + 3.0),
    );
    let left = |k: usize| NAMES + k as f64 * block;
    let mut shapes = Vec::new();
    for (k, situation) in Situation::ALL.iter().enumerate() {
        let at = (left(k), 11.0);
        shapes.push(Shape::text(at, Anchor::Start, MUTED, situation.name()));
        for (d, defect) in Defect::ALL.iter().enumerate() {
            let at = (left(k) + (d as f64 + 0.5) * SIDE, 24.0);
            let letter = letter(*defect).to_string();
            shapes.push(Shape::text(at, Anchor::Middle, MUTED, letter).px(9.0));
        }
    }
    for (row, input) in inputs.iter().enumerate() {
        let y = HEAD + row as f64 * (SIDE + 3.0);
        let at = (0.0, y + SIDE - 2.0);
        shapes.push(Shape::text(at, Anchor::Start, "#1B1F24", input.name()));
        for (k, situation) in Situation::ALL.iter().enumerate() {
            for (d, defect) in Defect::ALL.iter().enumerate() {
                if let Some(outcome) = outcomes.get(&(*input, *defect, *situation)) {
                    let name = format!("{} {}, {}", input.name(), defect.name(), situation.name());
                    shapes.push(square((left(k) + d as f64 * SIDE, y), outcome, &name));
                }
            }
        }
    }
    let about = format!("Fault matrix of {}", board_name(board));
    drawing(&about, (width, height), 11.0, &shapes)
}

fn square((x, y): Point, outcome: &Outcome, name: &str) -> Shape {
    let hazards: Vec<_> = outcome.hazards.iter().map(|h| h.name()).collect();
    let ended = super::cause(outcome.state).unwrap_or_else(|| outcome.state.name());
    let judged = match (hazards.is_empty(), outcome.detected_s) {
        (false, _) => format!("unsafe by {}", hazards.join(" and ")),
        (true, Some(seconds)) => format!("detected after {:.1} ms", 1e3 * seconds),
        (true, None) => "harmless".into(),
    };
    let told = format!(
        "{name}: {judged}, ended as {ended}, {:.2} mm, {:.1} A",
        1e3 * outcome.travel_m,
        outcome.peak_a
    );
    let (at, size) = ((x + 1.0, y + 1.0), (SIDE - 2.0, SIDE - 2.0));
    let shape = if !hazards.is_empty() {
        Shape::rectangle(at, size, "#C2410C", ("#C2410C", 1.0))
    } else if outcome.detected_s.is_some() {
        // Filled with nothing that shows, so that pointing inside it finds it.
        Shape::rectangle(at, size, "transparent", ("#0B62A8", 1.0))
    } else {
        Shape::dot((x + SIDE / 2.0, y + SIDE / 2.0), 2.0, "#5A626B")
    };
    shape.told(told)
}
