//! `record --mcap`: what is in the file, and what is refused.

mod served;

use mcap::{MessageStream, Summary};
use plant::recording::{COLUMNS, Recording};
use served::Served;
use std::path::Path;

/// Records for a moment, with these arguments too.
fn record<'a>(out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["record", out, "--mcap", "--duration", "0.2"], more].concat()
}

/// Names of what lies in a folder.
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// The header before the columns takes 16 bytes, behind 4 of encapsulation.
const FIRST_COLUMN: usize = 20;

#[test]
fn each_row_is_a_message_with_the_recordings_values() {
    let served = Served::new(&[]);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    let said = served.printed(&["record", &out, "--mcap", "--arm", "--hold", "2.5,300,0.5"]);
    assert!(said.contains("record.mcap"), "{said}");
    let recording = Recording::load(&folder.path().join("record.csv.gz")).unwrap();
    let file = std::fs::read(folder.path().join("record.mcap")).unwrap();
    let messages: Vec<_> = MessageStream::new(&file)
        .unwrap()
        .map(Result::unwrap)
        .collect();
    assert_eq!(messages.len(), recording.len());
    assert!(messages.len() > 2000, "{} rows", messages.len());
    let start_s = recording.time_s[0];
    for (message, row) in messages.iter().zip(recording.samples()) {
        let time_ns = ((row.time_s - start_s) * 1e9).round() as u64;
        assert_eq!((message.log_time, message.publish_time), (time_ns, time_ns));
        assert_eq!(message.data.len(), FIRST_COLUMN + 8 * COLUMNS.len());
        let numbers = message.data[FIRST_COLUMN..].as_chunks().0;
        for (k, bytes) in numbers.iter().enumerate() {
            assert_eq!(
                f64::from_le_bytes(*bytes).to_bits(),
                row.column(k).to_bits(),
                "{} at {} s",
                COLUMNS[k],
                row.time_s
            );
        }
    }

    let channel = &messages[0].channel;
    let schema = channel.schema.as_ref().unwrap();
    assert_eq!(
        (
            &*channel.topic,
            &*channel.message_encoding,
            &*schema.name,
            &*schema.encoding
        ),
        ("/drive", "cdr", "ddfeed_msgs/msg/Sample", "ros2msg")
    );
    let summary = Summary::read(&file).unwrap().unwrap();
    let about = mcap::read::metadata(&file, &summary.metadata_indexes[0]).unwrap();
    let fact = |name: &str| about.metadata[name].as_str();
    assert_eq!(about.name, "recording");
    assert_eq!(
        (fact("rate_hz"), fact("rows_lost"), fact("rows")),
        ("5000.0", "0", &*recording.len().to_string())
    );
    let model = std::fs::read_to_string(folder.path().join("model.toml")).unwrap();
    assert_eq!(fact("model.toml"), model);
}

#[test]
fn nothing_is_written_over_without_replace() {
    let served = Served::new(&[]);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    let file = folder.path().join("record.mcap");
    std::fs::write(&file, "mine").unwrap();
    let said = served.fails(1, &record(&out, &[]));
    assert!(
        said.contains("record.mcap is there already: give another --name, or --replace"),
        "{said}"
    );
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine");
    assert_eq!(names(folder.path()), ["record.mcap"]);
    served.printed(&record(&out, &["--replace"]));
    assert!(std::fs::read(&file).unwrap().starts_with(mcap::MAGIC));
    assert_eq!(
        names(folder.path()),
        ["model.toml", "record.csv.gz", "record.mcap"]
    );
}

#[test]
fn a_folder_that_cannot_be_written_is_refused_before_the_recording() {
    let served = Served::new(&[]);
    let folder = tempfile::tempdir().unwrap();
    let blocked = folder.path().join("blocked");
    std::fs::write(&blocked, "a file").unwrap();
    let said = served.fails(1, &record(&blocked.display().to_string(), &[]));
    assert!(said.contains("cannot be written"), "{said}");
    assert_eq!(names(folder.path()), ["blocked"]);
}

#[test]
fn a_recording_is_kept_where_its_mcap_file_fails() {
    let served = Served::new(&[]);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    // A folder with something in it is not replaced by a file.
    std::fs::create_dir_all(folder.path().join("record.mcap/folder")).unwrap();
    let said = served.fails(1, &record(&out, &["--replace"]));
    assert!(
        said.contains("--mcap failed") && said.contains("record.csv.gz is kept"),
        "{said}"
    );
    Recording::load(&folder.path().join("record.csv.gz")).unwrap();
    assert!(folder.path().join("record.mcap/folder").exists());
}

#[test]
fn an_empty_recording_writes_no_file() {
    let served = Served::new(&[]);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    let never = ["--trigger", "table_position_m>1", "--arm", "--hold"];
    let said = served.fails(1, &record(&out, &[&never[..], &["2.5,0,0.3"]].concat()));
    assert!(said.contains("did not fire"), "{said}");
    assert_eq!(names(folder.path()), [""; 0]);
}
