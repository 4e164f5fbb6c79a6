//! What is written reads back, and a damaged file is named by row and column.

use plant::recording::{AxisSample, Recording, RecordingError, RecordingReader, Sample};

fn sample(k: f64) -> Sample {
    let axis = AxisSample {
        angle_rad: 0.125 * k,
        ia_a: -0.25,
        ib_a: 0.5,
        ud_v: 1.5,
        uq_v: -2.5,
        iq_ref_a: 0.0625,
        speed_ref_rad_s: 31.25,
    };
    Sample {
        time_s: k / 2000.0,
        axes: [axis, axis],
        table_position_m: k / 1e9,
    }
}

fn recording() -> Recording {
    let mut recording = Recording::default();
    (0..50).for_each(|k| recording.push(&sample(f64::from(k))));
    recording
}

#[test]
fn plain_and_zipped_files_read_back() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["record.csv", "record.csv.gz"] {
        let path = folder.path().join(name);
        recording().save(&path).unwrap();
        assert!(Recording::load(&path).unwrap() == recording(), "{name}");
    }
}

fn text() -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("record.csv");
    recording().save(&path).unwrap();
    std::fs::read_to_string(path).unwrap()
}

fn error_of(text: String) -> String {
    let reader = RecordingReader::new(Box::new(std::io::Cursor::new(text.into_bytes())), "x.csv");
    let error = match reader {
        Err(error) => error,
        Ok(rows) => rows.collect::<Result<Vec<_>, _>>().unwrap_err(),
    };
    error.to_string()
}

#[test]
fn faults_are_named_by_row_and_column() {
    let missing = error_of(text().replacen("nut_ud_v", "nut_ux_v", 1));
    assert!(
        missing.contains("column `nut_ux_v` is unknown"),
        "{missing}"
    );
    let twice = error_of(text().replacen("nut_ud_v", "nut_uq_v", 1));
    assert!(twice.contains("column `nut_ud_v` is missing"), "{twice}");
    let value = error_of(text().replacen("0.0010,", "NaN,", 1));
    assert!(value.contains("row 3, column `t_s`: read `NaN`"), "{value}");
    let short = error_of(text().replacen("0.0010,", "", 1));
    assert!(short.contains("after row 2"), "{short}");
}

#[test]
fn a_cut_off_or_empty_or_missing_file_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("record.csv.gz");
    recording().save(&path).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    assert!(
        matches!(Recording::load(&path), Err(RecordingError::Damaged { .. })),
        "expected the error Damaged, read {:?}",
        Recording::load(&path).map(|r| r.len())
    );
    Recording::default().save(&path).unwrap();
    assert!(
        matches!(Recording::load(&path), Err(RecordingError::Empty { .. })),
        "expected the error Empty, read {:?}",
        Recording::load(&path).map(|r| r.len())
    );
    std::fs::remove_file(&path).unwrap();
    assert!(
        matches!(Recording::load(&path), Err(RecordingError::Open { .. })),
        "expected the error Open, read {:?}",
        Recording::load(&path).map(|r| r.len())
    );
}

#[test]
fn columns_may_stand_in_any_order() {
    let moved: String = text()
        .lines()
        .map(|line| line.split(',').rev().collect::<Vec<_>>().join(",") + "\n")
        .collect();
    let rows =
        RecordingReader::new(Box::new(std::io::Cursor::new(moved.into_bytes())), "x.csv").unwrap();
    let rows: Vec<_> = rows.collect::<Result<_, _>>().unwrap();
    assert!(
        rows == recording().samples().collect::<Vec<_>>(),
        "the rows of {} columns in another order are not those that were written",
        text().lines().next().map_or(0, |l| l.split(',').count())
    );
}
