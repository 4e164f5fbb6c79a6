//! Text, row by row.

use super::{LoadError, Table, Word};
use std::io::Read;

pub(super) fn read(input: impl Read, separator: u8, origin: String) -> Result<Table, LoadError> {
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .delimiter(separator)
        // A row cut short is a fault of that row, which the rules for faults know.
        .flexible(true)
        .buffer_capacity(1 << 16)
        .from_reader(input);
    let format = |row: usize, error: csv::Error| LoadError::Format {
        origin: origin.clone(),
        format: "CSV",
        reason: format!("after row {row}: {error}; the file may be cut off or damaged"),
    };
    let names: Vec<String> = reader
        .headers()
        .map_err(|e| format(0, e))?
        .iter()
        .map(|name| name.trim_start_matches('\u{feff}').to_owned())
        .collect();
    let mut columns = vec![Vec::new(); names.len()];
    let mut words = Vec::new();
    let mut record = csv::ByteRecord::new();
    let mut row = 0;
    while reader
        .read_byte_record(&mut record)
        .map_err(|e| format(row, e))?
    {
        row += 1;
        let surplus = record.len() > names.len();
        for (column, values) in columns.iter_mut().enumerate() {
            let cell = record.get(column).unwrap_or_default();
            let number = std::str::from_utf8(cell)
                .ok()
                .and_then(|text| text.parse().ok())
                .filter(|_: &f64| !surplus);
            values.push(number.unwrap_or_else(|| {
                let text = match surplus {
                    true => format!("{} cells instead of {}", record.len(), names.len()),
                    false => String::from_utf8_lossy(cell).into_owned(),
                };
                words.push(Word { row, column, text });
                f64::NAN
            }));
        }
    }
    Ok(Table {
        origin,
        names,
        columns,
        words,
    })
}
