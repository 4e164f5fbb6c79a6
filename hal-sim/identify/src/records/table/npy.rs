//! NumPy's `.npy` (versions 1 to 3, numbers and structured types) and `.npz`.
//!
//! The header is a Python literal; it is read by hand, as the reader of a general literal may overflow its stack on a
//! damaged file. Format: numpy.lib.format, NEP 1.

use super::{Column, LoadError, MOST_COLUMNS, MOST_UNPACKED, Table, damaged, matrix};
use std::io::{Cursor, Read};

const FORMAT: &str = "NumPy";

/// A number's type: `<f8`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Scalar {
    big: bool,
    kind: u8,
    bytes: usize,
}

/// A field of a row: its name (empty for a plain type), type, count.
struct Field {
    name: String,
    scalar: Scalar,
    count: usize,
}

struct Header {
    fields: Vec<Field>,
    fortran: bool,
    shape: Vec<usize>,
}

pub(super) fn read(bytes: &[u8], origin: &str) -> Result<Table, LoadError> {
    let mut table = Table::default();
    append(&mut table, bytes, "", origin)?;
    Ok(table)
}

pub(super) fn read_zip(bytes: &[u8], origin: &str) -> Result<Table, LoadError> {
    let fault = |reason: String| damaged(origin, FORMAT, reason);
    let mut archive =
        zip::ZipArchive::new(Cursor::new(bytes)).map_err(|error| fault(error.to_string()))?;
    let mut table = Table::default();
    let mut left = MOST_UNPACKED;
    for index in 0..archive.len().min(MOST_COLUMNS) {
        let mut member = archive
            .by_index(index)
            .map_err(|error| fault(error.to_string()))?;
        let name = member
            .name()
            .map_err(|error| fault(error.to_string()))?
            .into_owned();
        let Some(path) = name.strip_suffix(".npy") else {
            table
                .notes
                .push(format!("`{name}` in it is no .npy, left out"));
            continue;
        };
        let mut unpacked = Vec::new();
        (&mut member)
            .take(left)
            .read_to_end(&mut unpacked)
            .map_err(|error| fault(format!("{name}: {error}")))?;
        left = left.saturating_sub(unpacked.len() as u64);
        append(&mut table, &unpacked, path, origin)?;
    }
    Ok(table)
}

/// Adds the columns of one array.
fn append(table: &mut Table, bytes: &[u8], path: &str, origin: &str) -> Result<(), LoadError> {
    let fault = |reason: &str| damaged(origin, FORMAT, reason);
    let (header, data) = split(bytes).ok_or_else(|| fault("its header is cut off"))?;
    let header = parse(header).map_err(|reason| fault(&reason))?;
    let size: usize = header
        .fields
        .iter()
        .map(|field| field.scalar.bytes * field.count)
        .sum();
    let count = header
        .shape
        .iter()
        .try_fold(1usize, |product, n| product.checked_mul(*n))
        .filter(|count| {
            count
                .checked_mul(size)
                .is_some_and(|bytes| bytes <= data.len())
        })
        .ok_or_else(|| {
            fault(&format!(
                "it declares {:?} values of {size} bytes, but has {} bytes: it is cut off or damaged",
                header.shape,
                data.len()
            ))
        })?;
    if header.fields.len() + table.columns.len() > MOST_COLUMNS {
        return Err(fault("it has too many fields"));
    }
    let mut at = 0;
    for field in &header.fields {
        let join = |name: &str| match (path, name) {
            ("", name) => name.to_owned(),
            (path, "") => path.to_owned(),
            (path, name) => format!("{path}.{name}"),
        };
        for element in 0..field.count {
            let start = at + element * field.scalar.bytes;
            let values: Vec<f64> = (0..count)
                .map(|row| field.scalar.value(&data[row * size + start..]))
                .collect();
            let name = match field.count {
                1 => join(&field.name),
                _ => join(&format!("{}.{element}", field.name)),
            };
            add(table, &name, values, &header, origin)?;
        }
        at += field.scalar.bytes * field.count;
    }
    Ok(())
}

