//! Set-points as lines of text: columns time_s and position_mm, and velocity_mm_s if it is there.

use anyhow::{Context, Result, ensure};
use control::stream::SPACING_US;
use link::scale;
use std::io::BufRead;

/// Largest time, s: a year.
const LONGEST_S: f64 = 3.2e7;
/// Furthest position, mm.
const FURTHEST_MM: f64 = 1e6;

/// A set-point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Time from the first row, us.
    pub us: i64,
    /// Position, mm.
    pub position_mm: f64,
    /// Velocity, 2^-28 m/s.
    pub velocity: Option<i32>,
}

/// Reads rows.
pub struct Rows<R> {
    lines: std::iter::Enumerate<std::io::Lines<R>>,
    /// Places of time, position and velocity.
    places: [Option<usize>; 3],
    begun_s: Option<f64>,
    last_us: Option<i64>,
}

impl<R: BufRead> Rows<R> {
    /// Of text that begins with the names of its columns.
    ///
    /// # Errors
    /// The text cannot be read, or a column is missing.
    pub fn new(text: R) -> Result<Self> {
        let mut lines = text.lines().enumerate();
        let header = match lines.next() {
            Some((_, header)) => header.context("the set-points cannot be read")?,
            None => String::new(),
        };
        let place = |name: &str| header.split(',').position(|column| column.trim() == name);
        for name in ["time_s", "position_mm"] {
            ensure!(
                place(name).is_some(),
                "the first line is `{header}`, but the names of the columns are needed: time_s,position_mm, and velocity_mm_s if \
                 it is known"
            );
        }
        Ok(Self {
            lines,
            places: ["time_s", "position_mm", "velocity_mm_s"].map(place),
            begun_s: None,
            last_us: None,
        })
    }

    fn row(&mut self, number: usize, line: &str) -> Result<Row> {
        let value = |place: Option<usize>, name: &str, most: f64| -> Result<Option<f64>> {
            let Some(place) = place else { return Ok(None) };
            let text = line.split(',').nth(place).unwrap_or_default().trim();
            let value = text.parse::<f64>().ok();
            let value = value.filter(|value| value.abs() <= most);
            let value = value.with_context(|| {
                format!(
                    "line {number}: {name} is `{text}`, but a number of -{most} to {most} is needed"
                )
            })?;
            Ok(Some(value))
        };
        let [time, position, velocity] = self.places;
        let seconds = value(time, "time_s", LONGEST_S)?.unwrap_or_default();
        let position_mm = value(position, "position_mm", FURTHEST_MM)?.unwrap_or_default();
        let mm_s = value(velocity, "velocity_mm_s", 7999.0)?;
        let begun_s = *self.begun_s.get_or_insert(seconds);
        #[allow(clippy::cast_possible_truncation)]
        let us = ((seconds - begun_s) * 1e6).round() as i64;
        if let Some(last_us) = self.last_us.replace(us) {
            let [least, most] = SPACING_US.map(i64::from);
            ensure!(
                (least..=most).contains(&(us - last_us)),
                "line {number}: time_s is {seconds}, {} ms behind the line before, but {} to {} ms are possible",
                (us - last_us) as f64 / 1e3,
                least / 1000,
                most / 1000
            );
        }
        Ok(Row {
            us,
            position_mm,
            velocity: mm_s.and_then(|mm_s| scale::word(mm_s * 1e-3, scale::TABLE_VELOCITY)),
        })
    }
}

impl<R: BufRead> Iterator for Rows<R> {
    type Item = Result<Row>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let (place, line) = self.lines.next()?;
            let line = match line.context("the set-points cannot be read") {
                Ok(line) => line,
                Err(error) => return Some(Err(error)),
            };
            if !line.trim().is_empty() {
                return Some(self.row(place + 1, &line));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<Row>> {
        Rows::new(text.as_bytes())?.collect()
    }

    #[test]
    fn columns_stand_in_any_order_and_times_count_from_the_first() {
        let rows = read("position_mm, time_s\n1.5, 2\n\n-2,2.005\r\n").unwrap();
        let row = |us, position_mm| Row {
            us,
            position_mm,
            velocity: None,
        };
        assert_eq!(rows, [row(0, 1.5), row(5000, -2.0)]);
        let rows = read("time_s,position_mm,velocity_mm_s\n0,0,1000\n").unwrap();
        assert_eq!(rows[0].velocity, Some(1 << 28));
    }

    #[test]
    fn what_is_no_row_is_named_with_its_line() {
        for (text, expected) in [
            ("", "the first line is ``"),
            ("time,position\n1,2\n", "the first line is `time,position`"),
            ("time_s,position_mm\n0,0\n1\n", "line 3: position_mm is ``"),
            ("time_s,position_mm\nx,0\n", "line 2: time_s is `x`"),
            (
                "time_s,position_mm\n0,nan\n",
                "line 2: position_mm is `nan`",
            ),
            (
                "time_s,position_mm\n0,0\n0,0\n",
                "line 3: time_s is 0, 0 ms behind the line before, but 1 to 50 ms",
            ),
            (
                "time_s,position_mm\n0,1e300\n",
                "line 2: position_mm is `1e300`",
            ),
        ] {
            let said = read(text).unwrap_err().to_string();
            assert!(said.contains(expected), "{said}");
        }
    }
}
