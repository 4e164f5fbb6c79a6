//! What columns show by themselves: one twice, held, cut off, frozen.

use super::{Finding, Limits};
use std::collections::HashMap;

/// A channel with what it is.
pub(super) struct Seen<'a> {
    pub(super) name: &'a str,
    pub(super) values: &'a [f64],
    /// Whether a sensor measures it; a reference or a command may be held, cut off, or equal another.
    pub(super) measured: bool,
}

/// Values that differ, at most so many.
fn distinct(values: &[f64], most: usize) -> usize {
    let mut seen = std::collections::HashSet::new();
    for value in values {
        seen.insert(value.to_bits());
        if seen.len() >= most {
            break;
        }
    }
    seen.len()
}

/// Two channels that hold the same, as they stand or times a factor.
pub(super) fn twice(channels: &[Seen], limits: &Limits, found: &mut Vec<Finding>) {
    let telling: Vec<&Seen> = channels
        .iter()
        .filter(|c| c.measured && distinct(c.values, limits.distinct) >= limits.distinct)
        .collect();
    for (k, a) in telling.iter().enumerate() {
        for b in &telling[k + 1..] {
            let Some(factor) = multiple(a.values, b.values) else {
                continue;
            };
            let how = match factor {
                1.0 => "hold the same values in every row".to_owned(),
                f => format!("are the same column times {f:.6}"),
            };
            found.push(Finding::new(
                "column_twice",
                &[a.name, b.name],
                [1.0, 1.0],
                format!(
                    "`{}` and `{}` {how}, expected two measurements; map each to a column of its own",
                    a.name, b.name
                ),
            ));
        }
    }
}

/// The factor of which one column is a multiple of another.
fn multiple(a: &[f64], b: &[f64]) -> Option<f64> {
    let at = (0..a.len()).max_by(|x, y| a[*x].abs().total_cmp(&a[*y].abs()))?;
    let factor = b[at] / a[at];
    let same = factor.is_finite()
        && factor != 0.0
        && a.iter().zip(b).all(|(a, b)| {
            let expected = a * factor;
            (expected - b).abs() <= 1e-12 * expected.abs().max(b.abs())
        });
    same.then_some(if (factor - 1.0).abs() < 1e-12 {
        1.0
    } else {
        factor
    })
}

/// A measurement that changes only every so many rows: it was recorded slower and held.
pub(super) fn held(channels: &[Seen], limits: &Limits, found: &mut Vec<Finding>) {
    for channel in channels.iter().filter(|c| c.measured) {
        let changes: Vec<usize> = (1..channel.values.len())
            .filter(|k| channel.values[*k] != channel.values[k - 1])
            .collect();
        if changes.len() < limits.held_changes {
            continue;
        }
        // Of a held column no two changes are neighbours.
        let neighbours = changes
            .windows(2)
            .filter(|pair| pair[1] == pair[0] + 1)
            .count();
        if neighbours as f64 > (1.0 - limits.held_share) * changes.len() as f64 {
            continue;
        }
        let share = |every: usize| {
            let mut counts = vec![0usize; every];
            changes.iter().for_each(|k| counts[k % every] += 1);
            *counts.iter().max().unwrap_or(&0) as f64 / changes.len() as f64
        };
        let fits = (2..=64)
            .rev()
            .find(|every| share(*every) >= limits.held_share);
        if let Some(every) = fits {
            found.push(Finding::new(
                "held",
                &[channel.name],
                [share(every), limits.held_share],
                format!(
                    "`{}` changes only every {every} rows ({:.1} % of its changes), expected a value of its own in each row; \
                     record it at the rate of the others, or take every {every}th row of all",
                    channel.name,
                    100.0 * share(every)
                ),
            ));
        }
    }
}

/// A measurement that is cut off at its extreme.
pub(super) fn clipped(channels: &[Seen], limits: &Limits, found: &mut Vec<Finding>) {
    for channel in channels
        .iter()
        .filter(|c| c.measured && c.name.ends_with("_a"))
    {
        let values = channel.values;
        let (low, high) = values
            .iter()
            .fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
        let range = high - low;
        if range.is_nan() || range <= 0.0 || distinct(values, limits.distinct) < limits.distinct {
            continue;
        }
        let rail = |extreme: f64| {
            let at = values.iter().filter(|v| **v == extreme).count();
            let near = values
                .iter()
                .filter(|v| **v != extreme && (**v - extreme).abs() < 0.02 * range)
                .count();
            let longest = longest_run(values, |v| v == extreme);
            (at, near, longest)
        };
        for extreme in [high, low] {
            let (at, near, longest) = rail(extreme);
            let share = at as f64 / values.len() as f64;
            if share >= limits.clipped_share
                && longest >= 5
                && at as f64 >= limits.clipped_ratio * near.max(1) as f64
            {
                found.push(Finding::new(
                    "clipped",
                    &[channel.name],
                    [share, limits.clipped_share],
                    format!(
                        "`{}` stands at its extreme {extreme:.4} A in {:.1} % of the rows, up to {longest} rows on end, \
                         expected a peak; the sensor's range or the recorder's is too small: record within it",
                        channel.name,
                        100.0 * share
                    ),
                ));
                break;
            }
        }
    }
}

fn longest_run(values: &[f64], is: impl Fn(f64) -> bool) -> usize {
    let (mut longest, mut now) = (0, 0);
    for value in values {
        now = if is(*value) { now + 1 } else { 0 };
        longest = longest.max(now);
    }
    longest
}

/// Stretches in which a channel holds one value, of at least so many rows: from, to.
pub(super) fn standing(values: &[f64], least: usize) -> Vec<(usize, usize)> {
    let mut stretches = Vec::new();
    let mut from = 0;
    for to in 1..=values.len() {
        if to == values.len() || values[to] != values[from] {
            if to - from >= least.max(2) {
                stretches.push((from, to));
            }
            from = to;
        }
    }
    stretches
}

/// Rows of one record that stand in another: where in both, and how many.
pub(super) fn same_rows(
    a: &[&[f64]],
    b: &[&[f64]],
    limits: &Limits,
) -> Option<(usize, usize, usize)> {
    let key = |columns: &[&[f64]], row: usize| {
        columns
            .iter()
            .fold(0xcbf2_9ce4_8422_2325_u64, |hash, column| {
                (hash ^ column[row].to_bits())
                    .wrapping_mul(0x0000_0100_0000_01b3)
                    .rotate_left(23)
            })
    };
    let (rows_a, rows_b) = (a.first()?.len(), b.first()?.len());
    let keys: Vec<u64> = (0..rows_a).map(|row| key(a, row)).collect();
    let mut places: HashMap<u64, usize> = HashMap::with_capacity(rows_a);
    keys.iter().enumerate().for_each(|(row, key)| {
        places.insert(*key, row);
    });
    let mut best: Option<(usize, usize, usize)> = None;
    let mut row = 0;
    while row < rows_b {
        let Some(&first) = places.get(&key(b, row)) else {
            row += 1;
            continue;
        };
        let mut length = 1;
        while first + length < rows_a
            && row + length < rows_b
            && keys[first + length] == key(b, row + length)
        {
            length += 1;
        }
        let telling = || {
            let seen: std::collections::HashSet<&u64> =
                keys[first..first + length].iter().collect();
            seen.len() >= 10
        };
        if length >= limits.same_rows && telling() && best.is_none_or(|b| b.2 < length) {
            best = Some((first, row, length));
        }
        row += length;
    }
    best
}
