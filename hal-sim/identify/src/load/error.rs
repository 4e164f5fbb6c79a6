//! Why a recording could not be loaded.

/// Why a recording could not be loaded.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file could not be opened.
    #[error(
        "{origin}: cannot open: {reason}; give the path of an existing .csv, .csv.gz, .mat or .parquet"
    )]
    Open {
        /// The file.
        origin: String,
        /// The system's reason.
        reason: String,
    },
    /// The file is not what its name says.
    #[error("{origin}: cannot read it as {format}: {reason}")]
    Format {
        /// The file.
        origin: String,
        /// CSV, MATLAB 5, Parquet.
        format: &'static str,
        /// What the reader said.
        reason: String,
    },
    /// A column is not there.
    #[error("{origin}: column `{column}` is missing; it has {}; name it in a mapping file", present.join(", "))]
    Column {
        /// The file.
        origin: String,
        /// The column.
        column: String,
        /// The columns that are there.
        present: Vec<String>,
    },
    /// A cell is no number.
    #[error("{origin}, row {row}, column `{column}`: read `{text}`, expected a number")]
    Cell {
        /// The file.
        origin: String,
        /// Row, the first one being 1.
        row: usize,
        /// The column.
        column: String,
        /// What was there.
        text: String,
    },
    /// A value cannot be.
    #[error(
        "{origin}, row {row}, column `{column}`: read {value}, expected a finite number of at most {most}; is the unit right?"
    )]
    Value {
        /// The file.
        origin: String,
        /// Row, the first one being 1.
        row: usize,
        /// The column.
        column: String,
        /// What was there.
        value: f64,
        /// Largest plausible size.
        most: f64,
    },
    /// Time does not go on evenly.
    #[error(
        "{origin}, row {row}: time steps by {step} s, expected {interval} s; a gap, a row twice or a step back"
    )]
    Time {
        /// The file.
        origin: String,
        /// Row, the first one being 1.
        row: usize,
        /// The step to it, s.
        step: f64,
        /// What was expected, s.
        interval: f64,
    },
    /// There is too little of it.
    #[error("{origin}: {seconds} s of record, expected at least {least} s")]
    Short {
        /// The file.
        origin: String,
        /// Length, s.
        seconds: f64,
        /// Least length, s.
        least: f64,
    },
    /// The mapping file is not understood.
    #[error("{origin}: {reason}")]
    Mapping {
        /// The file.
        origin: String,
        /// What is wrong.
        reason: String,
    },
}
