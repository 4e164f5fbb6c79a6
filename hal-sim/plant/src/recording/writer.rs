//! A recording, written row by row.

use super::columns::{DECIMALS, to_row};
use super::{COLUMNS, RecordingError, Sample, digits};
use flate2::Compression;
use flate2::write::GzEncoder;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

enum Output {
    Plain(BufWriter<File>),
    Zipped(BufWriter<GzEncoder<File>>),
}

impl Output {
    fn writer(&mut self) -> &mut dyn Write {
        match self {
            Output::Plain(file) => file,
            Output::Zipped(file) => file,
        }
    }

    fn finish(self) -> io::Result<()> {
        let file = match self {
            Output::Plain(file) => file.into_inner().map_err(io::IntoInnerError::into_error)?,
            Output::Zipped(file) => file
                .into_inner()
                .map_err(io::IntoInnerError::into_error)?
                .finish()?,
        };
        file.sync_all()
    }
}

/// Writes a recording row by row, with fixed digits: 0.1 ms, 1 urad, 0.1 mA, 1 mV, 1 nm.
pub struct RecordingWriter {
    output: Output,
    path: PathBuf,
    line: Vec<u8>,
}

impl RecordingWriter {
    /// Creates the file and writes the header; compressed if the name ends in `.gz`.
    ///
    /// # Errors
    /// A file that cannot be created or written.
    pub fn create(path: &Path) -> Result<Self, RecordingError> {
        let fault = |source| RecordingError::Write {
            path: path.to_owned(),
            source,
        };
        let file = File::create(path).map_err(fault)?;
        let mut output = if path.extension().is_some_and(|extension| extension == "gz") {
            Output::Zipped(BufWriter::with_capacity(
                1 << 16,
                // A recording is written while a drive is simulated: a third larger, in a fifth of the time.
                GzEncoder::new(file, Compression::fast()),
            ))
        } else {
            Output::Plain(BufWriter::with_capacity(1 << 16, file))
        };
        writeln!(output.writer(), "{}", COLUMNS.join(",")).map_err(fault)?;
        Ok(RecordingWriter {
            output,
            path: path.to_owned(),
            line: Vec::with_capacity(256),
        })
    }

    /// Writes a row.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&mut self, sample: &Sample) -> Result<(), RecordingError> {
        self.line.clear();
        for (k, (value, decimals)) in to_row(sample).into_iter().zip(DECIMALS).enumerate() {
            if k > 0 {
                self.line.push(b',');
            }
            digits::append(&mut self.line, value, decimals);
        }
        self.line.push(b'\n');
        let Self { output, path, line } = self;
        output
            .writer()
            .write_all(line)
            .map_err(|source| RecordingError::Write {
                path: path.clone(),
                source,
            })
    }

    /// Writes the residual. Without this call the file's end is missing.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(self) -> Result<(), RecordingError> {
        let Self { output, path, .. } = self;
        output
            .finish()
            .map_err(|source| RecordingError::Write { path, source })
    }
}
