//! What is done with a record that has faults.
//!
//! | fault | `refuse` (default) | `skip` |
//! | --- | --- | --- |
//! | a cell that is empty, a word, NaN or infinite; a row of too few or too many cells | refused | the row is left out |
//! | a value larger than a drive has (200 A, 2000 V, 5000 rad/s, 10 m) | refused | the row is left out; if more than 1 % of a column's rows are, refused: the unit is wrong |
//! | a time twice, or a step back in time | refused | the row is left out |
//! | more than one row in twenty left out | refused | refused |
//! | a gap of up to 5 rows, also one that rows left out make | bridged by straight lines | the same |
//! | a longer gap | the record has a segment before and one after it | the same |
//! | rows at another rate than declared; a gap after one row in fifty or more; angle and speed reference that differ by more than a factor of two; a missing column; a file cut off; a record of less than 2 s | refused | refused |
//!
//! The part that is left out, bridged and cut is counted in `report.json` and said on the page.

use super::LoadError;
use super::data_quality::DataQuality;
use super::mapping::Clock;
use crate::signal::quantile::quantile;
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

/// Shortest record, s: two turns of a motor at 60 rpm, the fewest that distinguish an order from a drift.
const SHORTEST_S: f64 = 2.0;
/// Shortest segment, s: ten periods of what a drive's current loop leaves at 100 Hz.
const SHORTEST_SEGMENT_S: f64 = 0.1;
/// Rows that are bridged at most: at the usual 1 to 4 kHz still less than a period of what is looked for.
const BRIDGED: usize = 5;
/// Share of a column's rows that may be too large before the unit is taken to be wrong.
const STRAY: f64 = 0.01;
/// Share of all rows that may be left out.
const SKIPPED: f64 = 0.05;
/// Share of all rows that a gap may follow: with more the time is not what it says.
const GAPS: f64 = 0.02;
/// Share of the steps of time that may be off an even clock.
const UNEVEN: f64 = 0.05;
/// By how much of an interval a step of an even clock may be off: a time that is rounded to half an interval.
const OFF: f64 = 0.55;

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
    pub(super) rate: Option<f64>,
    pub(super) clock: Option<Clock>,
    /// Whether the first column is time; else rows are an interval apart.
    pub(super) timed: bool,
    /// Rows of the file, where not all of them count.
    pub(super) rows: Option<Vec<usize>>,
}

/// Rows on an even grid.
pub(super) struct Grid {
    pub(super) rate: f64,
    pub(super) time: Vec<f64>,
    /// As the raw columns, without time.
    pub(super) columns: Vec<Vec<f64>>,
    /// Stretches without a gap.
    pub(super) segments: Vec<Range<usize>>,
    /// Whether a row was measured.
    pub(super) measured: Vec<bool>,
}

/// The even clock that the rows follow.
struct Pace {
    rate: f64,
    clock: Clock,
}

/// Applies the rules.
pub(super) fn sift(
    columns: Vec<Raw>,
    timing: &Timing,
    on_fault: OnFault,
    quality: &mut DataQuality,
) -> Result<Grid, LoadError> {
    let origin = quality.file.clone();
    let rows = columns.first().map_or(0, |column| column.values.len());
    lengths(&columns, &origin, rows)?;
    units(&columns, rows, &origin)?;
    let pace = pace(&columns, timing, quality)?;
    let interval = 1.0 / pace.rate;
    quality.rows = rows;
    let kept = sound(&columns, timing, &pace, on_fault, quality)?;
    too_many(quality, rows)?;
    let ticks = ticks(&kept, |row| timing.of(&columns, row, interval), &pace);
    let shortest = (SHORTEST_SEGMENT_S * pace.rate) as usize;
    let all = pieces(&ticks);
    if all.len() > 1 && all.len() as f64 > GAPS * rows as f64 {
        return Err(LoadError::Gaps {
            origin,
            gaps: all.len() - 1,
            rows,
            interval,
        });
    }
    let pieces: Vec<_> = all.into_iter().filter(|p| p.len() >= shortest).collect();
    quality.cut = kept.len() - pieces.iter().map(ExactSizeIterator::len).sum::<usize>();
    quality.segments = pieces.len();
    let whole = pieces.len() == 1
        && pace.clock == Clock::Even
        && kept.len() == rows
        && ticks.last().is_some_and(|last| *last as usize == rows - 1);
    let grid = match whole {
        true => Grid::whole(columns, timing, pace.rate),
        false => {
            let mut grid = Grid::empty(pace.rate, columns.len() - usize::from(timing.timed));
            for piece in pieces {
                let start = timing.of(&columns, kept[piece.start], interval);
                grid.append(
                    &columns[usize::from(timing.timed)..],
                    &kept[piece.clone()],
                    &ticks[piece],
                    start,
                    &pace,
                );
            }
            grid
        }
    };
    quality.used = grid.time.len();
    quality.bridged = grid.measured.iter().filter(|measured| !**measured).count();
    if quality.used as f64 * interval < SHORTEST_S {
        let seconds = kept.len() as f64 * interval;
        return Err(LoadError::Short {
            origin,
            seconds,
            least: SHORTEST_S,
        });
    }
    Ok(grid)
}

