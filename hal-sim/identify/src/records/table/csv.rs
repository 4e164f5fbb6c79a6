//! Text, row by row.

use super::sniff::{Layout, Sniffed, number, sniff};
use super::{Column, LoadError, MOST_COLUMNS, Table, damaged};
use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};
use std::io::{Cursor, Read};

/// Bytes that are looked at to tell the layout.
const SAMPLE: usize = 1 << 16;

pub(super) fn read(mut input: impl Read, origin: &str, known: &Layout) -> Result<Table, LoadError> {
    let fault = |row: usize, error: String| {
        let reason = format!("after row {row}: {error}; the file may be cut off or damaged");
        damaged(origin, "CSV", reason)
    };
    let mut start = Vec::with_capacity(SAMPLE);
    (&mut input)
        .take(SAMPLE as u64)
        .read_to_end(&mut start)
        .map_err(|error| fault(0, error.to_string()))?;
    let encoding = encoding(&start);
    if encoding == UTF_16LE || encoding == UTF_16BE {
        input
            .read_to_end(&mut start)
            .map_err(|error| fault(0, error.to_string()))?;
        let text = encoding.decode(&start).0.into_owned();
        drop(start);
        let mut sample = text.len().min(SAMPLE);
        while !text.is_char_boundary(sample) {
            sample -= 1;
        }
        let sniffed = sniff(&text[..sample], known);
        let mut table = rows(Cursor::new(text.as_bytes()), &sniffed, encoding, &fault)?;
        table.notes.insert(0, "its text is UTF-16".into());
        return Ok(table);
    }
    let sniffed = sniff(&whole_lines(&start, encoding), known);
    rows(Cursor::new(start).chain(input), &sniffed, encoding, &fault)
}

/// By a byte order mark, by the zeros of UTF-16, else UTF-8 or, where it is none, Windows' western code page.
fn encoding(start: &[u8]) -> &'static Encoding {
    if let Some((encoding, _)) = Encoding::for_bom(start) {
        return encoding;
    }
    let zeros = |from: usize| {
        start
            .iter()
            .skip(from)
            .step_by(2)
            .filter(|b| **b == 0)
            .count()
            > start.len() / 4
    };
    let cut = start.len().saturating_sub(4);
    if start.len() >= 4 && zeros(1) && !zeros(0) {
        UTF_16LE
    } else if start.len() >= 4 && zeros(0) && !zeros(1) {
        UTF_16BE
    } else if std::str::from_utf8(start).is_ok() || std::str::from_utf8(&start[..cut]).is_ok() {
        UTF_8
    } else {
        match std::str::from_utf8(start) {
            // A character may be cut by the sample's end.
            Err(error) if error.valid_up_to() >= cut => UTF_8,
            _ => WINDOWS_1252,
        }
    }
}

/// The sample's text up to its last whole line.
fn whole_lines(start: &[u8], encoding: &'static Encoding) -> String {
    let end = match start.len() < SAMPLE {
        true => start.len(),
        false => start
            .iter()
            .rposition(|byte| *byte == b'\n' || *byte == b'\r')
            .unwrap_or(start.len()),
    };
    encoding.decode(&start[..end]).0.into_owned()
}

