//! The table as a picture: a line for each point, a mark for each controller, on a logarithmic scale.

use super::{called, mode};
use crate::smooth::Rival;
use crate::smooth::bench::{Controller, Row, Scale};
use page::document::{document, escape, standalone};
use std::fmt::Write;

/// Height of a line, px, width of its name and of the scale, and what is above.
const LINE: f64 = 26.0;
const NAMES: f64 = 250.0;
const WIDTH: f64 = 560.0;
const HEAD: f64 = 24.0;
/// Ends of the scale, %.
const LEAST: f64 = 0.05;
const MOST: f64 = 500.0;

/// How a controller is marked: its letter, and its colour.
fn mark(controller: Controller) -> (&'static str, &'static str) {
    match controller {
        Controller::Rival(Rival::Pi) => ("P", "#5A626B"),
        Controller::Rival(Rival::StaticMap) => ("S", "#8C6D1F"),
        Controller::Rival(Rival::Pir) => ("R", "#7A4B94"),
        Controller::Rival(Rival::Ilc) => ("I", "#2F6B4F"),
        Controller::Rival(Rival::Repetitive) => ("C", "#A0522D"),
        Controller::Ours(Scale::There) => ("O", "#00539C"),
        Controller::Ours(Scale::TakenAway) => ("o", "#00539C"),
        Controller::Ours(Scale::Never) => ("x", "#00539C"),
    }
}

/// Points in their order, each with its rows.
fn points(rows: &[Row]) -> Vec<(String, Vec<&Row>)> {
    let mut points: Vec<(String, Vec<&Row>)> = Vec::new();
    for row in rows {
        let case = &row.case;
        let name = format!(
            "{}, {}, {} mm/s",
            case.machine.name(),
            mode(case.nut_rpm),
            case.table_mm_s
        );
        match points.iter_mut().find(|(known, _)| *known == name) {
            Some((_, rows)) => rows.push(row),
            None => points.push((name, vec![row])),
        }
    }
    points
}

fn place(vrf: f64) -> f64 {
    let part = (vrf / LEAST).ln() / (MOST / LEAST).ln();
    NAMES + WIDTH * part.clamp(0.0, 1.0)
}

/// The plot.
fn plot(rows: &[Row]) -> String {
    let points = points(rows);
    let (width, height) = (NAMES + WIDTH + 20.0, HEAD + LINE * points.len() as f64);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" role=\"img\" font-size=\"12\"><title>Ripple of the table by controller</title>\n"
    );
    for tick in [0.1, 1.0, 10.0, 100.0] {
        let x = place(tick);
        let _ = writeln!(
            svg,
            "<line x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{HEAD}\" y2=\"{height}\" stroke=\"#5A626B\" stroke-opacity=\"0.35\"/>\
             <text x=\"{x:.1}\" y=\"14\" text-anchor=\"middle\" fill=\"#5A626B\">{tick} %</text>"
        );
    }
    for (k, (name, rows)) in points.iter().enumerate() {
        let y = HEAD + LINE * (k as f64 + 0.5);
        let _ = writeln!(
            svg,
            "<text x=\"0\" y=\"{:.1}\" fill=\"#5A626B\">{}</text>",
            y + 4.0,
            escape(name)
        );
        for row in rows {
            let (letter, colour) = mark(row.case.controller);
            let told = called(&row.case);
            // What failed stands at the right end.
            let (x, told) = match &row.left {
                Ok(left) => (
                    place(left.median.vrf),
                    format!(
                        "{told}: {:.2} %, worst {:.2} %",
                        left.median.vrf, left.worst
                    ),
                ),
                Err(_) => (NAMES + WIDTH + 12.0, format!("{told}: ended in a fault")),
            };
            let _ = writeln!(
                svg,
                "<g><title>{}</title><text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-weight=\"bold\" \
                 fill=\"{colour}\">{letter}</text></g>",
                escape(&told),
                y + 4.0
            );
        }
    }
    svg + "</svg>\n"
}

/// The plot as a file of its own.
pub(super) fn picture(rows: &[Row]) -> String {
    standalone(&plot(rows))
}

/// The page.
pub(super) fn page(rows: &[Row], seeds: u64) -> String {
    let svg = plot(rows);
    let body = format!(
        "<p>Velocity ripple factor of the true table velocity (Eq 19), median of {seeds} seeds. P: the paper's PI. S: static map. \
         R: proportional-integral-resonant. I: iterative learning. C: repetitive control. <b>O</b>: ours with a scale, o: its scale \
         taken away, x: never a scale. At the right end: ended in a fault. Point at a mark to read it.</p>\n<figure>{svg}</figure>\n"
    );
    document("How smooth the table moves", &body)
}