/// Adds one array of numbers by its shape.
fn add(
    table: &mut Table,
    path: &str,
    values: Vec<f64>,
    header: &Header,
    origin: &str,
) -> Result<(), LoadError> {
    match header.shape[..] {
        [] | [_] => table.columns.push(Column {
            path: if path.is_empty() { "0" } else { path }.to_owned(),
            unit: None,
            values,
        }),
        // C order runs along a row first: the matrix as it is laid out is the transposed one.
        [rows, columns] => {
            let (sides, transposed) = match header.fortran {
                true => ([rows, columns], values),
                false if rows > 1 && columns > 1 => {
                    let columnwise = (0..columns)
                        .flat_map(|c| values.iter().skip(c).step_by(columns).copied())
                        .collect();
                    ([rows, columns], columnwise)
                }
                false => ([rows, columns], values),
            };
            let found = matrix(path, sides, &transposed, &mut table.notes);
            table.columns.extend(found);
        }
        _ => {
            return Err(damaged(
                origin,
                FORMAT,
                format!(
                    "`{path}` has {} dimensions, expected one or two",
                    header.shape.len()
                ),
            ));
        }
    }
    Ok(())
}

/// Header text and data.
fn split(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let (magic, rest) = bytes.split_at_checked(8)?;
    let long = magic[6] > 1;
    let (length, rest) = rest.split_at_checked(if long { 4 } else { 2 })?;
    let length = match *length {
        [a, b, c, d] => u32::from_le_bytes([a, b, c, d]) as usize,
        [a, b] => u16::from_le_bytes([a, b]).into(),
        _ => return None,
    };
    let (header, data) = rest.split_at_checked(length)?;
    Some((std::str::from_utf8(header).ok()?, data))
}

/// What stands behind a key of the header.
fn behind<'a>(text: &'a str, key: &str) -> Result<&'a str, String> {
    ["'", "\""]
        .iter()
        .find_map(|quote| text.split_once(&format!("{quote}{key}{quote}")))
        .and_then(|(_, rest)| rest.split_once(':'))
        .map(|(_, rest)| rest.trim_start())
        .ok_or_else(|| format!("its header has no `{key}`"))
}

fn parse(text: &str) -> Result<Header, String> {
    let shape = behind(text, "shape")?;
    let shape = shape
        .strip_prefix('(')
        .and_then(|rest| rest.split_once(')'))
        .ok_or("its header's shape is no tuple")?
        .0
        .split(',')
        .map(str::trim)
        .filter(|number| !number.is_empty())
        .map(|number| {
            number
                .trim_end_matches('L')
                .parse::<usize>()
                .map_err(|_| format!("its header's shape has `{number}`"))
        })
        .collect::<Result<Vec<_>, _>>()?;
    let fortran = behind(text, "fortran_order")?.starts_with("True");
    let descr = behind(text, "descr")?;
    let fields = match descr.strip_prefix('[') {
        Some(list) => structured(list)?,
        None => {
            let quote = descr.chars().next().filter(|c| matches!(c, '\'' | '"'));
            let code = quote.and_then(|quote| descr[1..].split_once(quote));
            vec![Field {
                name: String::new(),
                scalar: scalar(code.ok_or("its header's descr is not understood")?.0)?,
                count: 1,
            }]
        }
    };
    Ok(Header {
        fields,
        fortran,
        shape,
    })
}

/// The fields of a structured type: `('t', '<f8'), ('iq', '<f4', (3,))`, up to the closing bracket.
fn structured(list: &str) -> Result<Vec<Field>, String> {
    let mut fields = Vec::new();
    let mut rest = list;
    loop {
        rest = rest.trim_start_matches([' ', ',']);
        if rest.starts_with(']') {
            return Ok(fields);
        }
        let body = rest
            .strip_prefix('(')
            .ok_or("its header's list of fields is not understood")?;
        let (name, after) = quoted(body)?;
        let (code, after) = quoted(after.trim_start_matches([' ', ',']))?;
        let after = after.trim_start_matches([' ', ',']);
        let (count, after) = match after.strip_prefix('(') {
            Some(inner) => {
                let (count, after) = inner
                    .split_once(')')
                    .ok_or("its header's list of fields is not understood")?;
                let count = count.trim_end_matches([' ', ',']);
                let count = count
                    .parse::<usize>()
                    .ok()
                    .filter(|n| (1..=64).contains(n))
                    .ok_or_else(|| format!("the field `{name}` has the shape ({count})"))?;
                (count, after)
            }
            None => (1, after),
        };
        rest = after
            .trim_start()
            .strip_prefix(')')
            .ok_or("its header's list of fields is not understood")?;
        fields.push(Field {
            scalar: scalar(code)?,
            name: name.to_owned(),
            count,
        });
        if fields.len() > MOST_COLUMNS {
            return Err("it has too many fields".into());
        }
    }
}

fn quoted(text: &str) -> Result<(&str, &str), String> {
    let quote = text.chars().next().filter(|c| matches!(c, '\'' | '"'));
    quote
        .and_then(|quote| text[1..].split_once(quote))
        .ok_or_else(|| "its header's list of fields is not understood".to_owned())
}

