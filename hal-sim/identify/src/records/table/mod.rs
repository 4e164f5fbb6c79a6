//! Columns of numbers by their paths, from any of the formats.

mod csv;
mod mat;
mod npy;
#[cfg(feature = "parquet")]
mod parquet;
mod sniff;

pub use sniff::Layout as TextLayout;

use super::LoadError;
use super::units;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Told how much of a file is read, from 0 to 1.
pub type Progress<'a> = dyn FnMut(f64) + 'a;

/// Most columns of a file: beyond it the separator was taken for another, or the file is no record.
pub(super) const MOST_COLUMNS: usize = 4096;
/// Most bytes that a compressed file may unpack to: what a computer of 8 GB still holds as numbers.
pub(super) const MOST_UNPACKED: u64 = 1 << 31;
/// Most cells whose text is kept for messages.
const MOST_WORDS: usize = 1000;

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

/// A column of a file.
#[derive(Debug, Clone, Default)]
pub struct Column {
    /// Its name or path: `Iq`, `data.0.iq`, `2`.
    pub path: String,
    /// Its unit, where the file says one.
    pub unit: Option<String>,
    /// Its values.
    pub values: Vec<f64>,
}

/// Columns as a file has them.
#[derive(Debug, Default)]
pub struct Table {
    /// The file, for messages.
    pub origin: String,
    /// Its columns.
    pub columns: Vec<Column>,
    /// The first of the cells that are no numbers.
    pub words: Vec<Word>,
    /// What was guessed about the file.
    pub notes: Vec<String>,
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

/// The format of a file.
#[derive(Clone, Copy, PartialEq)]
enum Format {
    Mat,
    Npy,
    Npz,
    Parquet,
    Zipped,
    Text,
}

/// By its first bytes, and where those are no sign by its name.
fn format(start: &[u8], name: &str) -> Format {
    match start {
        [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => Format::Npy,
        [b'P', b'K', 3 | 5, 4 | 6, ..] => Format::Npz,
        [0x1f, 0x8b, ..] => Format::Zipped,
        [b'P', b'A', b'R', b'1', ..] => Format::Parquet,
        [b'M', b'A', b'T', b'L', b'A', b'B', b' ', ..] => Format::Mat,
        _ if name.ends_with(".mat") => Format::Mat,
        _ if name.ends_with(".npy") => Format::Npy,
        _ if name.ends_with(".npz") => Format::Npz,
        _ if name.ends_with(".parquet") => Format::Parquet,
        _ => Format::Text,
    }
}

#[cfg(feature = "parquet")]
use parquet::read as read_parquet;

#[cfg(not(feature = "parquet"))]
fn read_parquet(_: File, origin: &str, _: &mut Progress) -> Result<Table, LoadError> {
    Err(damaged(
        origin,
        "Parquet",
        "this program was built without the feature `parquet`. In a clone run `cargo ddfeed-full` in place of `cargo ddfeed`, \
         or write the record as .csv, .npy or .mat",
    ))
}

impl Table {
    /// Reads a file. Its first bytes show its format; `text` says what is known of a text's layout.
    ///
    /// # Errors
    /// A file that cannot be read. A cell that is no number is none: it is listed.
    pub fn read(
        path: &Path,
        text: &TextLayout,
        progress: &mut Progress,
    ) -> Result<Self, LoadError> {
        let origin = path.display().to_string();
        let open = |e: std::io::Error| LoadError::Open {
            origin: origin.clone(),
            reason: e.to_string(),
        };
        let file = File::open(path).map_err(open)?;
        let metadata = file.metadata().map_err(open)?;
        if metadata.is_dir() {
            return Err(open(std::io::Error::other("it is a folder")));
        }
        let size = metadata.len();
        let mut file = BufReader::with_capacity(1 << 16, file);
        let format = format(file.fill_buf().map_err(open)?, &origin.to_lowercase());
        let mut counted = Counted {
            file,
            read: 0,
            size,
            told: 0,
            progress: &mut |share| progress(share),
        };
        let mut whole = || {
            let mut bytes = Vec::new();
            counted.read_to_end(&mut bytes).map_err(open)?;
            Ok(bytes)
        };
        let mut table = match format {
            Format::Mat => mat::read(&whole()?, &origin)?,
            Format::Npy => npy::read(&whole()?, &origin)?,
            Format::Npz => npy::read_zip(&whole()?, &origin)?,
            Format::Parquet => {
                drop(counted);
                read_parquet(File::open(path).map_err(open)?, &origin, progress)?
            }
            Format::Zipped => {
                let unpacked = flate2::read::MultiGzDecoder::new(counted);
                csv::read(unpacked.take(MOST_UNPACKED), &origin, text)?
            }
            Format::Text => csv::read(counted, &origin, text)?,
        };
        table.origin = origin;
        Ok(table)
    }

    /// Index of a column by its path, else by its path in other letters' case or without its unit, else by its number
    /// counted from 0.
    ///
    /// # Errors
    /// A column that is not there, or more than one.
    pub fn find(&self, path: &str) -> Result<usize, LoadError> {
        let exact = |column: &Column| column.path == path;
        let bare = |column: &Column| {
            let name = units::of_text(&column.path).map_or(column.path.as_str(), |(name, _)| name);
            name.eq_ignore_ascii_case(path) || column.path.eq_ignore_ascii_case(path)
        };
        let places = |is: &dyn Fn(&Column) -> bool| -> Vec<usize> {
            (0..self.columns.len())
                .filter(|k| is(&self.columns[*k]))
                .collect()
        };
        let found = Some(places(&exact))
            .filter(|found| !found.is_empty())
            .unwrap_or_else(|| places(&bare));
        match found[..] {
            [one] => Ok(one),
            [] => match path.parse::<usize>() {
                Ok(number) if number < self.columns.len() => Ok(number),
                _ => Err(LoadError::Column {
                    origin: self.origin.clone(),
                    column: path.to_owned(),
                    present: self.present(),
                }),
            },
            [first, second, ..] => Err(LoadError::Twice {
                origin: self.origin.clone(),
                column: path.to_owned(),
                first,
                second,
            }),
        }
    }

    /// Paths of the columns, the first forty.
    fn present(&self) -> Vec<String> {
        const SHOWN: usize = 40;
        let mut names: Vec<String> = self
            .columns
            .iter()
            .take(SHOWN)
            .map(|column| column.path.chars().take(60).collect())
            .collect();
        if self.columns.len() > SHOWN {
            names.push(format!("and {} more", self.columns.len() - SHOWN));
        }
        names
    }

    /// What stands in a cell that holds no finite number.
    pub fn text(&self, column: usize, row: usize) -> String {
        self.words
            .iter()
            .find(|word| word.column == column && word.row == row)
            .map_or_else(|| "NaN".to_owned(), |word| word.text.clone())
    }

    /// Lists a cell that is no number.
    fn push_word(&mut self, row: usize, column: usize, text: &[u8]) {
        if self.words.len() < MOST_WORDS {
            let text = String::from_utf8_lossy(&text[..text.len().min(60)]).into_owned();
            self.words.push(Word { row, column, text });
        }
    }
}

/// A file that is not what its name says, or is cut off or damaged.
fn damaged(origin: &str, format: &'static str, reason: impl Into<String>) -> LoadError {
    LoadError::Format {
        origin: origin.to_owned(),
        format,
        reason: reason.into(),
    }
}

/// The columns of a matrix whose values come column by column. Channels lie along its shorter side.
fn matrix(
    path: &str,
    [rows, columns]: [usize; 2],
    values: &[f64],
    notes: &mut Vec<String>,
) -> Vec<Column> {
    let join = |k: usize| match path {
        "" => k.to_string(),
        path => format!("{path}.{k}"),
    };
    let column = |path: String, values: Vec<f64>| Column {
        path,
        unit: None,
        values,
    };
    if rows == 1 || columns == 1 {
        let path = if path.is_empty() { "0" } else { path };
        return vec![column(path.to_owned(), values.to_vec())];
    }
    let shorter = rows.min(columns);
    if shorter > MOST_COLUMNS {
        notes.push(format!(
            "`{path}` is a matrix of {rows} x {columns}: too wide to be channels, left out"
        ));
        return Vec::new();
    }
    let name = if path.is_empty() { "the matrix" } else { path };
    if rows < columns {
        notes.push(format!(
            "{name} has {rows} rows of {columns} values: its rows are taken as channels, counted from 0"
        ));
        (0..rows)
            .map(|k| {
                let row = values.iter().skip(k).step_by(rows).copied().collect();
                column(join(k), row)
            })
            .collect()
    } else {
        (0..columns)
            .map(|k| column(join(k), values[k * rows..(k + 1) * rows].to_vec()))
            .collect()
    }
}
