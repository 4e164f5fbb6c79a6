//! MATLAB 5: each numeric variable is a column.

use super::{LoadError, Table};
use matfile::{MatFile, NumericData};
use std::fs::File;
use std::io::BufReader;

pub(super) fn read(file: File, origin: String) -> Result<Table, LoadError> {
    let parsed = MatFile::parse(BufReader::new(file)).map_err(|error| LoadError::Format {
        origin: origin.clone(),
        format: "MATLAB 5",
        reason: format!("{error:?}; version 7.3 is another format: save with -v7 or -v6"),
    })?;
    let (names, columns) = parsed
        .arrays()
        .iter()
        .map(|array| (array.name().to_owned(), numbers(array.data())))
        .unzip();
    Ok(Table {
        origin,
        names,
        columns,
        words: Vec::new(),
    })
}

fn numbers(data: &NumericData) -> Vec<f64> {
    match data {
        NumericData::Double { real, .. } => real.clone(),
        NumericData::Single { real, .. } => real.iter().map(|x| f64::from(*x)).collect(),
        NumericData::Int8 { real, .. } => real.iter().map(|x| f64::from(*x)).collect(),
        NumericData::UInt8 { real, .. } => real.iter().map(|x| f64::from(*x)).collect(),
        NumericData::Int16 { real, .. } => real.iter().map(|x| f64::from(*x)).collect(),
        NumericData::UInt16 { real, .. } => real.iter().map(|x| f64::from(*x)).collect(),
        NumericData::Int32 { real, .. } => real.iter().map(|x| f64::from(*x)).collect(),
        NumericData::UInt32 { real, .. } => real.iter().map(|x| f64::from(*x)).collect(),
        NumericData::Int64 { real, .. } => real.iter().map(|x| *x as f64).collect(),
        NumericData::UInt64 { real, .. } => real.iter().map(|x| *x as f64).collect(),
    }
}
