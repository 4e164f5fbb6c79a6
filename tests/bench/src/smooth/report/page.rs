//! The table as a picture: a line for each point, a mark for each controller, on a logarithmic scale.

use super::{called, mode};
use crate::smooth::Rival;
use crate::smooth::bench::{Controller, Row, Scale};
use askama::Template;
use page::document::{document, standalone};
use page::drawing::{Anchor, Shape, drawing};
use page::markup::Markup;

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
fn plot(rows: &[Row]) -> Markup {
    const MUTED: &str = "#5A626B";
    let points = points(rows);
    let (width, height) = (NAMES + WIDTH + 20.0, HEAD + LINE * points.len() as f64);
    let mut shapes = Vec::new();
    for tick in [0.1, 1.0, 10.0, 100.0] {
        let x = place(tick);
        shapes.push(Shape::line(("#DCDFE3", 1.0), [(x, HEAD), (x, height)]));
        let words = format!("{tick} %");
        shapes.push(Shape::text((x, 14.0), Anchor::Middle, MUTED, words));
    }
    for (k, (name, rows)) in points.iter().enumerate() {
        let y = HEAD + LINE * (k as f64 + 0.5) + 4.0;
        shapes.push(Shape::text((0.0, y), Anchor::Start, MUTED, name));
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
            let letter = Shape::text((x, y), Anchor::Middle, colour, letter);
            shapes.push(letter.bold().told(told));
        }
    }
    let about = "Ripple of the table by controller";
    drawing(about, (width, height), 12.0, &shapes)
}

/// The plot as a file of its own.
pub(super) fn picture(rows: &[Row]) -> String {
    standalone(&plot(rows))
}

/// The page.
pub(super) fn page(rows: &[Row], seeds: u64) -> String {
    let plot = plot(rows);
    document("How smooth the table moves", &Body { seeds, plot })
}

#[derive(Template)]
#[template(path = "smooth.html")]
struct Body {
    seeds: u64,
    plot: Markup,
}
