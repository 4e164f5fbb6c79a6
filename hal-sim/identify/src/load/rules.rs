//! What is done with a record that has faults.
//!
//! | fault | `refuse` (default) | `skip` |
//! | --- | --- | --- |
//! | a cell that is empty, a word, NaN or infinite; a row of too few or too many cells | refused | the row is left out |
//! | a value larger than a feed drive has (200 A, 2000 V, 5000 rad/s, 10 m) | refused | the row is left out; if more than 1 % of a column's rows are, refused: the unit is wrong |
//! | a time twice, or a step back in time | refused | the row is left out |
//! | a gap, also one that rows left out make | refused | up to 5 rows are bridged by straight lines; at a longer one the record is cut and its longest piece is used |
//! | more than one row in twenty left out | refused | refused |
//! | rows at another rate than declared; angle and speed reference that differ by more than a factor of two; a missing column; a file cut off; a record of less than 2 s | refused | refused |
//!
//! What is left out, bridged and cut is counted in `report.json` and said on the page.

use super::LoadError;
use super::account::Account;
use super::mapping::Clock;

use std::ops::Range;

/// What is done with a fault that a rule can mend.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum OnFault {
    /// The record is refused, the fault told by row and column.
    #[default]
    Refuse,
    /// The row is left out and counted.
    Skip,
}

/// Shortest record, s.
const SHORTEST_S: f64 = 2.0;
/// Rows that are bridged at most.
const BRIDGED: usize = 5;
/// Share of a column's rows that may be too large before the unit is taken to be wrong.
const STRAY: f64 = 0.01;
/// Share of all rows that may be left out.
const SKIPPED: f64 = 0.05;

/// A column as it comes from a file, in our unit.
pub(super) struct Raw<'a> {
    pub(super) name: &'a str,
    pub(super) most: f64,
    pub(super) values: Vec<f64>,
    /// What stands in a row that holds no number.
    pub(super) text: Box<dyn Fn(usize) -> String + 'a>,
}

/// How rows follow each other.
pub(super) struct Timing {
    /// Declared rate, Hz.
    pub(super) rate: f64,
    pub(super) clock: Clock,
    /// Whether the first column is time; else rows are an interval apart.
    pub(super) timed: bool,
}

/// Applies the rules. The first column of what comes back is time, even.
pub(super) fn sift(
    columns: &[Raw],
    timing: &Timing,
    on_fault: OnFault,
    account: &mut Account,
) -> Result<Vec<Vec<f64>>, LoadError> {
    let origin = account.file.clone();
    let rows = columns.first().map_or(0, |column| column.values.len());
    let interval = 1.0 / timing.rate;
    lengths(columns, &origin, rows)?;
    units(columns, rows, &origin)?;
    if timing.timed {
        rate(&columns[0].values, interval, &origin)?;
    }
    account.rows = rows;
    let time = |row: usize| match timing.timed {
        true => columns[0].values[row],
        false => row as f64 * interval,
    };
    let mut kept: Vec<usize> = Vec::with_capacity(rows);
    for row in 0..rows {
        let step = kept.last().map(|&before| time(row) - time(before));
        let Some(fault) = fault(columns, row, step, timing) else {
            kept.push(row);
            continue;
        };
        if on_fault == OnFault::Refuse {
            return Err(fault.refusal(columns, row, &origin, interval));
        }
        match fault {
            // What is beyond a gap is sound.
            Fault::Gap(_) => kept.push(row),
            Fault::NoNumber(k) => account.skip("no number", row + 1, columns[k].name),
            Fault::TooLarge(k) => account.skip("too large", row + 1, columns[k].name),
            Fault::Back(_) => account.skip("time twice or back", row + 1, columns[0].name),
        }
    }
    let skipped: usize = account.skipped.iter().map(|s| s.rows).sum();
    if skipped as f64 > SKIPPED * rows as f64 {
        return Err(LoadError::TooMany {
            origin,
            skipped,
            rows,
            row: account
                .skipped
                .iter()
                .map(|s| s.first_row)
                .min()
                .unwrap_or(1),
        });
    }
    let ticks = ticks(&kept, time, timing);
    let piece = longest(&ticks);
    account.cut = kept.len() - piece.len();
    let start = kept.get(piece.start).map_or(0.0, |row| time(*row));
    let even = even(
        columns,
        &kept[piece.clone()],
        &ticks[piece.clone()],
        start,
        timing,
    );
    account.used = even[0].len();
    if timing.clock == Clock::Even {
        account.bridged = account.used.saturating_sub(piece.len());
    }
    let seconds = account.used as f64 * interval;
    if seconds < SHORTEST_S {
        return Err(LoadError::Short {
            origin,
            seconds,
            least: SHORTEST_S,
        });
    }
    Ok(even)
}

/// What is wrong with a row: in which column, or by which step of time.
enum Fault {
    NoNumber(usize),
    TooLarge(usize),
    Back(f64),
    Gap(f64),
}

/// The first fault of a row, `step` after the last sound one.
fn fault(columns: &[Raw], row: usize, step: Option<f64>, timing: &Timing) -> Option<Fault> {
    let find = |bad: &dyn Fn(&Raw) -> bool| columns.iter().position(bad);
    if let Some(k) = find(&|c| !c.values[row].is_finite()) {
        return Some(Fault::NoNumber(k));
    }
    if let Some(k) = find(&|c| c.values[row].abs() > c.most) {
        return Some(Fault::TooLarge(k));
    }
    let interval = 1.0 / timing.rate;
    let (least, most) = match timing.clock {
        // A time may be rounded by half an interval.
        Clock::Even => (0.25 * interval, 1.75 * interval),
        Clock::Jitters => (0.0, (BRIDGED as f64 + 1.5) * interval),
    };
    match step {
        Some(step) if step <= least => Some(Fault::Back(step)),
        Some(step) if step >= most => Some(Fault::Gap(step)),
        _ => None,
    }
}

