//! MATLAB 5 (`save -v6`, `-v7`): vectors, matrices, structs, arrays of structs, cells, by their paths.
//!
//! Format: MATLAB MAT-File Format (The MathWorks, R2024), chapter 1. Read by hand: of the crates that read structs none
//! survives a damaged file.

use super::{Column, LoadError, MOST_COLUMNS, MOST_UNPACKED, Table, damaged, matrix};
use std::io::Read;

const FORMAT: &str = "MATLAB 5";
/// Structs in structs.
const DEEPEST: usize = 16;

// Types of data elements.
const INT8: u32 = 1;
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;

// Classes of arrays.
const CELL: u8 = 1;
const STRUCT: u8 = 2;
const TEXT: u8 = 4;
const FIRST_NUMERIC: u8 = 6;
const LAST_NUMERIC: u8 = 15;

pub(super) fn read(bytes: &[u8], origin: &str) -> Result<Table, LoadError> {
    let fault = |reason: String| damaged(origin, FORMAT, reason);
    if bytes.starts_with(b"MATLAB 7.3") || bytes.get(..8) == Some(b"\x89HDF\r\n\x1a\n") {
        return Err(fault(
            "it is of version 7.3, another format (HDF5); save it with -v7 or -v6".into(),
        ));
    }
    let big = match bytes.get(126..128) {
        Some(b"IM") => false,
        Some(b"MI") => true,
        _ => {
            return Err(fault(
                "it has no header of MATLAB 5; save it with -v7 or -v6".into(),
            ));
        }
    };
    let mut reader = Reader {
        table: Table::default(),
        big,
        left: MOST_UNPACKED,
    };
    let mut at = Cursor(&bytes[128..]);
    while !at.0.is_empty() {
        reader.top(&mut at).map_err(&fault)?;
    }
    Ok(reader.table)
}

/// Bytes that are not yet read.
struct Cursor<'a>(&'a [u8]);

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let (taken, rest) = self
            .0
            .split_at_checked(count)
            .ok_or("it is cut off: an element is longer than the file")?;
        self.0 = rest;
        Ok(taken)
    }

    fn word(&mut self, big: bool) -> Result<u32, String> {
        Ok(word(self.take(4)?, big))
    }

    /// Type and data of the next element; its padding is left out.
    fn element(&mut self, big: bool) -> Result<(u32, &'a [u8]), String> {
        let first = self.word(big)?;
        if first >> 16 != 0 {
            // A small element: size and type in one word, data in the next.
            let data = self.take(4)?;
            let size = (first >> 16) as usize;
            let data = data.get(..size).ok_or("a small element is too long")?;
            return Ok((first & 0xffff, data));
        }
        let size = self.word(big)? as usize;
        let data = self.take(size)?;
        if first != COMPRESSED {
            let padding = (size.next_multiple_of(8) - size).min(self.0.len());
            self.take(padding)?;
        }
        Ok((first, data))
    }
}

fn word(bytes: &[u8], big: bool) -> u32 {
    let bytes = [bytes[0], bytes[1], bytes[2], bytes[3]];
    match big {
        true => u32::from_be_bytes(bytes),
        false => u32::from_le_bytes(bytes),
    }
}

/// An array without its values.
struct Head<'a> {
    class: u8,
    complex: bool,
    sides: Vec<usize>,
    name: &'a str,
}

/// What a field of a struct holds, as far as it becomes columns.
enum Content {
    Numbers { sides: [usize; 2], values: Vec<f64> },
    Other,
}

struct Reader {
    table: Table,
    big: bool,
    /// Bytes that may still be unpacked.
    left: u64,
}