fn rows(
    input: impl Read,
    sniffed: &Sniffed,
    encoding: &'static Encoding,
    fault: &impl Fn(usize, String) -> LoadError,
) -> Result<Table, LoadError> {
    let width = sniffed.names.len();
    if width > MOST_COLUMNS {
        return Err(fault(0, format!("it has more than {MOST_COLUMNS} columns")));
    }
    if width == 0 {
        return Err(fault(0, "no row of numbers is in its first 64 kB".into()));
    }
    let spaces = sniffed.separator == b' ';
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .delimiter(sniffed.separator)
        .has_headers(false)
        // A row cut short is a fault of that row, which the rules for faults know.
        .flexible(true)
        .quoting(!spaces)
        .buffer_capacity(1 << 16)
        .from_reader(SkipLines::new(input, sniffed.before));
    let mut columns = vec![Vec::new(); width];
    let mut table = Table {
        notes: sniffed.notes.clone(),
        ..Table::default()
    };
    let mut record = csv::ByteRecord::new();
    let mut row = 0;
    while reader
        .read_byte_record(&mut record)
        .map_err(|e| fault(row, e.to_string()))?
    {
        row += 1;
        let more = push_row(&mut columns, &record, sniffed.decimal, spaces);
        if more > 0 {
            let text = format!("{} cells instead of {width}", width + more);
            void(&mut table, &mut columns, row, &text);
            continue;
        }
        if columns
            .iter()
            .any(|values: &Vec<f64>| values.last().is_some_and(|value| !value.is_finite()))
        {
            list_words(&mut table, &record, row, &columns, spaces);
        }
    }
    table.columns = columns
        .into_iter()
        .zip(&sniffed.names)
        .zip(&sniffed.units)
        .map(|((values, name), unit)| Column {
            path: name.clone(),
            unit: unit.clone(),
            values,
        })
        .collect();
    if encoding == WINDOWS_1252 {
        table
            .notes
            .insert(0, "its text is taken to be Windows-1252".into());
    }
    Ok(table)
}

/// Adds a row of cells to the columns, and counts the further cells that are not empty.
fn push_row(
    columns: &mut [Vec<f64>],
    record: &csv::ByteRecord,
    decimal: u8,
    spaces: bool,
) -> usize {
    let mut cells = record.iter();
    let mut next = || match spaces {
        true => cells.find(|cell| !cell.is_empty()),
        false => cells.next(),
    };
    let missing: &[u8] = b"";
    for values in columns.iter_mut() {
        let cell = next().unwrap_or(missing);
        values.push(parse(cell, decimal).unwrap_or(f64::NAN));
    }
    let mut more = 0;
    while let Some(cell) = next() {
        more += usize::from(!cell.is_empty());
    }
    more
}

/// Makes the last row a fault in every column, with the reason in its place.
fn void(table: &mut Table, columns: &mut [Vec<f64>], row: usize, reason: &str) {
    for (column, values) in columns.iter_mut().enumerate() {
        table.push_word(row, column, reason.as_bytes());
        if let Some(last) = values.last_mut() {
            *last = f64::NAN;
        }
    }
}

/// Lists the cells of a row that are no finite numbers.
fn list_words(
    table: &mut Table,
    record: &csv::ByteRecord,
    row: usize,
    columns: &[Vec<f64>],
    spaces: bool,
) {
    let mut cells = record.iter().filter(|cell| !spaces || !cell.is_empty());
    for (column, values) in columns.iter().enumerate() {
        let cell = cells.next().unwrap_or_default();
        if values.last().is_some_and(|value| !value.is_finite()) {
            table.push_word(row, column, cell);
        }
    }
}

/// The number in a cell.
fn parse(cell: &[u8], decimal: u8) -> Option<f64> {
    number(std::str::from_utf8(cell).ok()?, decimal)
}

/// Leaves lines out that come before the data, whatever quotes they have.
struct SkipLines<R> {
    input: R,
    lines: usize,
    /// What of a buffer is behind the last line that is left out.
    rest: Vec<u8>,
}

impl<R: Read> SkipLines<R> {
    fn new(input: R, lines: usize) -> Self {
        SkipLines {
            input,
            lines,
            rest: Vec::new(),
        }
    }
}

impl<R: Read> Read for SkipLines<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        while self.lines > 0 {
            let mut piece = [0; 4096];
            let count = self.input.read(&mut piece)?;
            if count == 0 {
                return Ok(0);
            }
            for (at, &byte) in piece[..count].iter().enumerate() {
                // As `str::lines` has them: a line ends with a line feed.
                if byte == b'\n' {
                    self.lines -= 1;
                    if self.lines == 0 {
                        self.rest = piece[at + 1..count].to_vec();
                        break;
                    }
                }
            }
        }
        if self.rest.is_empty() {
            return self.input.read(buffer);
        }
        let count = self.rest.len().min(buffer.len());
        buffer[..count].copy_from_slice(&self.rest[..count]);
        self.rest.drain(..count);
        Ok(count)
    }
}