fn scalar(code: &str) -> Result<Scalar, String> {
    let (big, rest) = match code.as_bytes() {
        [b'>', rest @ ..] => (true, rest),
        [b'<' | b'|' | b'=', rest @ ..] => (false, rest),
        rest => (false, rest),
    };
    let known = match rest {
        [b'?'] | [b'b', b'1'] => Some((b'u', 1)),
        [kind @ b'f', b'8'] | [kind @ (b'i' | b'u'), b'8'] => Some((*kind, 8)),
        [kind @ (b'f' | b'i' | b'u'), b'4'] => Some((*kind, 4)),
        [kind @ (b'f' | b'i' | b'u'), b'2'] => Some((*kind, 2)),
        [kind @ (b'i' | b'u'), b'1'] => Some((*kind, 1)),
        _ => None,
    };
    known
        .map(|(kind, bytes)| Scalar { big, kind, bytes })
        .ok_or_else(|| {
            format!("its values are of the type `{code}`, expected numbers (f2 to f8, i1 to i8, u1 to u8, bool)")
        })
}

impl Scalar {
    /// The value at the start of `data`, which is long enough.
    fn value(self, data: &[u8]) -> f64 {
        let mut raw = [0; 8];
        let own = &data[..self.bytes];
        match self.big {
            true => own.iter().rev().zip(&mut raw).for_each(|(a, b)| *b = *a),
            false => raw[..self.bytes].copy_from_slice(own),
        }
        let word = u64::from_le_bytes(raw);
        match (self.kind, self.bytes) {
            (b'f', 8) => f64::from_bits(word),
            (b'f', 4) => f64::from(f32::from_bits(word as u32)),
            (b'f', _) => half(word as u16),
            (b'i', 8) => word as i64 as f64,
            (b'i', 4) => f64::from(word as i32),
            (b'i', 2) => f64::from(word as i16),
            (b'i', _) => f64::from(word as i8),
            _ => word as f64,
        }
    }
}

/// IEEE 754 binary16.
fn half(bits: u16) -> f64 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff));
    sign * match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction / 1024.0) * 2f64.powi(exponent - 15),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn a_wide_matrix_has_its_channels_in_rows() {
        let values: Vec<u8> = (0..12).flat_map(|k| f64::from(k).to_le_bytes()).collect();
        let c = file(
            "{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }",
            &values,
        );
        let table = read(&c, "x").expect("a matrix");
        assert_eq!(table.columns.len(), 3);
        assert_eq!(table.columns[1].path, "1");
        assert_eq!(table.columns[1].values, [4.0, 5.0, 6.0, 7.0]);
        let fortran = file(
            "{'descr': '<f8', 'fortran_order': True, 'shape': (3, 4), }",
            &values,
        );
        let table = read(&fortran, "x").expect("a matrix");
        assert_eq!(table.columns[1].values, [1.0, 4.0, 7.0, 10.0]);
        let tall = file(
            "{'descr': '<f8', 'fortran_order': False, 'shape': (4, 3), }",
            &values,
        );
        let table = read(&tall, "x").expect("a matrix");
        assert_eq!(table.columns[1].values, [1.0, 4.0, 7.0, 10.0]);
    }

    #[test]
    fn fields_of_a_structured_type_are_columns() {
        let mut data = Vec::new();
        for k in 0..3 {
            data.extend(f64::from(k).to_le_bytes());
            data.extend((10.0 * k as f32).to_le_bytes());
            data.extend((-k as i16).to_be_bytes());
        }
        let header = "{'descr': [('t', '<f8'), ('iq', '<f4'), ('n', '>i2')], 'fortran_order': False, 'shape': (3,), }";
        let table = read(&file(header, &data), "x").expect("a structured array");
        let paths: Vec<_> = table.columns.iter().map(|c| c.path.as_str()).collect();
        assert_eq!(paths, ["t", "iq", "n"]);
        assert_eq!(table.columns[1].values, [0.0, 10.0, 20.0]);
        assert_eq!(table.columns[2].values, [0.0, -1.0, -2.0]);
    }

    #[test]
    fn halves_are_numbers() {
        assert_eq!(half(0x3c00), 1.0);
        assert_eq!(half(0xc000), -2.0);
        assert_eq!(half(0x0001), 2f64.powi(-24));
        assert!(half(0x7e00).is_nan());
    }

    #[test]
    fn a_file_cut_off_says_so() {
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (3, 99999999999999), }";
        let error = read(&file(header, &[0; 24]), "x").unwrap_err().to_string();
        assert!(error.contains("cut off"), "{error}");
    }
}