impl Reader {
    /// An element of the file itself.
    fn top(&mut self, at: &mut Cursor) -> Result<(), String> {
        // Zeros may pad the end.
        if at.0.iter().take(8).all(|byte| *byte == 0) {
            at.0 = &[];
            return Ok(());
        }
        let (kind, data) = at.element(self.big)?;
        match kind {
            COMPRESSED => {
                let mut unpacked = Vec::new();
                flate2::read::ZlibDecoder::new(data)
                    .take(self.left)
                    .read_to_end(&mut unpacked)
                    .map_err(|error| format!("a compressed variable is damaged: {error}"))?;
                self.left = self.left.saturating_sub(unpacked.len() as u64);
                let (kind, data) = Cursor(&unpacked).element(self.big)?;
                match kind {
                    MATRIX => self.variable(data),
                    _ => Ok(()),
                }
            }
            MATRIX => self.variable(data),
            _ => Ok(()),
        }
    }

    fn variable(&mut self, data: &[u8]) -> Result<(), String> {
        let mut at = Cursor(data);
        let head = self.head(&mut at)?;
        let path = head.name.to_owned();
        let content = self.array(&head, &mut at, &path, 0)?;
        self.put(&path, content)
    }

    /// Flags, sides and name of an array.
    fn head<'a>(&self, at: &mut Cursor<'a>) -> Result<Head<'a>, String> {
        let (_, flags) = at.element(self.big)?;
        let flags = word(flags.get(..4).ok_or("an array has no flags")?, self.big);
        let (_, sides) = at.element(self.big)?;
        let sides = sides
            .chunks_exact(4)
            .map(|side| word(side, self.big) as usize)
            .collect();
        let (_, name) = at.element(self.big)?;
        Ok(Head {
            class: flags as u8,
            complex: flags & 0x0800 != 0,
            sides,
            name: std::str::from_utf8(name)
                .map_err(|_| "a variable's name is damaged")?
                .trim_end_matches('\0'),
        })
    }

    /// The values of an array; structs and cells put their columns into the table.
    fn array(
        &mut self,
        head: &Head,
        at: &mut Cursor,
        path: &str,
        depth: usize,
    ) -> Result<Content, String> {
        if depth > DEEPEST {
            return Err(format!("`{path}` is nested more than {DEEPEST} deep"));
        }
        match head.class {
            FIRST_NUMERIC..=LAST_NUMERIC => self.numbers(head, at, path),
            STRUCT => self.structure(head, at, path, depth),
            CELL => {
                for k in 0..elements(&head.sides) {
                    if at.0.is_empty() {
                        break;
                    }
                    let path = format!("{path}.{k}");
                    let content = self.nested(at, &path, depth)?;
                    self.put(&path, content)?;
                }
                Ok(Content::Other)
            }
            _ => {
                if head.class != TEXT {
                    self.table
                        .notes
                        .push(format!("`{path}` is no array of numbers, left out"));
                }
                Ok(Content::Other)
            }
        }
    }

    fn numbers(&mut self, head: &Head, at: &mut Cursor, path: &str) -> Result<Content, String> {
        if at.0.is_empty() {
            return Ok(Content::Other);
        }
        let (kind, data) = at.element(self.big)?;
        if head.complex {
            at.element(self.big)?;
            self.table
                .notes
                .push(format!("`{path}` is complex: its real part is taken"));
        }
        let values = values(kind, data, self.big)
            .ok_or_else(|| format!("`{path}` has values of the unknown type {kind}"))?;
        // More than two sides are read as one side after the first.
        let rows = head.sides.first().copied().unwrap_or(0);
        let columns = elements(&head.sides[1.min(head.sides.len())..]);
        match rows.checked_mul(columns) {
            Some(count) if count == values.len() => Ok(Content::Numbers {
                sides: [rows, columns],
                values,
            }),
            _ => Err(format!(
                "`{path}` declares {:?} values, but has {}",
                head.sides,
                values.len()
            )),
        }
    }

    fn nested(&mut self, at: &mut Cursor, path: &str, depth: usize) -> Result<Content, String> {
        let (kind, data) = at.element(self.big)?;
        if kind != MATRIX {
            return Err(format!("`{path}` is no array"));
        }
        if data.is_empty() {
            return Ok(Content::Other);
        }
        let mut inner = Cursor(data);
        let head = self.head(&mut inner)?;
        self.array(&head, &mut inner, path, depth + 1)
    }

    /// A struct's fields; of an array of structs `path.0.field`, or `path.field` where each element has one number.
    fn structure(
        &mut self,
        head: &Head,
        at: &mut Cursor,
        path: &str,
        depth: usize,
    ) -> Result<Content, String> {
        let (_, width) = at.element(self.big)?;
        let width = word(
            width.get(..4).ok_or("a struct has no field names")?,
            self.big,
        ) as usize;
        let (kind, names) = at.element(self.big)?;
        if kind != INT8 || width == 0 || names.len() / width > MOST_COLUMNS {
            return Err(format!("the field names of `{path}` are damaged"));
        }
        let names: Vec<String> = names
            .chunks_exact(width)
            .map(|name| {
                let end = name.iter().position(|byte| *byte == 0).unwrap_or(width);
                String::from_utf8_lossy(&name[..end]).into_owned()
            })
            .collect();
        let count = elements(&head.sides);
        let mut ones: Vec<Vec<f64>> = vec![Vec::new(); names.len()];
        for element in 0..count {
            for (field, name) in names.iter().enumerate() {
                if at.0.is_empty() {
                    return Err(format!("`{path}` is cut off"));
                }
                let path = match count {
                    1 => format!("{path}.{name}"),
                    _ => format!("{path}.{element}.{name}"),
                };
                match self.nested(at, &path, depth)? {
                    Content::Numbers { values, .. } if count > 1 && values.len() == 1 => {
                        ones[field].push(values[0]);
                    }
                    content => self.put(&path, content)?,
                }
            }
        }
        for (name, values) in names.iter().zip(ones) {
            if values.len() == count {
                let path = format!("{path}.{name}");
                self.put(
                    &path,
                    Content::Numbers {
                        sides: [count, 1],
                        values,
                    },
                )?;
            }
        }
        Ok(Content::Other)
    }

    fn put(&mut self, path: &str, content: Content) -> Result<(), String> {
        if let Content::Numbers { sides, values } = content {
            let columns: Vec<Column> = matrix(path, sides, &values, &mut self.table.notes);
            self.table.columns.extend(columns);
        }
        match self.table.columns.len() > MOST_COLUMNS {
            true => Err(format!("it has more than {MOST_COLUMNS} columns")),
            false => Ok(()),
        }
    }
}

