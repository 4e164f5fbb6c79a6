//! Parquet: numeric columns; what is null is no number.

use super::{LoadError, Progress, Table, Word};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use std::fs::File;

/// Rows between two words about progress.
const STEP: usize = 4096;

pub(super) fn read(
    file: File,
    origin: String,
    progress: &mut Progress,
) -> Result<Table, LoadError> {
    let format = |error: ParquetError| LoadError::Format {
        origin: origin.clone(),
        format: "Parquet",
        reason: error.to_string(),
    };
    let reader = SerializedFileReader::new(file).map_err(format)?;
    let metadata = reader.metadata().file_metadata();
    let rows = metadata.num_rows().max(1) as f64;
    let names: Vec<String> = metadata
        .schema_descr()
        .columns()
        .iter()
        .map(|column| column.name().to_owned())
        .collect();
    let mut columns = vec![Vec::new(); names.len()];
    let mut words = Vec::new();
    for (row, record) in reader.get_row_iter(None).map_err(format)?.enumerate() {
        if row.is_multiple_of(STEP) {
            progress(row as f64 / rows);
        }
        let record = record.map_err(format)?;
        for (column, ((_, field), values)) in record.get_column_iter().zip(&mut columns).enumerate()
        {
            values.push(number(field).unwrap_or_else(|| {
                words.push(Word {
                    row: row + 1,
                    column,
                    text: field.to_string(),
                });
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

fn number(field: &Field) -> Option<f64> {
    Some(match field {
        Field::Double(value) => *value,
        Field::Float(value) => f64::from(*value),
        Field::Byte(value) => f64::from(*value),
        Field::Short(value) => f64::from(*value),
        Field::Int(value) => f64::from(*value),
        Field::Long(value) => *value as f64,
        Field::UByte(value) => f64::from(*value),
        Field::UShort(value) => f64::from(*value),
        Field::UInt(value) => f64::from(*value),
        Field::ULong(value) => *value as f64,
        _ => return None,
    })
}
