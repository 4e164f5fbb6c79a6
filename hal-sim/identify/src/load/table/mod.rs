//! Named columns of numbers, from any of the formats.

mod csv;
mod mat;
mod parquet;

use super::LoadError;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Told how much of a file is read, from 0 to 1.
pub type Progress<'a> = dyn FnMut(f64) + 'a;

/// A cell that is no number; the column holds NaN in its place.
#[derive(Debug, Clone)]
pub struct Word {
    /// Row, the first one below the header being 1.
    pub row: usize,
    /// Index of the column.
    pub column: usize,
    /// What was there.
    pub text: String,
}

/// Named columns as a file has them.
#[derive(Debug, Default)]
pub struct Table {
    /// The file, for messages.
    pub origin: String,
    /// Names of the columns.
    pub names: Vec<String>,
    /// Their values.
    pub columns: Vec<Vec<f64>>,
    /// Cells that are no numbers.
    pub words: Vec<Word>,
}

/// Counts what is read of a file.
struct Counted<'a> {
    file: BufReader<File>,
    read: u64,
    size: u64,
    told: u64,
    progress: &'a mut Progress<'a>,
}

impl Read for Counted<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = self.file.read(buffer)?;
        self.read += count as u64;
        if self.read >= self.told {
            self.told = self.read + self.size / 200;
            (self.progress)(self.read as f64 / self.size.max(1) as f64);
        }
        Ok(count)
    }
}

impl Table {
    /// Reads a file: `.mat` and `.parquet` by their ending, all else as text with `separator` between its cells,
    /// compressed or not by its first bytes.
    ///
    /// # Errors
    /// A file that cannot be read. A cell that is no number is none: it is listed.
    pub fn read(path: &Path, separator: u8, progress: &mut Progress) -> Result<Self, LoadError> {
        let origin = path.display().to_string();
        let open = |e: std::io::Error| LoadError::Open {
            origin: origin.clone(),
            reason: e.to_string(),
        };
        let file = File::open(path).map_err(open)?;
        let size = file.metadata().map_err(open)?.len();
        let name = origin.to_lowercase();
        if name.ends_with(".mat") {
            return mat::read(file, origin);
        }
        if name.ends_with(".parquet") {
            return parquet::read(file, origin, progress);
        }
        let mut file = BufReader::with_capacity(1 << 16, file);
        let zipped = file.fill_buf().map_err(open)?.starts_with(&[0x1f, 0x8b]);
        let counted = Counted {
            file,
            read: 0,
            size,
            told: 0,
            progress: &mut |share| progress(share),
        };
        if zipped {
            csv::read(
                flate2::read::MultiGzDecoder::new(counted),
                separator,
                origin,
            )
        } else {
            csv::read(counted, separator, origin)
        }
    }

    /// Index of a column by its name.
    ///
    /// # Errors
    /// A column that is not there.
    pub fn find(&self, name: &str) -> Result<usize, LoadError> {
        self.names
            .iter()
            .position(|known| known == name)
            .ok_or_else(|| LoadError::Column {
                origin: self.origin.clone(),
                column: name.to_owned(),
                present: self.names.clone(),
            })
    }

    /// What stands in a cell that holds no finite number.
    pub fn text(&self, column: usize, row: usize) -> String {
        self.words
            .iter()
            .find(|word| word.column == column && word.row == row)
            .map_or_else(|| "NaN".to_owned(), |word| word.text.clone())
    }
}