/// Product of sides.
fn elements(sides: &[usize]) -> usize {
    sides
        .iter()
        .fold(1, |product: usize, side| product.saturating_mul(*side))
}

/// Numbers of a type of data element.
fn values(kind: u32, data: &[u8], big: bool) -> Option<Vec<f64>> {
    fn each<const N: usize>(data: &[u8], big: bool, to: impl Fn([u8; N]) -> f64) -> Vec<f64> {
        let (chunks, _) = data.as_chunks::<N>();
        chunks
            .iter()
            .map(|bytes| {
                let mut own = *bytes;
                if big {
                    own.reverse();
                }
                to(own)
            })
            .collect()
    }
    Some(match kind {
        1 => each(data, big, |b: [u8; 1]| f64::from(i8::from_le_bytes(b))),
        2 => each(data, big, |b: [u8; 1]| f64::from(b[0])),
        3 => each(data, big, |b| f64::from(i16::from_le_bytes(b))),
        4 => each(data, big, |b| f64::from(u16::from_le_bytes(b))),
        5 => each(data, big, |b| f64::from(i32::from_le_bytes(b))),
        6 => each(data, big, |b| f64::from(u32::from_le_bytes(b))),
        7 => each(data, big, |b| f64::from(f32::from_le_bytes(b))),
        9 => each(data, big, f64::from_le_bytes),
        12 => each(data, big, |b| i64::from_le_bytes(b) as f64),
        13 => each(data, big, |b| u64::from_le_bytes(b) as f64),
        _ => return None,
    })
}
