//! Why a recording could not be loaded.

/// Why a recording could not be loaded. Rows are counted from 1, the first one below the header.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file could not be opened.
    #[error(
        "{origin}: cannot open: {reason}; give the path of an existing text (.csv, .txt, also .gz), .npy, .npz, .mat or .parquet"
    )]
    Open {
        /// The file.
        origin: String,
        /// The system's reason.
        reason: String,
    },
    /// The file is not what its name says, or is cut off or damaged.
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
    /// Two columns have the name that is asked for.
    #[error(
        "{origin}: the column `{column}` is there twice, as number {first} and {second}; name it by its number in a mapping \
         file"
    )]
    Twice {
        /// The file.
        origin: String,
        /// The column.
        column: String,
        /// Number of the first.
        first: usize,
        /// Number of the second.
        second: usize,
    },
    /// None of several alternatives is there.
    #[error(
        "{origin}: the {group} are missing: expected the columns {expected}; it has {}; name them in a mapping file",
        present.join(", ")
    )]
    Group {
        /// The file.
        origin: String,
        /// What the alternatives are of.
        group: &'static str,
        /// The alternatives.
        expected: String,
        /// The columns that are there.
        present: Vec<String>,
    },
    /// Columns differ in length.
    #[error("{origin}: column `{column}` has {rows} rows, expected {expected} as in the others")]
    Length {
        /// The file.
        origin: String,
        /// The column.
        column: String,
        /// Its rows.
        rows: usize,
        /// Rows of the others.
        expected: usize,
    },
    /// A cell is no number.
    #[error("{origin}, row {row}, column `{column}`: read `{text}`, expected a finite number")]
    Cell {
        /// The file.
        origin: String,
        /// Row.
        row: usize,
        /// The column.
        column: String,
        /// What was there.
        text: String,
    },
    /// A value is larger than a feed drive has.
    #[error(
        "{origin}, row {row}, column `{column}`: read {value}, expected at most {most}; is the unit right?"
    )]
    Value {
        /// The file.
        origin: String,
        /// Row.
        row: usize,
        /// The column.
        column: String,
        /// What was there.
        value: f64,
        /// Largest plausible size.
        most: f64,
    },
    /// So many values are too large that it is the unit.
    #[error(
        "{origin}, column `{column}`: {count} values are larger than {most}, the first in row {row}; the unit is wrong: \
         give a scale in a mapping file"
    )]
    Unit {
        /// The file.
        origin: String,
        /// The column.
        column: String,
        /// How many.
        count: usize,
        /// Row of the first.
        row: usize,
        /// Largest plausible size.
        most: f64,
    },
    /// Angle and speed reference do not belong together.
    #[error(
        "{origin}, column `{column}`: it turns by {turned:.1} rad where the speed reference asks for {asked:.1} rad; is a \
         unit wrong (degrees, rpm), or did the motor not follow?"
    )]
    Turned {
        /// The file.
        origin: String,
        /// The angle's column.
        column: String,
        /// Way of the angle, rad.
        turned: f64,
        /// Way by the speed reference, rad.
        asked: f64,
    },
    /// Time does not go on evenly.
    #[error(
        "{origin}, row {row}, column `t_s`: {what}; time steps by {step:.6} s, expected {interval:.6} s"
    )]
    Time {
        /// The file.
        origin: String,
        /// Row.
        row: usize,
        /// A gap, a time twice, a step back.
        what: &'static str,
        /// The step to it, s.
        step: f64,
        /// What was expected, s.
        interval: f64,
    },
    /// The rows have another rate than declared.
    #[error(
        "{origin}, column `t_s`: rows are {step:e} s apart, but {expected:e} s are declared; is time in seconds, and is \
         sample_hz right?"
    )]
    Rate {
        /// The file.
        origin: String,
        /// Median step, s.
        step: f64,
        /// Declared step, s.
        expected: f64,
    },
    /// Time jumps so often that it is no time.
    #[error(
        "{origin}, column `t_s`: time jumps {gaps} times in {rows} rows by more than 6 intervals of {interval:.6} s; is it the \
         time of the rows, and is its unit right?"
    )]
    Gaps {
        /// The file.
        origin: String,
        /// How often.
        gaps: usize,
        /// All rows.
        rows: usize,
        /// Interval, s.
        interval: f64,
    },
    /// So many rows are bad that the others say little.
    #[error(
        "{origin}: {skipped} of {rows} rows are bad, the first in row {row}; at most one in twenty may be skipped"
    )]
    TooMany {
        /// The file.
        origin: String,
        /// Bad rows.
        skipped: usize,
        /// All rows.
        rows: usize,
        /// The first bad one.
        row: usize,
    },
    /// There is too little of it.
    #[error(
        "{origin}: {seconds} s of record in pieces of at least 0.1 s, expected at least {least} s"
    )]
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
