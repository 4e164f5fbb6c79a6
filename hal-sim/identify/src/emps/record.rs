//! The benchmark's files (MATLAB 5).

use matfile::{MatFile, NumericData};
use std::path::{Path, PathBuf};

/// Why a file of the benchmark could not be read.
#[derive(Debug, thiserror::Error)]
pub enum EmpsError {
    /// The file could not be opened.
    #[error("{}: cannot open: {source}; put the benchmark's files there", path.display())]
    Open {
        /// The path that was tried.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is no MATLAB 5 file.
    #[error("{}: cannot read it as MATLAB 5: {reason}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What the reader said.
        reason: String,
    },
    /// A variable is missing or too short.
    #[error("{}: variable `{name}` has {found} values, expected at least {expected}", path.display())]
    Variable {
        /// The file.
        path: PathBuf,
        /// The variable.
        name: String,
        /// How many values it has.
        found: usize,
        /// How many it needs.
        expected: usize,
    },
}

/// One record at 1 kHz.
#[derive(Debug, Clone)]
pub struct Record {
    /// Measured position of the carriage, m.
    pub position: Vec<f64>,
    /// Reference position, m.
    pub reference: Vec<f64>,
    /// The controller's output, V.
    pub output: Vec<f64>,
    /// Voltage added to the controller's, V.
    pub pulses: Vec<f64>,
    /// Force per volt, N/V.
    pub force_per_volt: f64,
    /// Gain of the position loop, 1/s.
    pub kp: f64,
    /// Gain of the velocity loop, V s/m.
    pub kv: f64,
}

/// Rows per second.
pub(super) const RATE: f64 = 1000.0;

impl Record {
    /// Reads a file of the benchmark.
    ///
    /// # Errors
    /// A file that cannot be read or lacks a variable.
    pub fn load(path: &Path) -> Result<Self, EmpsError> {
        let file = std::fs::File::open(path).map_err(|source| EmpsError::Open {
            path: path.to_owned(),
            source,
        })?;
        let parsed = MatFile::parse(file).map_err(|error| EmpsError::Format {
            path: path.to_owned(),
            reason: format!("{error:?}"),
        })?;
        let column = |name: &str, expected: usize| {
            let values = parsed
                .find_by_name(name)
                .map(|array| numbers(array.data()))
                .unwrap_or_default();
            if values.len() < expected {
                let found = values.len();
                return Err(EmpsError::Variable {
                    path: path.to_owned(),
                    name: name.to_owned(),
                    found,
                    expected,
                });
            }
            Ok(values)
        };
        let position = column("qm", 1000)?;
        let rows = position.len();
        let pulses = if parsed.find_by_name("pulses_N").is_some() {
            column("pulses_N", rows)?
        } else {
            vec![0.0; rows]
        };
        Ok(Record {
            reference: column("qg", rows)?,
            output: column("vir", rows)?,
            pulses,
            force_per_volt: column("gtau", 1)?[0],
            kp: column("kp", 1)?[0],
            kv: column("kv", 1)?[0],
            position,
        })
    }

    /// Rows.
    pub fn len(&self) -> usize {
        self.position.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }

    /// The first rows of it.
    pub(super) fn first(&self, rows: usize) -> Self {
        let cut = |column: &[f64]| column[..rows.min(column.len())].to_vec();
        Record {
            position: cut(&self.position),
            reference: cut(&self.reference),
            output: cut(&self.output),
            pulses: cut(&self.pulses),
            ..*self
        }
    }

    /// Motor force, N.
    pub fn force(&self) -> Vec<f64> {
        self.output
            .iter()
            .map(|v| v * self.force_per_volt)
            .collect()
    }
}

pub(crate) fn numbers(data: &NumericData) -> Vec<f64> {
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