impl Fault {
    /// Where and what, as a refusal says it.
    fn refusal(&self, columns: &[Raw], row: usize, origin: &str, interval: f64) -> LoadError {
        let origin = origin.to_owned();
        let name = |k: usize| columns[k].name.to_owned();
        let time = |what, step| LoadError::Time {
            origin: origin.clone(),
            row: row + 1,
            what,
            step,
            interval,
        };
        match *self {
            Fault::Back(step) if step < 0.0 => time("a step back", step),
            Fault::Back(step) => time("a row twice", step),
            Fault::Gap(step) => time("a gap", step),
            Fault::NoNumber(k) => LoadError::Cell {
                column: name(k),
                text: (columns[k].text)(row + 1),
                row: row + 1,
                origin,
            },
            Fault::TooLarge(k) => LoadError::Value {
                column: name(k),
                value: columns[k].values[row],
                most: columns[k].most,
                row: row + 1,
                origin,
            },
        }
    }
}

fn lengths(columns: &[Raw], origin: &str, rows: usize) -> Result<(), LoadError> {
    match columns.iter().find(|column| column.values.len() != rows) {
        Some(column) => Err(LoadError::Length {
            origin: origin.to_owned(),
            column: column.name.to_owned(),
            rows: column.values.len(),
            expected: rows,
        }),
        None => Ok(()),
    }
}

/// Refuses a column so often too large that it is its unit.
fn units(columns: &[Raw], rows: usize, origin: &str) -> Result<(), LoadError> {
    for column in columns {
        let beyond = |value: &f64| value.is_finite() && value.abs() > column.most;
        let count = column.values.iter().filter(|value| beyond(value)).count();
        if count as f64 > STRAY * rows as f64 {
            return Err(LoadError::Unit {
                origin: origin.to_owned(),
                column: column.name.to_owned(),
                count,
                row: 1 + column.values.iter().position(beyond).unwrap_or(0),
                most: column.most,
            });
        }
    }
    Ok(())
}

/// Refuses rows whose usual step is not the declared one.
fn rate(time: &[f64], interval: f64, origin: &str) -> Result<(), LoadError> {
    let mut steps: Vec<f64> = time
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .filter(|step| step.is_finite())
        .collect();
    if steps.is_empty() {
        return Ok(());
    }
    let middle = steps.len() / 2;
    let (_, step, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    if (*step / interval - 1.0).abs() > 0.05 {
        return Err(LoadError::Rate {
            origin: origin.to_owned(),
            step: *step,
            expected: interval,
        });
    }
    Ok(())
}

/// Places of the rows on the even grid, in intervals. Where the clock is even a row's time only says how many rows are
/// missing before it: it may be rounded by up to half an interval, or drift.
fn ticks(kept: &[usize], time: impl Fn(usize) -> f64, timing: &Timing) -> Vec<f64> {
    let mut at = 0.0;
    let mut before = None;
    kept.iter()
        .map(|&row| {
            let now = time(row) * timing.rate;
            let step = before.replace(now).map_or(0.0, |before| now - before);
            at += match timing.clock {
                Clock::Jitters => step,
                Clock::Even if step == 0.0 => 0.0,
                Clock::Even => (step - 0.25).round().max(1.0),
            };
            at
        })
        .collect()
}

/// The longest piece without a gap that is too long to be bridged.
fn longest(ticks: &[f64]) -> Range<usize> {
    let (mut best, mut from) = (0..0, 0);
    for to in 1..=ticks.len() {
        if to == ticks.len() || ticks[to] - ticks[to - 1] > BRIDGED as f64 + 1.5 {
            if to - from > best.len() {
                best = from..to;
            }
            from = to;
        }
    }
    best
}

/// The rows of a piece on the even grid, straight lines between them; time first, from `start` on.
fn even(
    columns: &[Raw],
    piece: &[usize],
    ticks: &[f64],
    start: f64,
    timing: &Timing,
) -> Vec<Vec<f64>> {
    let (Some(first), Some(last)) = (ticks.first(), ticks.last()) else {
        return vec![Vec::new(); columns.len() + usize::from(!timing.timed)];
    };
    let count = (last - first) as usize + 1;
    let mut k = 0;
    let place: Vec<(usize, usize, f64)> = (0..count)
        .map(|tick| {
            let wanted = first + tick as f64;
            while k + 2 < piece.len() && ticks[k + 1] <= wanted {
                k += 1;
            }
            let next = (k + 1).min(piece.len() - 1);
            let span = (ticks[next] - ticks[k]).max(1e-9);
            let share = ((wanted - ticks[k]) / span).clamp(0.0, 1.0);
            (piece[k], piece[next], share)
        })
        .collect();
    let timed = usize::from(timing.timed);
    let grid = (0..count)
        .map(|tick| start + tick as f64 / timing.rate)
        .collect();
    std::iter::once(grid)
        .chain(columns[timed..].iter().map(|column| {
            let value = |(a, b, share): &(usize, usize, f64)| {
                column.values[*a] + share * (column.values[*b] - column.values[*a])
            };
            place.iter().map(value).collect()
        }))
        .collect()
}
