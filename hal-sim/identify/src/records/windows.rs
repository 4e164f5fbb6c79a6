//! Windows of records that have more rows than a search can use in a minute.

use super::Record;

/// Rows that are used. A bare motor's search takes 3 s of CPU for 60,000 rows in either record.
const MOST_ROWS: usize = 300_000;
/// Rows of a window, and its minimum time, s: a tenth of that is lost to filters.
const WINDOW_ROWS: usize = 20_000;
const WINDOW_S: f64 = 4.0;

/// Stretches with at most about [`MOST_ROWS`] rows: where there are more, windows that lie evenly over them. The first has a note of it.
pub(crate) fn windows(stretches: Vec<Record>) -> Vec<Record> {
    let rows = |records: &[Record]| records.iter().map(Record::len).sum::<usize>();
    let all = rows(&stretches);
    let every = all.div_ceil(MOST_ROWS);
    if every < 2 {
        return stretches;
    }
    let parts = stretches.iter().flat_map(|stretch| {
        let length = WINDOW_ROWS.max((WINDOW_S * stretch.rate) as usize);
        let starts = (0..stretch.len()).step_by(length);
        starts.map(move |from| (stretch, from..from + length))
    });
    let kept = parts.step_by(every);
    let mut kept: Vec<Record> = kept.map(|(stretch, rows)| stretch.part(rows)).collect();
    let used = rows(&kept);
    if let Some(first) = kept.first_mut() {
        first.quality.cut += all - used;
        first.quality.notes.push(format!(
            "{used} of {all} rows are used: windows that lie evenly over the record"
        ));
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use plant::recording::Recording;

    fn record(rows: usize) -> Record {
        let recording = Recording {
            time_s: (0..rows).map(|row| row as f64 / 1000.0).collect(),
            table_position_m: (0..rows).map(|row| row as f64).collect(),
            ..Recording::default()
        };
        let mut record = Record::of_double_drive(&recording, 1000.0, "long.csv");
        record
            .channels
            .retain(|channel| channel.values.len() == rows);
        record
    }

    #[test]
    fn windows_lie_evenly_over_what_is_too_long() {
        let short = windows(vec![record(200_000), record(100_000)]);
        assert_eq!(
            short.iter().map(Record::len).collect::<Vec<_>>(),
            [200_000, 100_000]
        );
        let long = windows(vec![record(1_000_000), record(30_000), record(900)]);
        let used: usize = long.iter().map(Record::len).sum();
        assert!((200_000..=MOST_ROWS).contains(&used), "{used} rows");
        let firsts: Vec<f64> = long
            .iter()
            .map(|part| part.channel("table_position_m")[0])
            .collect();
        assert_eq!(firsts[..3], [0.0, 80_000.0, 160_000.0]);
        let notes = &long[0].quality.notes;
        assert_eq!(long[0].quality.cut, 1_030_900 - used);
        assert!(
            notes[0].starts_with(&format!("{used} of 1030900 rows")),
            "{notes:?}"
        );
    }
}
