//! A recording, row by row.

use super::columns::from_row;
use super::{COLUMNS, RecordingError, Sample};
use csv::ByteRecord;
use flate2::read::MultiGzDecoder;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Reads a recording row by row, in memory for one row. Columns may stand in any order.
///
/// An iterator of samples; the first error ends it.
pub struct RecordingReader {
    rows: csv::Reader<Box<dyn Read>>,
    /// Where in a row of the file each of [`COLUMNS`] stands.
    order: [usize; 16],
    origin: String,
    record: ByteRecord,
    row: u64,
    failed: bool,
}

impl RecordingReader {
    /// Opens a `.csv` or `.csv.gz`; its first bytes show which one, not by its name.
    ///
    /// # Errors
    /// A file that cannot be opened or decompressed, a column missing, unknown or twice.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let open = |source| RecordingError::Open {
            path: path.to_owned(),
            source,
        };
        let mut file = BufReader::with_capacity(1 << 16, File::open(path).map_err(open)?);
        let zipped = file.fill_buf().map_err(open)?.starts_with(&[0x1f, 0x8b]);
        let input: Box<dyn Read> = if zipped {
            Box::new(MultiGzDecoder::new(file))
        } else {
            Box::new(file)
        };
        Self::new(input, &path.display().to_string())
    }

    /// Reads from `input`, uncompressed; `origin` names it in errors.
    ///
    /// # Errors
    /// As [`RecordingReader::open`].
    pub fn new(input: Box<dyn Read>, origin: &str) -> Result<Self, RecordingError> {
        let mut rows = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .buffer_capacity(1 << 16)
            .from_reader(input);
        let damaged = |error: csv::Error| RecordingError::Damaged {
            origin: origin.to_owned(),
            row: 0,
            reason: error.to_string(),
        };
        let header = rows.byte_headers().map_err(damaged)?;
        let order = order(header).map_err(|(column, fault)| RecordingError::Column {
            origin: origin.to_owned(),
            column,
            fault,
        })?;
        Ok(RecordingReader {
            rows,
            order,
            origin: origin.to_owned(),
            record: ByteRecord::new(),
            row: 0,
            failed: false,
        })
    }

    fn read(&mut self) -> Result<Option<Sample>, RecordingError> {
        match self.rows.read_byte_record(&mut self.record) {
            Ok(true) => self.row += 1,
            Ok(false) => return Ok(None),
            Err(error) => {
                let (origin, reason) = (self.origin.clone(), error.to_string());
                return Err(RecordingError::Damaged {
                    origin,
                    row: self.row,
                    reason,
                });
            }
        }
        let mut row = [0.0; 16];
        for ((value, &place), column) in row.iter_mut().zip(&self.order).zip(COLUMNS) {
            let bytes = self.record.get(place).unwrap_or_default();
            *value = std::str::from_utf8(bytes)
                .ok()
                .and_then(|text| text.parse().ok())
                .filter(|number: &f64| number.is_finite())
                .ok_or_else(|| RecordingError::Value {
                    origin: self.origin.clone(),
                    row: self.row,
                    column,
                    text: String::from_utf8_lossy(bytes).into_owned(),
                })?;
        }
        Ok(Some(from_row(&row)))
    }
}

impl Iterator for RecordingReader {
    type Item = Result<Sample, RecordingError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.failed {
            return None;
        }
        let item = self.read().transpose();
        self.failed = matches!(item, Some(Err(_)));
        item
    }
}

fn order(header: &ByteRecord) -> Result<[usize; 16], (String, &'static str)> {
    let names: Vec<String> = header
        .iter()
        .map(|name| {
            String::from_utf8_lossy(name)
                .trim_start_matches('\u{feff}')
                .trim()
                .to_owned()
        })
        .collect();
    if let Some(unknown) = names.iter().find(|name| !COLUMNS.contains(&name.as_str())) {
        return Err((unknown.clone(), "is unknown"));
    }
    let mut order = [0; 16];
    for (place, column) in order.iter_mut().zip(COLUMNS) {
        let mut found = names.iter().enumerate().filter(|(_, name)| *name == column);
        *place = found
            .next()
            .ok_or_else(|| (column.to_owned(), "is missing"))?
            .0;
        if found.next().is_some() {
            return Err((column.to_owned(), "is there twice"));
        }
    }
    Ok(order)
}
