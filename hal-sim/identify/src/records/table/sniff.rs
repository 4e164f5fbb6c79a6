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

/// Where the numbers of a text are, and how they are written.
struct Numbers {
    separator: u8,
    decimal: u8,
    /// The first line of numbers.
    start: usize,
    /// Rows of numbers, 0 where there are none.
    rows: usize,
    /// Cells of a row at most.
    width: usize,
}

impl Numbers {
    /// Finds the layout that reads the most numbers, from a line on.
    fn new(sample: &str, lines: &[&str], from: usize, known: &Layout) -> Self {
        let separators = known
            .separator
            .map_or_else(|| vec![b'\t', b';', b',', b'|', b' '], |one| vec![one]);
        let decimals = known
            .decimal
            .map_or_else(|| vec![b'.', b','], |one| vec![one]);
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
        Numbers {
            separator,
            decimal,
            start: from + start,
            rows,
            width: width.min(MOST_COLUMNS + 1),
        }
    }
}

/// The lines before the numbers.
struct Header<'a> {
    /// Cells of the line of names, where there is one.
    names: Option<Vec<&'a str>>,
    /// Cells of the line of units behind it, where there is one.
    units: Option<Vec<&'a str>>,
    /// Further lines, which are left out.
    others: usize,
}

impl<'a> Header<'a> {
    /// Reads the lines from one on up to the numbers.
    fn new(lines: &[&'a str], from: usize, numbers: &Numbers) -> Self {
        let filled = |at: &usize| !lines[*at].trim().is_empty();
        let before = from..numbers.start;
        let heads = before
            .clone()
            .rev()
            .filter(filled)
            .take(2)
            .map(|at| head(lines[at], numbers.separator))
            .filter(|cells| trimmed(cells).len() >= numbers.width);
        let mut heads = heads.collect::<Vec<_>>().into_iter();
        let count = heads.len();
        let (last, first) = (heads.next(), heads.next());
        let (names, units) = match (last, first) {
            (Some(last), Some(before)) if is_units(&last) => (Some(before), Some(last)),
            (last, _) => (last, None),
        };
        let named = count.min(1 + usize::from(units.is_some()));
        Header {
            others: before.filter(filled).count() - named,
            names,
            units,
        }
    }
}

/// Whether at least half of the cells that hold something are units.
fn is_units(cells: &[&str]) -> bool {
    let filled = cells.iter().filter(|cell| !cell.is_empty()).count();
    let units = cells
        .iter()
        .filter(|cell| units::of_text(cell).is_some_and(|(name, _)| name.is_empty()))
        .count();
    units > 0 && 2 * units >= filled
}

/// Looks at the first lines of a text.
pub(super) fn sniff(sample: &str, known: &Layout) -> Sniffed {
    let lines: Vec<&str> = sample.lines().collect();
    let from = known.skip.unwrap_or(0).min(lines.len());
    let numbers = Numbers::new(sample, &lines, from, known);
    let Numbers {
        separator,
        decimal,
        width,
        ..
    } = numbers;
    if numbers.rows == 0 {
        return Sniffed {
            separator,
            decimal,
            before: lines.len(),
            names: Vec::new(),
            units: Vec::new(),
            notes: Vec::new(),
        };
    }
    let header = Header::new(&lines, from, &numbers);
    let names: Vec<String> = (0..width)
        .map(|k| match &header.names {
            Some(names) => names.get(k).map_or_else(String::new, |n| (*n).to_owned()),
            None => k.to_string(),
        })
        .collect();
    let units = (0..width).map(|k| {
        let in_row = header.units.as_ref().and_then(|row| row.get(k)).copied();
        in_row
            .and_then(units::of_text)
            .or_else(|| units::of_text(&names[k]).filter(|(name, _)| !name.is_empty()))
            .map(|(_, unit)| unit.to_owned())
    });
    Sniffed {
        separator,
        decimal,
        before: numbers.start,
        units: units.collect(),
        notes: guessed(known, &numbers, &header, from),
        names,
    }
}

/// What was guessed, in words. The first `from` lines are left out.
fn guessed(known: &Layout, numbers: &Numbers, header: &Header, from: usize) -> Vec<String> {
    let mut notes = Vec::new();
    if header.names.is_none() {
        notes.push("it has no header: its columns are named by their numbers, from 0".into());
    }
    if known.separator.is_none() && numbers.width > 1 && numbers.separator != b',' {
        notes.push(format!(
            "its cells are taken to be separated by {}",
            spelled(numbers.separator)
        ));
    }
    if known.decimal.is_none() && numbers.decimal == b',' {
        notes.push("its numbers are taken to have a decimal comma".into());
    }
    if header.others + from > 0 {
        notes.push(format!(
            "{} lines before its header are left out",
            header.others + from
        ));
    }
    if header.units.is_some() {
        notes.push("it has a row of units".into());
    }
    notes
}

/// The cells of a header; a comment sign before it is none of them.
fn head(line: &str, separator: u8) -> Vec<&str> {
    let line = line.trim_start_matches('\u{feff}').trim_start();
    let line = line.strip_prefix(['#', '%']).unwrap_or(line);
    cells(line, separator)
}