impl Timing {
    /// Time of a row, s; of rows without time by the interval between them.
    fn of(&self, columns: &[Raw], row: usize, interval: f64) -> f64 {
        match self.timed {
            true => columns[0].values[row],
            false => self.rows.as_ref().map_or(row, |rows| rows[row]) as f64 * interval,
        }
    }
}

/// The rows without a fault; the others are refused, or counted.
fn sound(
    columns: &[Raw],
    timing: &Timing,
    pace: &Pace,
    on_fault: OnFault,
    quality: &mut DataQuality,
) -> Result<Vec<usize>, LoadError> {
    let interval = 1.0 / pace.rate;
    let time = |row: usize| timing.of(columns, row, interval);
    let mut kept: Vec<usize> = Vec::with_capacity(quality.rows);
    for row in 0..quality.rows {
        let step = kept.last().map(|&before| time(row) - time(before));
        let Some(fault) = fault(columns, row, step, pace) else {
            kept.push(row);
            continue;
        };
        if on_fault == OnFault::Refuse {
            return Err(fault.refusal(columns, row, &quality.file, interval));
        }
        match fault {
            Fault::NoNumber(k) => quality.skip("no number", row + 1, columns[k].name),
            Fault::TooLarge(k) => quality.skip("too large", row + 1, columns[k].name),
            Fault::Back(_) => quality.skip("time twice or back", row + 1, columns[0].name),
        }
    }
    Ok(kept)
}

/// Refuses a record of which too many rows were left out.
fn too_many(quality: &DataQuality, rows: usize) -> Result<(), LoadError> {
    let skipped: usize = quality.skipped.iter().map(|s| s.rows).sum();
    if skipped as f64 <= SKIPPED * rows as f64 {
        return Ok(());
    }
    let first = quality.skipped.iter().map(|s| s.first_row).min();
    Err(LoadError::TooMany {
        origin: quality.file.clone(),
        skipped,
        rows,
        row: first.unwrap_or(1),
    })
}

/// What is wrong with a row: in which column, or by which step of time.
enum Fault {
    NoNumber(usize),
    TooLarge(usize),
    Back(f64),
}

