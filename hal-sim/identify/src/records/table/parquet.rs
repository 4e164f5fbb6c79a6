//! Parquet: numeric columns; what is null is no number.

use super::{Column, LoadError, MOST_COLUMNS, Progress, Table, damaged};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use std::fs::File;

/// Rows between two words about progress.
const STEP: usize = 4096;

pub(super) fn read(file: File, origin: &str, progress: &mut Progress) -> Result<Table, LoadError> {
    let format = |error: ParquetError| damaged(origin, "Parquet", error.to_string());
    let reader = SerializedFileReader::new(file).map_err(format)?;
    let metadata = reader.metadata().file_metadata();
    let rows = metadata.num_rows().max(1) as f64;
    let schema = metadata.schema_descr();
    if schema.num_columns() > MOST_COLUMNS {
        return Err(damaged(origin, "Parquet", "it has too many columns"));
    }
    let mut table = Table {
        columns: schema
            .columns()
            .iter()
            .map(|column| Column {
                path: column.name().to_owned(),
                ..Column::default()
            })
            .collect(),
        ..Table::default()
    };
    for (row, record) in reader.get_row_iter(None).map_err(format)?.enumerate() {
        if row.is_multiple_of(STEP) {
            progress(row as f64 / rows);
        }
        let record = record.map_err(format)?;
        for (column, (_, field)) in record.get_column_iter().enumerate() {
            let value = number(field);
            if value.is_none() {
                table.push_word(row + 1, column, field.to_string().as_bytes());
            }
            if let Some(column) = table.columns.get_mut(column) {
                column.values.push(value.unwrap_or(f64::NAN));
            }
        }
    }
    Ok(table)
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
