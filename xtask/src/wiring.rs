//! `cargo xtask wiring`: the drawing of the default board's wiring, from the table on its page.

use anyhow::{Context, Result, ensure};
use page::drawing::{Anchor, Form, NO_STROKE, Point, Shape};
use std::fs;
use std::path::{Path, PathBuf};

/// The page and its drawing.
const FOLDER: &str = "firmware/boards";
const NAME: &str = "nucleo_g474re";

/// A row of the page's table of pins.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// The chip's pin, such as `PA8`.
    pub pin: String,
    /// Its place on the morpho connectors, such as `CN10-23`.
    pub header: String,
    /// Its name on the Arduino connectors, or nothing.
    pub arduino: String,
    /// What it is in the chip: one or more of its functions.
    pub functions: Vec<String>,
    /// What it goes to.
    pub at: String,
    /// The line there.
    pub line: String,
}

fn file(root: &Path, extension: &str) -> PathBuf {
    root.join(FOLDER).join(format!("{NAME}.{extension}"))
}

/// The table of pins of the default board's page, in the workspace at `root`.
///
/// # Errors
/// The page is missing, has no such table, or a row with too few cells.
pub fn rows(root: &Path) -> Result<Vec<Row>> {
    const HEAD: [&str; 6] = ["pin", "header", "Arduino", "chip", "at", "line"];
    let path = file(root, "md");
    let page = fs::read_to_string(&path)
        .with_context(|| format!("cannot read the wiring page {}", path.display()))?;
    let cells = |line: &str| -> Vec<String> {
        let inner = line.trim().trim_start_matches('|').trim_end_matches('|');
        inner
            .split('|')
            .map(|cell| cell.trim().to_owned())
            .collect()
    };
    let mut lines = page.lines().skip_while(|line| cells(line) != HEAD);
    ensure!(
        lines.next().is_some() && lines.next().is_some(),
        "{}: no table with the columns {}",
        path.display(),
        HEAD.join(", ")
    );
    lines
        .take_while(|line| line.starts_with('|'))
        .map(|line| {
            ensure!(!line.contains(['<', '&']), "`{line}`: not in a drawing");
            let found = cells(line);
            let [pin, header, arduino, chip, at, row] =
                <[String; 6]>::try_from(found).map_err(|found| {
                    anyhow::anyhow!("`{line}` has {} cells instead of 6", found.len())
                })?;
            Ok(Row {
                pin,
                header,
                arduino,
                functions: chip.split(',').map(|name| name.trim().to_owned()).collect(),
                at,
                line: row,
            })
        })
        .collect()
}

/// The committed drawing.
///
/// # Errors
/// It is missing.
pub fn committed(root: &Path) -> Result<String> {
    let path = file(root, "svg");
    fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))
}

/// Draws the table again, beside the page.
///
/// # Errors
/// As [`rows`], or the drawing cannot be written.
pub fn draw(root: &Path) -> Result<PathBuf> {
    let path = file(root, "svg");
    fs::write(&path, drawing(&rows(root)?))
        .with_context(|| format!("cannot write {}", path.display()))?;
    Ok(path)
}

/// Distances, px.
const ROW: f64 = 19.0;
const GAP: f64 = 36.0;
const TOP: f64 = 138.0;
const BOX: f64 = 150.0;
/// Left edges of the three columns of boxes.
const LEFT: f64 = 20.0;
const CHIP: f64 = 400.0;
const RIGHT: f64 = 780.0;
const CHIP_WIDTH: f64 = 150.0;
const WIDTH: f64 = RIGHT + BOX + 20.0;

const INK: &str = "#1b1f24";
const POWER: &str = "#c2410c";

/// The colour of a line by what it carries.
fn color(row: &Row) -> &'static str {
    let is = |start: &str| row.functions.iter().any(|name| name.starts_with(start));
    if is("ADC") {
        "#9b1b6b"
    } else if is("GPIO") || is("TIM1_BKIN") || is("TIM8_BKIN") {
        POWER
    } else if is("TIM1_") || is("TIM8_") {
        "#0b62a8"
    } else {
        "#2f6f4f"
    }
}

