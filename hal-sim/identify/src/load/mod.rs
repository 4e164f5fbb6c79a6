//! Recordings from files: `.csv`, `.csv.gz`, MATLAB 5 `.mat` and (feature `parquet`) Parquet, in any column layout that a
//! mapping describes.

mod error;
mod mapping;
mod table;

pub use error::LoadError;
pub use mapping::{Mapping, Source};
pub use table::Table;

use plant::model::Model;
use plant::recording::{COLUMNS, Recording, Sample};
use std::path::Path;

/// Largest phase current, voltage, speed and travel that a feed drive has; beyond it a unit is wrong.
const MOST: [(&str, f64); 6] = [
    ("a", 200.0),
    ("v", 2000.0),
    ("rad_s", 5000.0),
    ("angle_rad", 1e7),
    ("m", 100.0),
    ("t_s", 1e6),
];
/// Shortest record, s.
const SHORTEST_S: f64 = 2.0;

/// Reads a recording. Without a mapping the columns have the names and units of [`COLUMNS`].
///
/// # Errors
/// [`LoadError`]: what was read, where, and what is expected. Nothing is skipped.
pub fn load(path: &Path, mapping: Option<&Mapping>, model: &Model) -> Result<Recording, LoadError> {
    let table = Table::read(path)?;
    let plain = Mapping::default();
    let columns = mapping
        .unwrap_or(&plain)
        .apply(&table, model.sensing.sample_hz)?;
    check(&columns, &table.origin, model.sensing.sample_hz)?;
    let mut recording = Recording::default();
    let rows = columns[0].len();
    (0..rows).for_each(|row| {
        let axis = |first: usize| plant::recording::AxisSample {
            angle_rad: columns[first][row],
            ia_a: columns[first + 1][row],
            ib_a: columns[first + 2][row],
            ud_v: columns[first + 3][row],
            uq_v: columns[first + 4][row],
            iq_ref_a: columns[first + 5][row],
            speed_ref_rad_s: columns[first + 6][row],
        };
        recording.push(&Sample {
            time_s: columns[0][row],
            axes: [axis(1), axis(8)],
            table_position_m: columns[15][row],
        });
    });
    Ok(recording)
}

/// Refuses what an identification would take for a machine: values that are no numbers or in a wrong unit, gaps and
/// steps back in time, a record that is too short.
fn check(columns: &[Vec<f64>], origin: &str, sample_hz: f64) -> Result<(), LoadError> {
    for (name, values) in COLUMNS.iter().zip(columns) {
        let most = MOST
            .iter()
            .find(|(unit, _)| name.ends_with(unit))
            .map_or(f64::INFINITY, |(_, most)| *most);
        for (row, value) in values.iter().enumerate() {
            if !value.is_finite() || value.abs() > most {
                return Err(LoadError::Value {
                    origin: origin.to_owned(),
                    row: row + 1,
                    column: (*name).to_owned(),
                    value: *value,
                    most,
                });
            }
        }
    }
    let time = &columns[0];
    let interval = 1.0 / sample_hz;
    for (row, pair) in time.windows(2).enumerate() {
        let step = pair[1] - pair[0];
        if !(0.5 * interval..1.5 * interval).contains(&step) {
            return Err(LoadError::Time {
                origin: origin.to_owned(),
                row: row + 2,
                step,
                interval,
            });
        }
    }
    let seconds = time.len() as f64 * interval;
    if seconds < SHORTEST_S {
        return Err(LoadError::Short {
            origin: origin.to_owned(),
            seconds,
            least: SHORTEST_S,
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(
        rows: usize,
        change: impl Fn(usize, usize) -> Option<String>,
    ) -> tempfile::NamedTempFile {
        let mut text = COLUMNS.join(",") + "\n";
        for row in 0..rows {
            let cells: Vec<String> = (0..16)
                .map(|column| {
                    change(row, column).unwrap_or_else(|| {
                        if column == 0 {
                            format!("{}", row as f64 / 5000.0)
                        } else {
                            "0.1".into()
                        }
                    })
                })
                .collect();
            text += &(cells.join(",") + "\n");
        }
        let file = tempfile::Builder::new()
            .suffix(".csv")
            .tempfile()
            .expect("a temporary file");
        std::fs::write(file.path(), text).expect("it can be written");
        file
    }

    fn fault(rows: usize, change: impl Fn(usize, usize) -> Option<String>) -> String {
        let file = text(rows, change);
        load(file.path(), None, &Model::coupled())
            .expect_err("the record has a fault")
            .to_string()
    }

    #[test]
    fn a_sound_record_loads() {
        let file = text(12_000, |_, _| None);
        let recording = load(file.path(), None, &Model::coupled()).expect("a sound record");
        assert_eq!(recording.len(), 12_000);
        assert_eq!(recording.axes[1].uq_v[7], 0.1);
    }

    #[test]
    fn faults_are_told_by_row_and_column() {
        let nan = fault(12_000, |row, column| {
            (row == 41 && column == 2).then(|| "NaN".into())
        });
        assert!(
            nan.contains("row 42") && nan.contains("screw_ia_a"),
            "{nan}"
        );
        let unit = fault(12_000, |row, column| {
            (row == 9 && column == 9).then(|| "400".into())
        });
        assert!(
            unit.contains("row 10") && unit.contains("nut_ia_a") && unit.contains("400"),
            "{unit}"
        );
        let word = fault(12_000, |row, column| {
            (row == 5 && column == 15).then(|| "abc".into())
        });
        assert!(
            word.contains("row 6") && word.contains("table_position_m") && word.contains("abc"),
            "{word}"
        );
    }

    #[test]
    fn gaps_and_steps_back_in_time_are_refused() {
        let gap = fault(12_000, |row, column| {
            (column == 0 && row >= 100).then(|| format!("{}", (row + 3) as f64 / 5000.0))
        });
        assert!(gap.contains("row 101"), "{gap}");
        let twice = fault(12_000, |row, column| {
            (column == 0 && row == 50).then(|| format!("{}", 49.0 / 5000.0))
        });
        assert!(twice.contains("row 51"), "{twice}");
        let short = fault(500, |_, _| None);
        assert!(short.contains("0.1 s") && short.contains("2 s"), "{short}");
    }

    #[test]
    fn a_mapping_renames_and_scales() {
        let file = text(12_000, |_, _| None);
        let renamed = std::fs::read_to_string(file.path())
            .expect("it is there")
            .replacen("screw_ia_a", "I1_mA", 1);
        std::fs::write(file.path(), renamed).expect("it can be written");
        let mapping = Mapping::parse(
            "[columns.screw_ia_a]\nname = \"I1_mA\"\nscale = 1e-3\n",
            "mapping.toml",
        )
        .expect("a mapping");
        let recording =
            load(file.path(), Some(&mapping), &Model::coupled()).expect("a mapped record");
        assert!((recording.axes[0].ia_a[3] - 1e-4).abs() < 1e-12);
    }
}
