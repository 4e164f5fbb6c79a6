//! A record without another one to check it: some of its operating points are held back.

use super::Record;
use std::ops::Range;

/// Shortest part, s.
const SHORTEST_S: f64 = 2.0;
/// What is held for so long is an operating point, s.
const HELD_S: f64 = 0.3;
/// Turns, or lengths of a thousandth of the travel, that count as motion of a shaft.
const MOVES_RAD: f64 = 6.0;

/// A record in two.
#[derive(Debug, Clone)]
pub struct Split {
    /// To identify from.
    pub fit: Record,
    /// Held back: it confirms.
    pub check: Record,
    /// What was done.
    pub sentence: String,
}

/// Divides a record between two operating points: where both parts are of like length, and each shaft that turns in the
/// record turns in both. Without references to tell operating points by, in the middle.
///
/// `None` where a part would be shorter than 2 s.
pub fn split(record: &Record) -> Option<Split> {
    let rows = record.len();
    let shortest = (SHORTEST_S * record.rate) as usize;
    let holds = holds(record);
    let angles: Vec<&[f64]> = record
        .channels
        .iter()
        .filter(|c| c.name.ends_with("angle_rad"))
        .map(|c| c.values.as_slice())
        .collect();
    let moves = |rows: Range<usize>| -> Vec<bool> {
        let of = |angle: &&[f64]| {
            let (low, high) = angle[rows.clone()]
                .iter()
                .fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
            high - low > MOVES_RAD
        };
        angles.iter().map(of).collect()
    };
    let all = moves(0..rows);
    let balance = |cut: usize| (2 * cut).abs_diff(rows);
    let inner = shortest.max(1)..(rows + 1).saturating_sub(shortest.max(1));
    let cut = holds
        .iter()
        .map(|hold| hold.end)
        .filter(|cut| inner.contains(cut) && moves(0..*cut) == all && moves(*cut..rows) == all)
        .min_by_key(|cut| balance(*cut));
    let (cut, how) = match cut {
        Some(cut) => {
            let before = holds.iter().filter(|hold| hold.end <= cut).count();
            let how = format!(
                "the first {before} of {} operating points fit, the others are held back and check",
                holds.len()
            );
            (cut, how)
        }
        None => {
            let how = "its first half fits, its second half is held back and checks".to_owned();
            (rows / 2, how)
        }
    };
    if !inner.contains(&cut) {
        return None;
    }
    let part = |rows: Range<usize>| {
        let mut part = record.part(rows.clone());
        part.quality.file = format!(
            "{}, rows {} to {}",
            part.quality.file,
            rows.start + 1,
            rows.end
        );
        part
    };
    Some(Split {
        fit: part(0..cut),
        check: part(cut..rows),
        sentence: format!(
            "there is one record and no other to check it: {how} (cut at {:.2} s)",
            record.time[cut] - record.time[0]
        ),
    })
}

/// Stretches in which all speed references hold.
fn holds(record: &Record) -> Vec<Range<usize>> {
    let references: Vec<&[f64]> = record
        .channels
        .iter()
        .filter(|c| c.name.contains("speed_ref"))
        .map(|c| c.values.as_slice())
        .collect();
    if references.is_empty() {
        return Vec::new();
    }
    let least = (HELD_S * record.rate) as usize;
    let mut holds = Vec::new();
    let mut from = 0;
    for row in 1..=record.len() {
        let ends = row == record.len() || references.iter().any(|r| r[row] != r[row - 1]);
        if ends {
            if row - from > least {
                holds.push(from..row);
            }
            from = row;
        }
    }
    holds
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::recording::{AxisSample, Recording, Sample};

    /// Two operating points with the nut at rest, then two with it turning.
    #[test]
    fn both_parts_have_what_the_record_has() {
        let mut recording = Recording::default();
        let (mut screw, mut nut) = (0.0, 0.0);
        for row in 0..16_000 {
            let (screw_speed, nut_speed) =
                [(1.0, 0.0), (2.0, 0.0), (33.0, 31.0), (9.0, 7.0)][row / 4000];
            screw += screw_speed / 1000.0;
            nut += nut_speed / 1000.0;
            let axis = |angle_rad, speed_ref_rad_s| AxisSample {
                angle_rad,
                speed_ref_rad_s,
                ..AxisSample::default()
            };
            recording.push(&Sample {
                time_s: row as f64 / 1000.0,
                axes: [axis(screw, screw_speed), axis(nut, nut_speed)],
                table_position_m: 0.0,
            });
        }
        let record = Record::of_double_drive(&recording, 1000.0, "run.csv");
        let split = split(&record).expect("long enough");
        assert_eq!((split.fit.len(), split.check.len()), (12_000, 4000));
        assert!(
            split.sentence.contains("first 3 of 4 operating points"),
            "{}",
            split.sentence
        );
        assert!(split.check.quality.file.contains("rows 12001 to 16000"));
    }
}
