//! The commands as a person uses them: what they print, what they write, and how they refuse.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn ddfeed(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_ddfeed"))
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap()
}

#[track_caller]
fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

/// Runs, expects success, and gives what was printed.
#[track_caller]
fn printed(folder: &Path, arguments: &[&str]) -> String {
    let output = ddfeed(folder, arguments);
    assert!(output.status.success(), "{}", text(&output.stderr));
    text(&output.stdout).to_owned()
}

/// Runs, expects a refusal without a panic, and gives its sentence.
#[track_caller]
fn refused(folder: &Path, arguments: &[&str]) -> String {
    let output = ddfeed(folder, arguments);
    assert!(!output.status.success(), "{arguments:?} was accepted");
    let sentence = text(&output.stderr).to_owned();
    assert!(!sentence.contains("panicked"), "{sentence}");
    sentence
}

/// What reads the table has gone, as `head` does: no panic's text, and no more work for nobody.
#[test]
#[cfg(unix)]
fn a_reader_that_goes_ends_a_command_quietly() {
    use std::os::unix::process::ExitStatusExt;
    const SIGPIPE: i32 = 13;
    let folder = tempfile::tempdir().unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_ddfeed"))
        .current_dir(folder.path())
        .args(["simulate", "--duration", "1"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    let said = text(&output.stderr);
    assert!(!said.contains("panicked"), "{said}");
    assert_eq!(
        output.status.signal(),
        Some(SIGPIPE),
        "{:?}, expected the signal {SIGPIPE} of a broken pipe",
        output.status
    );
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn the_paper_s_experiment_prints_its_table_and_writes_its_report() {
    let folder = tempfile::tempdir().unwrap();
    let table = printed(folder.path(), &["simulate", "--duration", "1"]);
    for column in [
        "simulated",
        "after learning",
        "S(s), App. A",
        "paper, measured",
        "CDFS, 0 rpm",
        "DDFS, 800 rpm",
        "20.1 %",
        "8.2 %",
    ] {
        assert!(table.contains(column), "no {column:?} in:\n{table}");
    }
    let out = folder.path().join("out/simulate");
    let report = json(&out.join("report.json"));
    let column = |report: &Value, key: &str| -> Vec<f64> {
        let runs = report["runs"].as_array().unwrap().iter();
        runs.filter_map(|run| run[key].as_f64()).collect()
    };
    // The screw's encoder reads falsely; that grows with the speed, and is gone after learning.
    let (vrf, learned) = (
        column(&report, "vrf_percent"),
        column(&report, "learned_percent"),
    );
    assert!(
        learned.len() == 4
            && learned
                .iter()
                .zip(&vrf)
                .all(|(after, before)| after < before),
        "{vrf:?} {learned:?}"
    );
    assert!(learned[3] < learned[0] && learned[3] < 1.5, "{learned:?}");
    assert!(
        std::fs::read_to_string(out.join("report.html"))
            .unwrap()
            .contains("<svg"),
        "report.html has no picture"
    );
    // What was recorded can be driven again on the machine that was written beside it.
    let [recording, model] =
        ["recording.csv.gz", "model.toml"].map(|name| out.join(name).display().to_string());
    let replay = printed(
        folder.path(),
        &[
            "simulate",
            "replay",
            "--recording",
            &recording,
            "--model",
            &model,
        ],
    );
    assert_eq!(replay.lines().count(), 5, "{replay}");

    let learns = "only a board as it ships learns";
    assert!(!table.contains(learns), "{table}");
    let ideal = ["simulate", "--duration", "1", "--board", "paper"];
    let table = printed(folder.path(), &ideal);
    assert!(table.contains(learns), "{table}");
    let ideal = json(&out.join("report.json"));
    let vrf = column(&ideal, "vrf_percent");
    assert!(
        vrf.len() == 4 && vrf.windows(2).all(|pair| pair[1] < pair[0]),
        "{vrf:?}"
    );
    assert!(column(&ideal, "learned_percent").is_empty(), "{ideal}");
}

#[test]
fn the_seed_decides_every_bit_of_the_report() {
    let folder = tempfile::tempdir().unwrap();
    let run = |seed: &str, out: &str| {
        printed(
            folder.path(),
            &[
                "simulate",
                "--duration",
                "0.2",
                "--nut-rpm",
                "300",
                "--seed",
                seed,
                "--machine",
                "coupled",
                "--out",
                out,
            ],
        );
        let mut report = json(&folder.path().join(out).join("report.json"));
        report["setup"]["seed"] = Value::Null;
        report
    };
    assert_eq!(run("5", "a"), run("5", "b"));
    assert_ne!(run("5", "a"), run("6", "c"));
}

#[test]
fn a_sweep_says_where_the_double_drive_wins() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "simulate",
        "sweep",
        "--board",
        "paper",
        "--machine",
        "paper",
        "--table-speed",
        "0.5,2.5",
        "--nut-rpm",
        "50,800",
        "--duration",
        "0.5",
        "--compensated",
    ];
    let table = printed(folder.path(), &arguments);
    let sweep = json(&folder.path().join("out/sweep/sweep.json"));
    let at = |row: usize, column: usize| sweep["vrf_percent"][row][column].as_f64().unwrap();
    // At 2.5 mm/s and 800 rpm the double drive wins; at 50 rpm, in the peak of S, it loses.
    assert!(at(1, 2) < at(1, 0) && at(1, 1) > at(1, 0), "{table}");
    assert!(table.contains('*'), "no {:?} in:\n{table}", '*');
    let compensated = sweep["compensated_percent"][1][0].as_f64().unwrap();
    assert!(
        compensated < 0.2 * at(1, 0),
        "CDFS at 2.5 mm/s has {compensated} % compensated, expected less than a fifth of {} %",
        at(1, 0)
    );
    let proposed = sweep["proposed"].as_array().unwrap();
    assert_eq!(proposed.len(), 2, "a nut speed for each table velocity");
    assert!(
        std::fs::read_to_string(folder.path().join("out/sweep/sweep.html"))
            .unwrap()
            .contains("<svg"),
        "sweep.html has no picture"
    );
}

#[test]
fn nonsense_is_refused_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "kept").unwrap();
    let model = plant::model::Model::coupled().to_toml();
    std::fs::write(folder.path().join("coupled.toml"), model).unwrap();
    let mut left_handed = plant::model::Model::coupled();
    left_handed.feed.lead_m *= -1.0;
    std::fs::write(folder.path().join("left.toml"), left_handed.to_toml()).unwrap();
    for (arguments, expected) in [
        (
            vec!["simulate", "--nut-rpm", "9000"],
            "--nut-rpm is 9000 rpm, but -3000 to 3000 rpm is possible",
        ),
        (
            vec!["simulate", "--nut-rpm", "2990"],
            "the screw's speed, --nut-rpm plus the table's share, is 3020 rpm",
        ),
        (
            vec!["simulate", "--table-speed", "nan"],
            "--table-speed is NaN mm/s, but -100 to 100 mm/s is possible",
        ),
        (
            vec!["simulate", "--table-speed", "0"],
            "give at least 0.001 mm/s",
        ),
        (
            vec!["simulate", "--duration", "-1"],
            "--duration is -1 s, but 0.01 to 1000 s is possible",
        ),
        (
            vec!["simulate", "--load", "1e9"],
            "--load is 1000000000 N m",
        ),
        (
            vec!["simulate", "--load", "5"],
            "the drive is still not steady",
        ),
        (
            vec!["simulate", "--board", "nucleo", "--sensors", "ideal"],
            "--board names a board that has its own sensors",
        ),
        // The nut stands with a torque at which its worst phase is too warm without end.
        (
            vec![
                "simulate",
                "--board",
                "paper",
                "--load",
                "1.2",
                "--nut-rpm",
                "0",
                "--duration",
                "200",
            ],
            "stopped while it was recorded, of the fault",
        ),
        (
            vec!["simulate", "--out", "file"],
            "the output folder file cannot be written",
        ),
        (vec!["simulate", "--model", "none.toml"], "none.toml"),
        (
            vec!["serve", "--model", "left.toml"],
            "left.toml: `feed.lead_m` is -0.005 m, but the drive counts a right-handed screw",
        ),
        // The coupled machine's supply is 310 V.
        (
            vec!["simulate", "--model", "coupled.toml", "--board", "nucleo"],
            "works from 18 to 50.4 V",
        ),
        (
            vec!["serve", "--example", "--board", "nucleo"],
            "--example prints the coupled machine, not a board's",
        ),
        (
            vec!["simulate", "sweep", "--table-speed", "inf"],
            "--table-speed is inf mm/s",
        ),
        (
            vec![
                "simulate",
                "replay",
                "--recording",
                "file",
                "--model",
                "file",
            ],
            "file",
        ),
    ] {
        let sentence = refused(folder.path(), &arguments);
        assert!(
            sentence.contains(expected),
            "{arguments:?} said:\n{sentence}"
        );
    }
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "kept");
}

#[test]
fn a_refused_run_keeps_the_report_that_was_there() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out/simulate");
    std::fs::create_dir_all(&out).unwrap();
    std::fs::write(out.join("recording.csv.gz"), "older").unwrap();
    refused(
        folder.path(),
        &["simulate", "--load", "5", "--nut-rpm", "300"],
    );
    assert_eq!(
        std::fs::read_to_string(out.join("recording.csv.gz")).unwrap(),
        "older"
    );
    let left: Vec<_> = std::fs::read_dir(&out)
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(left, ["recording.csv.gz"]);
}

/// Before the drive is looked for, and before anything is written.
#[test]
#[cfg(not(feature = "mcap"))]
fn an_mcap_file_is_refused_with_the_feature_that_writes_it() {
    let folder = tempfile::tempdir().unwrap();
    let nobody = ["record", "--sim", "127.0.0.1:1", "out", "--mcap"];
    let sentence = refused(folder.path(), &[&nobody[..], &["--duration", "1"]].concat());
    assert!(
        sentence.contains("--mcap needs the feature `mcap`")
            && sentence.contains("cargo ddfeed-full"),
        "{sentence}"
    );
    assert!(!folder.path().join("out").exists());
}