/// The first fault of a row, `step` after the last sound one.
fn fault(columns: &[Raw], row: usize, step: Option<f64>, pace: &Pace) -> Option<Fault> {
    let find = |bad: &dyn Fn(&Raw) -> bool| columns.iter().position(bad);
    if let Some(k) = find(&|c| !c.values[row].is_finite()) {
        return Some(Fault::NoNumber(k));
    }
    if let Some(k) = find(&|c| c.values[row].abs() > c.most) {
        return Some(Fault::TooLarge(k));
    }
    let least = match pace.clock {
        // A time may be rounded by half an interval.
        Clock::Even => 0.25 / pace.rate,
        Clock::Jitters => 0.0,
    };
    step.filter(|step| *step <= least).map(Fault::Back)
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

/// The rate, which must be the declared one where there is one, and whether the clock is even.
fn pace(columns: &[Raw], timing: &Timing, quality: &mut DataQuality) -> Result<Pace, LoadError> {
    let unknown = || {
        LoadError::Mapping {
        origin: quality.file.clone(),
        reason: "how fast it was sampled is not known; give sample_hz in the mapping file, or name the column of time t_s"
            .into(),
    }
    };
    if !timing.timed {
        let rate = timing.rate.ok_or_else(unknown)?;
        return Ok(Pace {
            rate,
            clock: Clock::Even,
        });
    }
    let steps: Vec<f64> = columns[0]
        .values
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .filter(|step| step.is_finite() && *step > 0.0)
        .collect();
    let step = quantile(steps.iter().copied(), 0.5);
    if let (Some(declared), Some(step)) = (timing.rate, step)
        && (step * declared - 1.0).abs() > 0.05
        // Times that are rounded have a median step of their own.
        && (mean_step(&steps, step) * declared - 1.0).abs() > 0.05
    {
        return Err(LoadError::Rate {
            origin: quality.file.clone(),
            step,
            expected: 1.0 / declared,
        });
    }
    let rate = match (timing.rate, step) {
        (Some(declared), _) => declared,
        (None, Some(step)) => {
            let rate = 1.0 / mean_step(&steps, step);
            quality.notes.push(format!(
                "its rate is taken from its times: {rate:.6} rows a second"
            ));
            rate
        }
        (None, None) => return Err(unknown()),
    };
    // A declared rate is that of an even clock, whose times may be rounded.
    let declared = timing.clock.or(timing.rate.map(|_| Clock::Even));
    let clock = declared.unwrap_or_else(|| {
        let off = |step: &&f64| {
            let periods = *step * rate;
            periods < BRIDGED as f64 && (periods - periods.round().max(1.0)).abs() > OFF
                || periods < 1.0 - OFF
        };
        let uneven = steps.iter().filter(off).count() as f64 > UNEVEN * steps.len() as f64
            || spread(&steps, rate) > 0.2;
        if uneven {
            quality.notes.push(
                "its times are uneven: straight lines between its rows bring it onto an even grid"
                    .into(),
            );
        }
        if uneven { Clock::Jitters } else { Clock::Even }
    });
    Ok(Pace { rate, clock })
}

/// Mean of the steps that are no gaps.
fn mean_step(steps: &[f64], median: f64) -> f64 {
    let (sum, count) = steps
        .iter()
        .filter(|step| **step < 1.75 * median)
        .fold((0.0, 0.0), |(sum, count), step| (sum + step, count + 1.0));
    if count > 0.0 { sum / count } else { median }
}

/// Rms of what steps that are no gaps are off by, in intervals.
fn spread(steps: &[f64], rate: f64) -> f64 {
    let (sum, count) = steps
        .iter()
        .map(|step| step * rate)
        .filter(|periods| *periods < 1.75)
        .fold((0.0, 0.0), |(sum, count), periods| {
            (sum + (periods - 1.0) * (periods - 1.0), count + 1.0)
        });
    (sum / f64::max(count, 1.0)).sqrt()
}

/// Places of the rows on the even grid, in intervals. Where the clock is even a row's time only says how many rows are
/// missing before it: it may be rounded by up to half an interval, or drift.
fn ticks(kept: &[usize], time: impl Fn(usize) -> f64, pace: &Pace) -> Vec<f64> {
    let mut at = 0.0;
    let mut before = None;
    kept.iter()
        .map(|&row| {
            let now = time(row) * pace.rate;
            let step = before.replace(now).map_or(0.0, |before| now - before);
            at += match pace.clock {
                Clock::Jitters => step,
                Clock::Even if step == 0.0 => 0.0,
                Clock::Even => (step - 0.25).round().max(1.0),
            };
            at
        })
        .collect()
}

/// The pieces between gaps that are too long to be bridged.
fn pieces(ticks: &[f64]) -> Vec<Range<usize>> {
    let mut pieces = Vec::new();
    let mut from = 0;
    for to in 1..=ticks.len() {
        if to == ticks.len() || ticks[to] - ticks[to - 1] > BRIDGED as f64 + 1.5 {
            pieces.push(from..to);
            from = to;
        }
    }
    pieces
}

impl Grid {
    /// Takes the columns as they are: no row is missing.
    fn whole(columns: Vec<Raw>, timing: &Timing, rate: f64) -> Self {
        let interval = 1.0 / rate;
        let rows = columns[0].values.len();
        let start = timing.of(&columns, 0, interval);
        let columns = columns.into_iter().skip(usize::from(timing.timed));
        Grid {
            rate,
            time: (0..rows).map(|k| start + k as f64 * interval).collect(),
            columns: columns.map(|column| column.values).collect(),
            segments: std::iter::once(0..rows).collect(),
            measured: vec![true; rows],
        }
    }

    /// A grid with so many columns and no rows.
    fn empty(rate: f64, columns: usize) -> Self {
        Grid {
            rate,
            time: Vec::new(),
            columns: vec![Vec::new(); columns],
            segments: Vec::new(),
            measured: Vec::new(),
        }
    }

    /// Adds the rows of a piece on the even grid from `start` on, straight lines between them.
    fn append(&mut self, columns: &[Raw], piece: &[usize], ticks: &[f64], start: f64, pace: &Pace) {
        let (Some(first), Some(last)) = (ticks.first(), ticks.last()) else {
            return;
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
        let from = self.time.len();
        self.segments.push(from..from + count);
        self.time
            .extend((0..count).map(|tick| start + tick as f64 / pace.rate));
        let bridged = |share: f64| pace.clock == Clock::Even && share > 1e-6 && share < 1.0 - 1e-6;
        self.measured
            .extend(place.iter().map(|(_, _, share)| !bridged(*share)));
        for (values, column) in self.columns.iter_mut().zip(columns) {
            values.extend(place.iter().map(|(a, b, share)| {
                column.values[*a] + share * (column.values[*b] - column.values[*a])
            }));
        }
    }
}
