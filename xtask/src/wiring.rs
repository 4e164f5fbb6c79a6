//! `cargo xtask wiring`: the drawing of the default board's wiring, from the table on its page.

use anyhow::{Context, Result, ensure};
use std::fmt::Write as _;
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

/// Draws the table anew, beside the page.
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
const ROW: usize = 19;
const GAP: usize = 36;
const TOP: usize = 138;
const BOX: usize = 150;
/// Left edges of the three columns of boxes.
const LEFT: usize = 20;
const CHIP: usize = 400;
const RIGHT: usize = 780;
const CHIP_WIDTH: usize = 150;
const WIDTH: usize = RIGHT + BOX + 20;

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
    let mut body = String::new();
    let mut bottom = TOP;
    for (rows, on_left) in [(left, true), (right, false)] {
        bottom = bottom.max(column(&mut body, &rows, on_left));
    }
    boxed(
        &mut body,
        (CHIP, TOP - 30),
        (CHIP_WIDTH, bottom - TOP + 30),
        "NUCLEO-G474RE",
    );
    supply(&mut body);
    let height = bottom + 24;
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" \
         font-family=\"sans-serif\" font-size=\"11\" role=\"img\">\n\
         <title>Wiring of the default board</title>\n\
         <rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#ffffff\"/>\n{body}</svg>\n"
    )
}

/// Draws the boxes of one side and their lines to the Nucleo; returns where they end.
fn column(body: &mut String, rows: &[&Row], on_left: bool) -> usize {
    let mut y = TOP;
    let mut rest = rows;
    while let Some(first) = rest.first() {
        let of_one = rest.iter().take_while(|row| row.at == first.at).count();
        let (these, others) = rest.split_at(of_one);
        rest = others;
        let edge = if on_left { LEFT } else { RIGHT };
        boxed(body, (edge, y - 30), (BOX, of_one * ROW + 24), &first.at);
        for row in these {
            wire(body, row, y, on_left);
            y += ROW;
        }
        y += GAP;
    }
    y - GAP
}

/// A line from a pin to what it goes to.
fn wire(body: &mut String, row: &Row, y: usize, on_left: bool) {
    let (from, to, near, far) = if on_left {
        (LEFT + BOX, CHIP, CHIP - 6, LEFT + BOX - 8)
    } else {
        (CHIP + CHIP_WIDTH, RIGHT, CHIP + CHIP_WIDTH + 6, RIGHT + 8)
    };
    let (near_anchor, far_anchor) = if on_left {
        ("end", "end")
    } else {
        ("start", "start")
    };
    let (inside, inside_anchor) = if on_left {
        (CHIP + 8, "start")
    } else {
        (CHIP + CHIP_WIDTH - 8, "end")
    };
    let stroke = color(row);
    let place = if row.arduino.is_empty() {
        row.header.clone()
    } else {
        format!("{} ({})", row.header, row.arduino)
    };
    let _ = writeln!(
        body,
        "<path d=\"M{from} {y}H{to}\" stroke=\"{stroke}\" stroke-width=\"1.4\"/>"
    );
    text(
        body,
        (near, y - 4),
        near_anchor,
        stroke,
        &format!("{} · {}", row.functions[0], place),
    );
    text(body, (inside, y + 4), inside_anchor, INK, &row.pin);
    text(body, (far, y + 4), far_anchor, INK, &row.line);
}

/// Supply, fuse, capacitors, and the stop in the enables.
fn supply(body: &mut String) {
    let y = 40;
    let middle = CHIP + CHIP_WIDTH / 2;
    let (screw, nut) = (LEFT + BOX / 2, RIGHT + BOX / 2);
    boxed(
        body,
        (middle - 95, y - 26),
        (190, 34),
        "24 to 48 V, current limit",
    );
    for (end, start) in [(screw, middle - 95), (nut, middle + 95)] {
        let _ = writeln!(
            body,
            "<path d=\"M{start} {y}H{end}V{}\" fill=\"none\" stroke=\"{POWER}\" stroke-width=\"2.4\"/>",
            TOP - 30
        );
        text(
            body,
            ((start + end) / 2, y - 6),
            "middle",
            POWER,
            "fuse 10 A",
        );
        text(
            body,
            ((start + end) / 2, y + 15),
            "middle",
            POWER,
            "1000 uF 63 V at the stage",
        );
    }
    text(
        body,
        (middle, y + 36),
        "middle",
        INK,
        "emergency stop: normally closed, one pole in each ENABLE wire, 10 kohm to ground behind it",
    );
    text(
        body,
        (middle, y + 52),
        "middle",
        INK,
        "encoders and scale: RS-422 through AM26LV32E receivers at 3.3 V; all grounds meet at the stages' supply terminals",
    );
}

fn boxed(body: &mut String, (x, y): (usize, usize), (width, height): (usize, usize), name: &str) {
    let _ = writeln!(
        body,
        "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" rx=\"4\" fill=\"none\" stroke=\"{INK}\"/>"
    );
    let _ = writeln!(
        body,
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\" font-weight=\"bold\" fill=\"{INK}\">{}</text>",
        x + width / 2,
        y + 14,
        name
    );
}

fn text(body: &mut String, (x, y): (usize, usize), anchor: &str, fill: &str, words: &str) {
    let _ = writeln!(
        body,
        "<text x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\" fill=\"{fill}\">{words}</text>"
    );
}
