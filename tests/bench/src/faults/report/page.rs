//! The matrix as a page: a square for each cell.

use super::{Detail, Report, board_name, worst};
use crate::faults::{Cell, Defect, Input, Limits, Outcome, Situation};
use hal_sim::boards::BoardKind;
use page::document::{document, escape};
use std::collections::HashMap;
use std::fmt::Write;

/// Side of a square, px.
const SIDE: usize = 11;
/// Width of the inputs' names, px.
const NAMES: usize = 150;
/// Height of the situations' names and the defects' letters, px.
const HEAD: usize = 30;
/// Between two situations, px.
const GAP: usize = 8;

/// The page.
pub(super) fn page(report: &Report, cells: &[Cell], outcomes: &[Outcome]) -> String {
    let limits = Limits::OF_THE_MATRIX;
    let mut body = format!(
        "<p class=\"result\">{} of {} cells are unsafe.</p>\n<p>A cell is an input (row) that is wrong in one way while the \
         drive is in a situation (column): {}. A filled square: unsafe; a hollow one: detected in time; a dot: harmless, without a \
         fault of its own; nothing: there is no such cell. Point at a cell to read what came of it.</p>\n<p>Unsafe is a phase current \
         above the board's limit for more than {} PWM period after a sensor could see it, a table that moves by more than {} mm \
         beyond a regular stop, and a named cause that sends a person to another part.</p>\n",
        report.hazardous,
        report.cells,
        Defect::ALL
            .map(|defect| format!("<b>{}</b> {}", letter(defect), defect.name()))
            .join(", "),
        limits.over_current_periods,
        1e3 * limits.travel_m
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
    body += "<h2>Unsafe cells</h2>\n";
    for board in [BoardKind::Nucleo, BoardKind::Mains] {
        body += &table(report, board_name(board));
    }
    body += &super::story::page(&report.scenarios);
    document("Fault matrix", &body)
}

/// The unsafe cells of a board: those of one input and defect that end alike in a row, with the worst of their figures.
fn table(report: &Report, board: &str) -> String {
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
    if rows.is_empty() {
        return format!("<h3>{}</h3>\n<p>None.</p>\n", escape(board));
    }
    let mut html = format!(
        "<h3>{}</h3>\n<div class=\"scroll\"><table>\n<thead><tr><th class=\"text\">input, defect</th><th>travel, mm</th>\
         <th>over, periods</th><th>peak, A</th><th>after, ms</th><th class=\"text\">situations</th>\
         <th class=\"text\">unsafe by; named</th></tr></thead>\n<tbody>\n",
        escape(board)
    );
    for row in rows {
        let first = row[0];
        let situations: Vec<_> = row.iter().map(|d| d.situation).collect();
        let of = |figure: fn(&Detail) -> f64| worst(row.iter().map(|d| figure(d)));
        let latest = row.iter().filter_map(|d| d.detection_us).reduce(f64::max);
        let _ = writeln!(
            html,
            "<tr><td class=\"text\">{} {}</td><td>{:.2}</td><td>{:.1}</td><td>{:.1}</td><td>{}</td><td class=\"long\">{}</td>\
             <td class=\"long\">{}; {}</td></tr>",
            escape(&first.input),
            first.defect,
            of(|d| d.travel_mm),
            of(|d| d.overcurrent_periods),
            of(|d| d.peak_a),
            latest.map_or("not seen".into(), |us| format!("{:.1}", us / 1e3)),
            escape(&situations.join(", ")),
            first.hazards.join(", "),
            escape(first.first_cause.unwrap_or("no fault")),
        );
    }
    html + "</tbody></table></div>\n"
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
        for (d, defect) in Defect::ALL.iter().enumerate() {
            let _ = writeln!(
                svg,
                "<text x=\"{}\" y=\"24\" font-size=\"9\" text-anchor=\"middle\" fill=\"#5A626B\">{}</text>",
                NAMES + k * block + d * SIDE + SIDE / 2,
                letter(*defect)
            );
        }
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
        return String::new();
    };
    let hazards: Vec<_> = outcome.hazards.iter().map(|h| h.name()).collect();
    let ended = super::cause(outcome.state).unwrap_or_else(|| outcome.state.name());
    let judged = match (hazards.is_empty(), outcome.detected_s) {
        (false, _) => format!("unsafe by {}", hazards.join(" and ")),
        (true, Some(seconds)) => format!("detected after {:.1} ms", 1e3 * seconds),
        (true, None) => "harmless".into(),
    };
    let said = format!(
        "<title>{}: {}, ended as {}, {:.2} mm, {:.1} A</title>",
        escape(&name()),
        escape(&judged),
        escape(ended),
        1e3 * outcome.travel_m,
        outcome.peak_a
    );
    let rect = |class: &str| {
        format!(
            "<rect x=\"{}\" y=\"{}\" width=\"{side}\" height=\"{side}\" {class}>{said}</rect>\n",
            x + 1,
            y + 1,
            side = SIDE - 2
        )
    };
    if !hazards.is_empty() {
        rect("fill=\"#C2410C\" stroke=\"#C2410C\"")
    } else if outcome.detected_s.is_some() {
        // Filled with nothing that shows, so that pointing inside it finds it.
        rect("fill=\"#0B62A8\" fill-opacity=\"0\" stroke=\"#0B62A8\"")
    } else {
        format!(
            "<circle cx=\"{}\" cy=\"{}\" r=\"2\" fill=\"#5A626B\">{said}</circle>\n",
            x + SIDE / 2,
            y + SIDE / 2
        )
    }
}
