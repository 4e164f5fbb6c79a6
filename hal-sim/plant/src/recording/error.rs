//! Why a recording could not be read or written.

use std::path::PathBuf;
use thiserror::Error;

/// Why a recording could not be read or written.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file could not be opened.
    #[error("{}: cannot open the recording: {source}; give the path of an existing .csv or .csv.gz", path.display())]
    Open {
        /// The path that was tried.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file could not be created or written.
    #[error("{}: cannot write the recording: {source}; choose a folder that exists and can be written", path.display())]
    Write {
        /// The path that was tried.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The text is cut off, no CSV, or badly compressed.
    #[error(
        "{origin}, after row {row}: cannot read on: {reason}; the file may be cut off or damaged"
    )]
    Damaged {
        /// The file.
        origin: String,
        /// Rows that were read before; 0 is the header.
        row: u64,
        /// What the reader said.
        reason: String,
    },
    /// The header lacks a column or has one twice or too many.
    #[error("{origin}: column `{column}` {fault}; expected the columns {}", super::COLUMNS.join(", "))]
    Column {
        /// The file.
        origin: String,
        /// The column.
        column: String,
        /// `is missing`, `is unknown` or `is there twice`.
        fault: &'static str,
    },
    /// A value is no finite number.
    #[error("{origin}, row {row}, column `{column}`: read `{text}`, expected a finite number")]
    Value {
        /// The file.
        origin: String,
        /// Row, the first one below the header being 1.
        row: u64,
        /// The column.
        column: &'static str,
        /// What was read.
        text: String,
    },
    /// There are no rows.
    #[error("{origin}: no rows below the header; expected one for each sample")]
    Empty {
        /// The file.
        origin: String,
    },
}
