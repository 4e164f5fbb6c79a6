//! The matrix as a page: a square for each cell.

use super::{Report, board_name};
use hal_sim::boards::BoardKind;
use hal_sim::faults::{Cell, Defect, Input, Outcome, Situation};
use page::document::{document, escape};
use std::collections::HashMap;
use std::fmt::Write;

/// Side of a square, px.
const SIDE: usize = 11;
/// Width of the inputs' names, px.
const NAMES: usize = 150;
/// Height of the situations' names, px.
const HEAD: usize = 18;
/// Between two situations, px.
const GAP: usize = 8;

/// The page.
pub(super) fn page(report: &Report, cells: &[Cell], outcomes: &[Outcome]) -> String {
    let mut body = format!(
        "<p>{} cells, {} unsafe. A square is an input (row) that is wrong in one of nine ways (from left to right: {}) while \
         the drive is in a situation (column). Filled: unsafe; a ring: detected, or harmless; a dot: no such cell. Point at a \
         square to read what came of it.</p>\n",
        report.cells,
        report.hazardous,
        Defect::ALL.map(Defect::name).join(", ")
    );
    for board in [BoardKind::Nucleo, BoardKind::Mains] {
        let of_board: HashMap<_, _> = cells
            .iter()
            .zip(outcomes)
            .filter(|(cell, _)| cell.board == board)
            .map(|(cell, outcome)| ((cell.input, cell.defect, cell.situation), outcome))
            .collect();
        let _ = write!(
            body,
            "<h2>{}</h2>\n<figure>{}</figure>\n",
            board_name(board),
            picture(board, &of_board)
        );
    }
    body += "<h2>Unsafe cells</h2>\n<div class=\"scroll\"><table>\n<tr><th>board</th><th>input</th><th>defect</th>\
             <th>situation</th><th>by</th><th>first cause</th><th>after, ms</th><th>peak, A</th><th>travel, mm</th></tr>\n";
    for detail in report.cells_detail.iter().filter(|d| !d.hazards.is_empty()) {
        let _ = writeln!(
            body,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.1}</td><td>{:.2}</td></tr>",
            escape(detail.board),
            escape(&detail.input),
            detail.defect,
            escape(detail.situation),
            detail.hazards.join(", "),
            escape(detail.first_cause.unwrap_or("none")),
            detail
                .detection_us
                .map_or("\u{2013}".into(), |us| format!("{:.1}", us / 1e3)),
            detail.peak_a,
            detail.travel_mm
        );
    }
    body += "</table></div>\n";
    body += &super::story::page(&report.scenarios);
    document("Fault matrix", &body)
}

fn picture(board: BoardKind, outcomes: &HashMap<(Input, Defect, Situation), &Outcome>) -> String {
    let inputs = Input::of(board);
    let block = Defect::ALL.len() * SIDE + GAP;
    let (width, height) = (
        NAMES + Situation::ALL.len() * block,
        HEAD + inputs.len() * (SIDE + 3),
    );
    let mut svg = format!(
        "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" font-size=\"11\"><title>Fault matrix of {}</title>\n",
        board_name(board)
    );
    for (k, situation) in Situation::ALL.iter().enumerate() {
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"11\" fill=\"#5A626B\">{}</text>",
            NAMES + k * block,
            escape(situation.name())
        );
    }
    for (row, input) in inputs.iter().enumerate() {
        let y = HEAD + row * (SIDE + 3);
        let _ = writeln!(
            svg,
            "<text x=\"0\" y=\"{}\" fill=\"#1B1F24\">{}</text>",
            y + SIDE - 2,
            escape(&input.name())
        );
        for (k, situation) in Situation::ALL.iter().enumerate() {
            for (d, defect) in Defect::ALL.iter().enumerate() {
                let x = NAMES + k * block + d * SIDE;
                svg += &square((x, y), outcomes.get(&(*input, *defect, *situation)), || {
                    format!("{} {}, {}", input.name(), defect.name(), situation.name())
                });
            }
        }
    }
    svg + "</svg>"
}

fn square((x, y): (usize, usize), outcome: Option<&&Outcome>, name: impl Fn() -> String) -> String {
    let Some(outcome) = outcome else {
        return format!(
            "<circle cx=\"{}\" cy=\"{}\" r=\"0.8\" fill=\"#5A626B\"/>\n",
            x + SIDE / 2,
            y + SIDE / 2
        );
    };
    let hazards: Vec<_> = outcome.hazards.iter().map(|h| h.name()).collect();
    let (class, said) = if hazards.is_empty() {
        (
            "fill=\"none\" stroke=\"#0B62A8\"",
            format!("safe: {:?}", outcome.state),
        )
    } else {
        (
            "fill=\"#C2410C\" stroke=\"#C2410C\"",
            format!("unsafe by {}: {:?}", hazards.join(" and "), outcome.state),
        )
    };
    format!(
        "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" {class}><title>{}: {}, {:.2} mm, {:.1} A</title></rect>\n",
        x + 1,
        y + 1,
        SIDE - 2,
        SIDE - 2,
        escape(&name()),
        escape(&said),
        1e3 * outcome.travel_m,
        outcome.peak_a
    )
}