/// The wiring: the Nucleo in the middle, what belongs to the screw on the left, to the nut on the right.
#[must_use]
pub fn drawing(rows: &[Row]) -> String {
    let (left, right): (Vec<_>, Vec<_>) = rows.iter().partition(|row| !row.at.starts_with("nut"));
    let mut shapes = Vec::new();
    let mut bottom = TOP;
    for (rows, on_left) in [(left, true), (right, false)] {
        bottom = bottom.max(column(&mut shapes, &rows, on_left));
    }
    boxed(
        &mut shapes,
        (CHIP, TOP - 30.0),
        (CHIP_WIDTH, bottom - TOP + 30.0),
        "NUCLEO-G474RE",
    );
    supply(&mut shapes);
    let size = (WIDTH, bottom + 24.0);
    let paper = Shape::rectangle((0.0, 0.0), size, "#ffffff", NO_STROKE);
    shapes.insert(0, paper);
    page::drawing::drawing("Wiring of the default board", size, 11.0, &shapes).to_string()
}

/// Draws the boxes of one side and their lines to the Nucleo; returns where they end.
fn column(shapes: &mut Vec<Shape>, rows: &[&Row], on_left: bool) -> f64 {
    let mut y = TOP;
    for these in rows.chunk_by(|a, b| a.at == b.at) {
        let edge = if on_left { LEFT } else { RIGHT };
        let height = these.len() as f64 * ROW + 24.0;
        boxed(shapes, (edge, y - 30.0), (BOX, height), &these[0].at);
        for row in these {
            wire(shapes, row, y, on_left);
            y += ROW;
        }
        y += GAP;
    }
    y - GAP
}

/// A line from a pin to what it goes to.
fn wire(shapes: &mut Vec<Shape>, row: &Row, y: f64, on_left: bool) {
    let (from, to, near, far) = if on_left {
        (LEFT + BOX, CHIP, CHIP - 6.0, LEFT + BOX - 8.0)
    } else {
        (
            CHIP + CHIP_WIDTH,
            RIGHT,
            CHIP + CHIP_WIDTH + 6.0,
            RIGHT + 8.0,
        )
    };
    let outside = if on_left { Anchor::End } else { Anchor::Start };
    let (inside, inside_anchor) = if on_left {
        (CHIP + 8.0, Anchor::Start)
    } else {
        (CHIP + CHIP_WIDTH - 8.0, Anchor::End)
    };
    let stroke = color(row);
    let place = if row.arduino.is_empty() {
        row.header.clone()
    } else {
        format!("{} ({})", row.header, row.arduino)
    };
    let function = format!("{} · {place}", row.functions[0]);
    shapes.extend([
        Shape::line((stroke, 1.4), [(from, y), (to, y)]),
        Shape::text((near, y - 4.0), outside, stroke, function),
        Shape::text((inside, y + 4.0), inside_anchor, INK, &row.pin),
        Shape::text((far, y + 4.0), outside, INK, &row.line),
    ]);
}

/// Supply, fuse, capacitors, and the stop in the enables.
fn supply(shapes: &mut Vec<Shape>) {
    let y = 40.0;
    let middle = CHIP + CHIP_WIDTH / 2.0;
    let (screw, nut) = (LEFT + BOX / 2.0, RIGHT + BOX / 2.0);
    boxed(
        shapes,
        (middle - 95.0, y - 26.0),
        (190.0, 34.0),
        "24 to 48 V, current limit",
    );
    let words = |x, y, fill, words: &str| Shape::text((x, y), Anchor::Middle, fill, words);
    for (end, start) in [(screw, middle - 95.0), (nut, middle + 95.0)] {
        let center = f64::midpoint(start, end);
        let points = [(start, y), (end, y), (end, TOP - 30.0)];
        shapes.extend([
            Shape::line((POWER, 2.4), points),
            words(center, y - 6.0, POWER, "fuse 10 A"),
            words(center, y + 15.0, POWER, "1000 uF 63 V at the stage"),
        ]);
    }
    shapes.push(words(
        middle,
        y + 36.0,
        INK,
        "emergency stop: normally closed, one pole in each ENABLE wire, 10 kohm to ground behind it",
    ));
    shapes.push(words(
        middle,
        y + 52.0,
        INK,
        "encoders and scale: RS-422 through AM26LV32E receivers at 3.3 V; all grounds meet at the stages' supply terminals",
    ));
}

fn boxed(shapes: &mut Vec<Shape>, at: Point, size: Point, name: &str) {
    let middle = (at.0 + size.0 / 2.0, at.1 + 14.0);
    let radius = 4.0;
    shapes.push(Shape {
        form: Form::Box { at, size, radius },
        ..Shape::rectangle(at, size, "none", (INK, 1.0))
    });
    shapes.push(Shape::text(middle, Anchor::Middle, INK, name).bold());
}
