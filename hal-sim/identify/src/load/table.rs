//! Named columns of numbers, from any of the formats.

use super::LoadError;
use flate2::read::MultiGzDecoder;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// Named columns.
#[derive(Debug, Default)]
pub struct Table {
    /// The file, for messages.
    pub origin: String,
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
}

impl Table {
    /// Reads a file by its ending.
    ///
    /// # Errors
    /// A file that cannot be read, or a cell that is no number.
    pub fn read(path: &Path) -> Result<Self, LoadError> {
        let origin = path.display().to_string();
        let file = File::open(path).map_err(|e| LoadError::Open {
            origin: origin.clone(),
            reason: e.to_string(),
        })?;
        let name = origin.to_lowercase();
        if name.ends_with(".mat") {
            Self::mat(file, origin)
        } else if name.ends_with(".parquet") {
            Self::parquet(file, origin)
        } else if name.ends_with(".gz") {
            Self::csv(MultiGzDecoder::new(BufReader::new(file)), origin)
        } else {
            Self::csv(BufReader::new(file), origin)
        }
    }

    /// A column by its name.
    ///
    /// # Errors
    /// A column that is not there.
    pub fn column(&self, name: &str) -> Result<&[f64], LoadError> {
        match self.names.iter().position(|known| known == name) {
            Some(at) => Ok(&self.columns[at]),
            None => Err(LoadError::Column {
                origin: self.origin.clone(),
                column: name.to_owned(),
                present: self.names.clone(),
            }),
        }
    }

    /// Rows of the longest column.
    pub fn rows(&self) -> usize {
        self.columns.iter().map(Vec::len).max().unwrap_or(0)
    }

    fn csv(input: impl Read, origin: String) -> Result<Self, LoadError> {
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .from_reader(input);
        let format = |error: csv::Error, origin: &str| LoadError::Format {
            origin: origin.to_owned(),
            format: "CSV",
            reason: error.to_string(),
        };
        let names: Vec<String> = reader
            .headers()
            .map_err(|e| format(e, &origin))?
            .iter()
            .map(str::to_owned)
            .collect();
        let mut columns = vec![Vec::new(); names.len()];
        let mut record = csv::StringRecord::new();
        let mut row = 0;
        while reader
            .read_record(&mut record)
            .map_err(|e| format(e, &origin))?
        {
            row += 1;
            for ((cell, column), name) in record.iter().zip(&mut columns).zip(&names) {
                column.push(cell.parse().map_err(|_| LoadError::Cell {
                    origin: origin.clone(),
                    row,
                    column: name.clone(),
                    text: cell.to_owned(),
                })?);
            }
        }
        Ok(Table {
            origin,
            names,
            columns,
        })
    }

    fn mat(file: File, origin: String) -> Result<Self, LoadError> {
        let parsed =
            matfile::MatFile::parse(BufReader::new(file)).map_err(|error| LoadError::Format {
                origin: origin.clone(),
                format: "MATLAB 5",
                reason: format!("{error:?}"),
            })?;
        let mut table = Table {
            origin,
            ..Table::default()
        };
        for array in parsed.arrays() {
            table.names.push(array.name().to_owned());
            table.columns.push(crate::emps::numbers(array.data()));
        }
        Ok(table)
    }

    #[cfg(feature = "parquet")]
    fn parquet(file: File, origin: String) -> Result<Self, LoadError> {
        use parquet::file::reader::{FileReader, SerializedFileReader};
        use parquet::record::Field;
        let format = |error: parquet::errors::ParquetError| LoadError::Format {
            origin: origin.clone(),
            format: "Parquet",
            reason: error.to_string(),
        };
        let reader = SerializedFileReader::new(file).map_err(format)?;
        let schema = reader.metadata().file_metadata().schema_descr();
        let names: Vec<String> = schema
            .columns()
            .iter()
            .map(|column| column.name().to_owned())
            .collect();
        let mut columns = vec![Vec::new(); names.len()];
        for (row, record) in reader.get_row_iter(None).map_err(format)?.enumerate() {
            let record = record.map_err(format)?;
            for (((name, field), column), own) in
                record.get_column_iter().zip(&mut columns).zip(&names)
            {
                column.push(match field {
                    Field::Double(value) => *value,
                    Field::Float(value) => f64::from(*value),
                    Field::Int(value) => f64::from(*value),
                    Field::Long(value) => *value as f64,
                    Field::UInt(value) => f64::from(*value),
                    other => {
                        debug_assert_eq!(name, own);
                        return Err(LoadError::Cell {
                            origin: origin.clone(),
                            row: row + 1,
                            column: name.clone(),
                            text: other.to_string(),
                        });
                    }
                });
            }
        }
        Ok(Table {
            origin,
            names,
            columns,
        })
    }

    #[cfg(not(feature = "parquet"))]
    fn parquet(_: File, origin: String) -> Result<Self, LoadError> {
        Err(LoadError::Format {
            origin,
            format: "Parquet",
            reason: "this build leaves Parquet out; build identify with `--features parquet`"
                .to_owned(),
        })
    }
}
