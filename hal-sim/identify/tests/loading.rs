//! The one way in: every format holds the same record, and every fault is reported or mended by its rule.

use identify::records::{DataQuality, How, LoadError, Mapping, OnFault, double_drive, load};
use plant::recording::{COLUMNS, Recording};
use std::path::{Path, PathBuf};
#[cfg(feature = "parquet")]
use std::sync::Arc;

const RATE: f64 = 5000.0;
const ROWS: usize = 12_000;

/// A cell of a sound record: both motors turn at 10 rad/s.
fn cell(row: usize, column: usize) -> f64 {
    let time = row as f64 / RATE;
    match COLUMNS[column] {
        "t_s" => time,
        name if name.ends_with("angle_rad") => 10.0 * time,
        name if name.ends_with("speed_ref_rad_s") => 10.0,
        "table_position_m" => 1e-3 * time,
        _ => 0.1 * (time + column as f64).sin(),
    }
}

fn csv(rows: usize, change: impl Fn(usize, usize) -> Option<String>) -> String {
    let mut text = COLUMNS.join(",") + "\n";
    for row in 0..rows {
        let cells: Vec<String> = (0..16)
            .map(|column| change(row, column).unwrap_or_else(|| cell(row, column).to_string()))
            .collect();
        text += &(cells.join(",") + "\n");
    }
    text
}

fn put(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("a temporary file");
    path
}

fn read(
    path: &Path,
    mapping: &Mapping,
    on_fault: OnFault,
) -> Result<(Recording, DataQuality), LoadError> {
    let how = How {
        mapping,
        on_fault,
        declared_hz: Some(RATE),
    };
    let loaded = load(path, how, &mut |_| ())?;
    let account = loaded.quality.clone();
    Ok((double_drive(loaded)?, account))
}

fn how(mapping: &Mapping) -> How<'_> {
    How {
        mapping,
        on_fault: OnFault::Refuse,
        declared_hz: Some(RATE),
    }
}

fn of_text(text: &str, on_fault: OnFault) -> Result<(Recording, DataQuality), LoadError> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = put(folder.path(), "record.csv", text.as_bytes());
    read(&path, &Mapping::default(), on_fault)
}

fn refused(rows: usize, change: impl Fn(usize, usize) -> Option<String>) -> String {
    let error = of_text(&csv(rows, change), OnFault::Refuse);
    error.expect_err("the record has a fault").to_string()
}

fn skipped(change: impl Fn(usize, usize) -> Option<String>) -> (Recording, DataQuality) {
    of_text(&csv(ROWS, change), OnFault::Skip).expect("a fault that a rule mends")
}

fn says(message: &str, words: &[&str]) {
    for word in words {
        assert!(message.contains(word), "`{word}` is not in: {message}");
    }
}

#[test]
fn every_format_holds_the_same_record() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let text = csv(ROWS, |_, _| None);
    let mut zip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut zip, text.as_bytes()).expect("memory");
    let files = [
        put(folder.path(), "record.csv", text.as_bytes()),
        put(
            folder.path(),
            "record.csv.gz",
            &zip.finish().expect("memory"),
        ),
        put(folder.path(), "record.mat", &mat()),
        #[cfg(feature = "parquet")]
        parquet(folder.path()),
    ];
    let all = files
        .map(|path| read(&path, &Mapping::default(), OnFault::Refuse).expect("a sound record"));
    for (recording, account) in &all {
        assert_eq!(
            (account.rows, account.used, account.bridged),
            (ROWS, ROWS, 0)
        );
        assert_eq!(recording.axes[1].uq_v[77], cell(77, 12));
        assert_eq!(recording.axes, all[0].0.axes);
        assert_eq!(recording.table_position_m, all[0].0.table_position_m);
    }
}

/// MATLAB 5: a header of 128 bytes, then a matrix element for each variable.
fn mat() -> Vec<u8> {
    let mut file = vec![b' '; 124];
    file.extend([0x00, 0x01, b'I', b'M']);
    let element = |kind: u32, data: &[u8]| {
        let mut bytes = [kind.to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
        bytes.extend(data);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes
    };
    for (column, name) in COLUMNS.iter().enumerate() {
        let values: Vec<u8> = (0..ROWS)
            .flat_map(|row| cell(row, column).to_le_bytes())
            .collect();
        let words = |words: [u32; 2]| words.map(u32::to_le_bytes).concat();
        let body = [
            element(6, &words([6, 0])),
            element(5, &words([ROWS as u32, 1])),
            element(1, name.as_bytes()),
            element(9, &values),
        ];
        file.extend(element(14, &body.concat()));
    }
    file
}

/// A program without the feature reports it.
#[test]
#[cfg(not(feature = "parquet"))]
fn a_parquet_file_is_refused_with_the_feature_that_reads_it() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = put(folder.path(), "record.parquet", b"PAR1");
    let error = read(&path, &Mapping::default(), OnFault::Refuse).expect_err("no Parquet");
    assert!(error.to_string().contains("feature `parquet`"), "{error}");
}

