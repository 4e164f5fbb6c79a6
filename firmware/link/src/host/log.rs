//! The firmware's log: defmt's frames, decoded with the table in the firmware's ELF.

use anyhow::{Context, Result, anyhow};
use defmt_decoder::{DecodeError, StreamDecoder, Table};

/// The table of an ELF.
///
/// # Errors
/// The file has none, or one of another defmt.
pub fn table(elf: &[u8]) -> Result<Table> {
    Table::parse(elf)
        .context("the firmware's log table cannot be read")?
        .ok_or_else(|| anyhow!("the firmware has no log table"))
}

/// A line of the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// `info`, `error` and so on, where the line has a level.
    pub level: String,
    /// What it says.
    pub message: String,
}

/// Decodes a log.
pub struct Log<'t>(Box<dyn StreamDecoder + Send + Sync + 't>);

impl<'t> Log<'t> {
    /// A log of the firmware that `table` is of.
    #[must_use]
    pub fn new(table: &'t Table) -> Self {
        Self(table.new_stream_decoder())
    }

    /// Takes what came, in pieces of any length, and gives the lines that are whole.
    pub fn take(&mut self, bytes: &[u8]) -> Vec<Line> {
        self.0.received(bytes);
        let mut lines = Vec::new();
        loop {
            match self.0.decode() {
                Ok(frame) => lines.push(Line {
                    level: frame
                        .level()
                        .map_or_else(String::new, |l| l.as_str().to_owned()),
                    message: frame.display_message().to_string(),
                }),
                Err(DecodeError::UnexpectedEof) => return lines,
                Err(DecodeError::Malformed) => lines.push(Line {
                    level: "error".into(),
                    message: "a line of the log came damaged".into(),
                }),
            }
        }
    }
}
