//! The shared recordings load, and are written as they were read.

use plant::Axis;
use plant::model::Model;
use plant::recording::Recording;
use std::path::Path;

given::shared_tests! {
    "recordings" => all_given_recordings_and_models_load, a_given_recording_is_written_as_it_was_read;
}

fn all_given_recordings_and_models_load(folder: &Path) {
    for machine in 1..=10 {
        let folder = folder.join(format!("open-{machine:02}"));
        let model = Model::load(&folder.join("model.toml")).unwrap();
        assert_eq!(Model::parse(&model.to_toml(), "copy").unwrap(), model);
        for file in ["fit.csv.gz", "check.csv.gz"] {
            let recording = Recording::load(&folder.join(file)).unwrap();
            let duration = recording.time_s[recording.len() - 1];
            let rows = (duration * model.sensing.sample_hz).round() as usize + 1;
            assert_eq!(recording.len(), rows, "{machine} {file}");
            assert_eq!(recording.axis(Axis::Nut).angle_rad.len(), rows);
        }
    }
}

fn a_given_recording_is_written_as_it_was_read(folder: &Path) {
    let source = folder.join("open-01/check.csv.gz");
    let copy = tempfile::tempdir().unwrap();
    let copy = copy.path().join("copy.csv.gz");
    Recording::load(&source).unwrap().save(&copy).unwrap();
    let text = |path| {
        let mut text = String::new();
        let mut file = flate2::read::GzDecoder::new(std::fs::File::open(path).unwrap());
        std::io::Read::read_to_string(&mut file, &mut text).unwrap();
        text.replace("\r\n", "\n")
    };
    let (source, copy) = (text(&source), text(&copy));
    for (row, (given, ours)) in source.lines().zip(copy.lines()).enumerate() {
        assert_eq!(given, ours, "row {row}");
    }
    assert_eq!(source.lines().count(), copy.lines().count());
}