/// Written by the library, compressed by snappy as most are.
#[cfg(feature = "parquet")]
fn parquet(folder: &Path) -> PathBuf {
    use parquet::basic::Compression;
    use parquet::data_type::DoubleType;
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    let fields: String = COLUMNS
        .iter()
        .map(|name| format!("REQUIRED DOUBLE {name};\n"))
        .collect();
    let schema =
        parquet::schema::parser::parse_message_type(&format!("message record {{\n{fields}}}"));
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .build();
    let path = folder.join("record.parquet");
    let file = std::fs::File::create(&path).expect("a temporary file");
    let schema = Arc::new(schema.expect("a schema"));
    let mut writer =
        SerializedFileWriter::new(file, schema, Arc::new(properties)).expect("a writer");
    let mut group = writer.next_row_group().expect("a row group");
    for column in 0..16 {
        let values: Vec<f64> = (0..ROWS).map(|row| cell(row, column)).collect();
        let mut chunk = group.next_column().expect("memory").expect("a column");
        let typed = chunk.typed::<DoubleType>();
        typed.write_batch(&values, None, None).expect("memory");
        chunk.close().expect("memory");
    }
    group.close().expect("memory");
    writer.close().expect("a whole file");
    path
}

#[test]
fn a_mapping_renames_and_scales() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let text = csv(ROWS, |_, _| None)
        .replacen("screw_ia_a", "I1_mA", 1)
        .replace(',', ";");
    let path = put(folder.path(), "record.txt", text.as_bytes());
    let mapping = "separator = \";\"\n[columns.screw_ia_a]\nname = \"I1_mA\"\nscale = 1e-3\n";
    let mapping = Mapping::parse(mapping, "mapping.toml").expect("a mapping");
    let (recording, _) = read(&path, &mapping, OnFault::Refuse).expect("a mapped record");
    assert!((recording.axes[0].ia_a[3] - 1e-3 * cell(3, 2)).abs() < 1e-12);
    let unknown = Mapping::parse("[columns.screw_id_a]\nname = \"x\"\n", "mapping.toml");
    says(
        &unknown.unwrap_err().to_string(),
        &["mapping.toml", "screw_id_a", "screw_ia_a"],
    );
    let plain = read(&path, &Mapping::default(), OnFault::Refuse)
        .unwrap_err()
        .to_string();
    says(&plain, &["is missing", "mapping file"]);
}

#[test]
fn a_cell_that_is_no_number() {
    for bad in ["NaN", "abc", ""] {
        let change = |row: usize, column: usize| (row == 41 && column == 2).then(|| bad.to_owned());
        says(&refused(ROWS, change), &["row 42", "screw_ia_a", bad]);
        let (recording, account) = skipped(change);
        assert_eq!(
            (account.skipped[0].rows, account.skipped[0].first_row),
            (1, 42)
        );
        assert_eq!((recording.len(), account.bridged), (ROWS, 1));
        let straight = 0.5 * (cell(40, 2) + cell(42, 2));
        assert!((recording.axes[0].ia_a[41] - straight).abs() < 1e-12);
    }
}

#[test]
fn a_row_of_too_few_cells() {
    let mut lines: Vec<String> = csv(ROWS, |_, _| None).lines().map(str::to_owned).collect();
    lines[8] = lines[8].split(',').take(7).collect::<Vec<_>>().join(",");
    let text = lines.join("\n");
    let error = of_text(&text, OnFault::Refuse).unwrap_err().to_string();
    says(&error, &["row 8", "screw_speed_ref_rad_s"]);
    assert_eq!(of_text(&text, OnFault::Skip).unwrap().1.bridged, 1);
}

#[test]
fn a_wrong_unit() {
    let spike = |row: usize, column: usize| (row == 9 && column == 9).then(|| "400".to_owned());
    says(
        &refused(ROWS, spike),
        &["row 10", "nut_ia_a", "400", "unit"],
    );
    assert_eq!(skipped(spike).1.skipped[0].rule, "too large");
    // Milliamperes: no rule mends that.
    let milli =
        |row: usize, column: usize| (column == 9).then(|| (1e6 * cell(row, column)).to_string());
    let error = of_text(&csv(ROWS, milli), OnFault::Skip)
        .unwrap_err()
        .to_string();
    says(&error, &["nut_ia_a", "unit is wrong"]);
    let rpm = |_: usize, column: usize| {
        (column == 7).then(|| (10.0 * 60.0 / std::f64::consts::TAU).to_string())
    };
    let error = of_text(&csv(ROWS, rpm), OnFault::Skip)
        .unwrap_err()
        .to_string();
    says(&error, &["screw_angle_rad", "rpm"]);
    let milliseconds =
        |row: usize, column: usize| (column == 0).then(|| (1e3 * cell(row, 0)).to_string());
    let error = of_text(&csv(ROWS, milliseconds), OnFault::Skip)
        .unwrap_err()
        .to_string();
    says(&error, &["t_s", "seconds"]);
}

