//! What a text's layout is: separator, decimal sign, lines before the data, names and units.

use super::MOST_COLUMNS;
use crate::records::units;

/// What is known of a text before it is read; what is `None` is guessed.
#[derive(Debug, Clone, Copy, Default)]
pub struct Layout {
    /// Between the cells.
    pub separator: Option<u8>,
    /// Between whole and fraction.
    pub decimal: Option<u8>,
    /// Lines before the names.
    pub skip: Option<usize>,
}

/// What a text's layout is.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sniffed {
    pub(super) separator: u8,
    pub(super) decimal: u8,
    /// Lines before the first row of numbers.
    pub(super) before: usize,
    /// Names of the columns; of a text without a header their numbers.
    pub(super) names: Vec<String>,
    /// Units, where the text has a row of them or they stand with the names.
    pub(super) units: Vec<Option<String>>,
    /// What was guessed, in words.
    pub(super) notes: Vec<String>,
}

/// Cells of a line. Spaces count as one separator however many they are.
pub(super) fn cells(line: &str, separator: u8) -> Vec<&str> {
    if separator == b' ' {
        return line.split_ascii_whitespace().collect();
    }
    let mut cells = Vec::new();
    let (mut from, mut quoted) = (0, false);
    for (at, byte) in line.bytes().enumerate() {
        if byte == b'"' {
            quoted = !quoted;
        } else if byte == separator && !quoted {
            cells.push(bare(&line[from..at]));
            from = at + 1;
        }
    }
    cells.push(bare(&line[from..]));
    cells
}

fn bare(cell: &str) -> &str {
    cell.trim().trim_matches('"').trim()
}

/// The number in a cell.
pub(super) fn number(cell: &str, decimal: u8) -> Option<f64> {
    if decimal == b',' && cell.contains(',') {
        if cell.contains('.') {
            return None;
        }
        return cell.replacen(',', ".", 1).parse().ok();
    }
    cell.parse().ok()
}

/// Whether a line is a row of numbers: it has one, and nothing but numbers and empty cells (and, in a long row, a word
/// or two, such as a mode's name).
fn numeric(cells: &[&str], decimal: u8) -> bool {
    let filled = cells.iter().filter(|cell| !cell.is_empty()).count();
    let numbers = cells
        .iter()
        .filter(|cell| number(cell, decimal).is_some())
        .count();
    numbers > 0 && (numbers == filled || numbers >= 3 && 4 * numbers >= 3 * filled)
}

/// Without the empty cells at its end.
fn trimmed<'a>(cells: &[&'a str]) -> Vec<&'a str> {
    let end = cells
        .iter()
        .rposition(|cell| !cell.is_empty())
        .map_or(0, |last| last + 1);
    cells[..end].to_vec()
}

/// The longest run of rows of numbers in a sample: where it starts, how long it is, cells of its rows.
fn run(lines: &[&str], separator: u8, decimal: u8) -> (usize, usize, usize) {
    let mut best = (0, 0, 0);
    let mut now = (0, 0, 0);
    for (at, line) in lines.iter().enumerate() {
        let cells = cells(line, separator);
        if numeric(&cells, decimal) {
            let width = trimmed(&cells).len();
            now = match now {
                (_, 0, _) => (at, 1, width),
                (from, count, widest) => (from, count + 1, widest.max(width)),
            };
            if now.1 > best.1 {
                best = now;
            }
        } else if !line.trim().is_empty() {
            now = (0, 0, 0);
        }
    }
    best
}

fn spelled(separator: u8) -> &'static str {
    match separator {
        b'\t' => "a tab",
        b' ' => "spaces",
        b';' => "`;`",
        b'|' => "`|`",
        b',' => "`,`",
        _ => "the given one",
    }
}