#[test]
fn a_time_twice_or_back() {
    let twice =
        |row: usize, column: usize| (column == 0 && row == 50).then(|| cell(49, 0).to_string());
    says(&refused(ROWS, twice), &["row 51", "a row twice"]);
    assert_eq!(skipped(twice).1.skipped[0].rule, "time twice or back");
    let back =
        |row: usize, column: usize| (column == 0 && row == 50).then(|| cell(20, 0).to_string());
    says(&refused(ROWS, back), &["row 51", "a step back"]);
    let (recording, account) = skipped(back);
    assert_eq!((account.skipped[0].rows, recording.len()), (1, ROWS));
}

#[test]
fn a_gap() {
    let late = |by: usize| {
        move |row: usize, column: usize| {
            (column == 0 && row >= 100).then(|| cell(row + by, 0).to_string())
        }
    };
    let (recording, account) = of_text(&csv(ROWS, late(3)), OnFault::Refuse).expect("no fault");
    assert_eq!(
        (account.bridged, account.cut, recording.len()),
        (3, 0, ROWS + 3)
    );
    // A longer one divides the record; nothing of it is thrown away.
    let folder = tempfile::tempdir().expect("a temporary folder");
    let late = |row: usize, column: usize| {
        (column == 0 && row >= 5000).then(|| cell(row + 900, 0).to_string())
    };
    let path = put(folder.path(), "record.csv", csv(ROWS, late).as_bytes());
    let record = load(&path, how(&Mapping::default()), &mut |_| ()).expect("two segments");
    assert_eq!(record.segments, [0..5000, 5000..ROWS]);
    assert_eq!((record.quality.cut, record.len()), (0, ROWS));
    assert!((record.time[5000] - cell(5900, 0)).abs() < 1e-9);
    let pieces = record.pieces();
    assert_eq!([pieces[0].len(), pieces[1].len()], [5000, ROWS - 5000]);
    assert_eq!(pieces[1].channel("nut_uq_v")[7], cell(5007, 12));
}

/// A file with four digits of time cannot say 0.25 ms: that is not a fault.
#[test]
fn a_rounded_time() {
    let late =
        |row: usize, column: usize| (column == 0).then(|| format!("{:.4}", cell(row, 0) + 5e-5));
    let (recording, account) = of_text(&csv(ROWS, late), OnFault::Refuse).expect("a sound record");
    assert_eq!((account.bridged, recording.len()), (0, ROWS));
    assert_eq!(recording.axes[0].ia_a[ROWS - 1], cell(ROWS - 1, 2));
}

#[test]
fn too_short_or_too_bad() {
    says(&refused(500, |_, _| None), &["0.1 s", "2 s"]);
    let many =
        |row: usize, column: usize| (column == 3 && row.is_multiple_of(10)).then(|| "?".to_owned());
    let error = of_text(&csv(ROWS, many), OnFault::Skip)
        .unwrap_err()
        .to_string();
    says(&error, &["1200 of 12000", "row 1"]);
}

#[test]
fn a_file_cut_off() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut zip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut zip, csv(ROWS, |_, _| None).as_bytes()).expect("memory");
    let bytes = zip.finish().expect("memory");
    let path = put(folder.path(), "record.csv.gz", &bytes[..bytes.len() / 2]);
    let error = read(&path, &Mapping::default(), OnFault::Skip)
        .unwrap_err()
        .to_string();
    says(&error, &["after row", "cut off"]);
}

#[test]
fn progress_goes_from_little_to_all() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = put(
        folder.path(),
        "record.csv",
        csv(ROWS, |_, _| None).as_bytes(),
    );
    let mut told = Vec::new();
    let mapping = Mapping::default();
    let how = How {
        mapping: &mapping,
        on_fault: OnFault::Refuse,
        declared_hz: Some(RATE),
    };
    load(&path, how, &mut |share| told.push(share)).expect("a sound record");
    assert!((5..=300).contains(&told.len()), "{} words", told.len());
    assert!(told.is_sorted() && *told.last().unwrap() > 0.9);
}