/// Looks at the first lines of a text.
pub(super) fn sniff(sample: &str, known: &Layout) -> Sniffed {
    let lines: Vec<&str> = sample.lines().collect();
    let separators = known
        .separator
        .map_or_else(|| vec![b'\t', b';', b',', b'|', b' '], |one| vec![one]);
    let decimals = known
        .decimal
        .map_or_else(|| vec![b'.', b','], |one| vec![one]);
    let from = known.skip.unwrap_or(0).min(lines.len());
    let mut best = (0, b',', b'.', (0, 0, 0));
    for &separator in &separators {
        for &decimal in &decimals {
            // One sign for both only where quotes tell them apart.
            if separator == decimal && !sample.contains('"') {
                continue;
            }
            let found = run(&lines[from..], separator, decimal);
            // Numbers that a layout reads; the first of equals is the likelier one.
            let score = found.1 * found.2;
            if score > best.0 {
                best = (score, separator, decimal, found);
            }
        }
    }
    let (_, separator, decimal, (start, rows, width)) = best;
    let start = from + start;
    let mut notes = Vec::new();
    if rows == 0 {
        return Sniffed {
            separator,
            decimal,
            before: lines.len(),
            names: Vec::new(),
            units: Vec::new(),
            notes,
        };
    }
    let width = width.min(MOST_COLUMNS + 1);
    let heads: Vec<(usize, Vec<&str>)> = (from..start)
        .rev()
        .filter(|at| !lines[*at].trim().is_empty())
        .take(2)
        .map(|at| (at, head(lines[at], separator)))
        .filter(|(_, cells)| trimmed(cells).len() >= width)
        .collect();
    let is_units = |cells: &[&str]| {
        let filled = cells.iter().filter(|cell| !cell.is_empty()).count();
        let units = cells
            .iter()
            .filter(|cell| units::of_text(cell).is_some_and(|(name, _)| name.is_empty()))
            .count();
        units > 0 && 2 * units >= filled
    };
    let (names, unit_row) = match &heads[..] {
        [(_, last), (_, before), ..] if is_units(last) => (Some(before), Some(last)),
        [(_, last), ..] => (Some(last), None),
        [] => (None, None),
    };
    let mut found_units: Vec<Option<String>> = vec![None; width];
    let names: Vec<String> = match names {
        Some(names) => (0..width)
            .map(|k| names.get(k).map_or_else(String::new, |n| (*n).to_owned()))
            .collect(),
        None => {
            notes.push("it has no header: its columns are named by their numbers, from 0".into());
            (0..width).map(|k| k.to_string()).collect()
        }
    };
    for (k, unit) in found_units.iter_mut().enumerate() {
        let in_row = unit_row.and_then(|row| row.get(k)).copied();
        *unit = in_row
            .and_then(units::of_text)
            .or_else(|| units::of_text(&names[k]).filter(|(name, _)| !name.is_empty()))
            .map(|(_, unit)| unit.to_owned());
    }
    if known.separator.is_none() && width > 1 && separator != b',' {
        notes.push(format!(
            "its cells are taken to be separated by {}",
            spelled(separator)
        ));
    }
    if known.decimal.is_none() && decimal == b',' {
        notes.push("its numbers are taken to have a decimal comma".into());
    }
    let named = heads.len().min(1 + usize::from(unit_row.is_some()));
    let others = (from..start)
        .filter(|at| !lines[*at].trim().is_empty())
        .count()
        - named;
    if others + from > 0 {
        notes.push(format!(
            "{} lines before its header are left out",
            others + from
        ));
    }
    if unit_row.is_some() {
        notes.push("it has a row of units".into());
    }
    Sniffed {
        separator,
        decimal,
        before: start,
        names,
        units: found_units,
        notes,
    }
}

/// The cells of a header; a comment sign before it is none of them.
fn head(line: &str, separator: u8) -> Vec<&str> {
    let line = line.trim_start_matches('\u{feff}').trim_start();
    let line = line.strip_prefix(['#', '%']).unwrap_or(line);
    cells(line, separator)
}
