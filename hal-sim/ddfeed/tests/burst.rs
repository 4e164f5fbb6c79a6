//! `drive burst` against `serve`, as a person runs it.

mod served;

use serde_json::Value;
use served::{Served, ddfeed};
use std::process::Stdio;
use std::thread::sleep;
use std::time::Duration;

/// The numbers of a CSV file's columns by their names.
fn columns(path: &std::path::Path) -> (Vec<String>, Vec<Vec<f64>>) {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let names = lines.next().unwrap().split(',').map(str::to_owned);
    let rows = lines.map(|line| line.split(',').map(|word| word.parse().unwrap()).collect());
    (names.collect(), rows.collect())
}

#[test]
fn a_burst_around_a_rising_current_is_written_over_both_lines() {
    let lines: &[&[&str]] = if cfg!(unix) {
        &[&[], &["--pty"]]
    } else {
        &[&[]]
    };
    for line in lines {
        let served = Served::new(line);
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("new/burst.csv");
        let out = file.display().to_string();
        // Beside the terminal, which one program has.
        let mut jog = ddfeed()
            .args(["drive", "--sim", &served.address])
            .args(["jog", "--arm", "--table-speed", "2", "--nut-rpm", "300"])
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        served.until("running");
        sleep(Duration::from_millis(500));
        let asked = [
            "burst",
            "--motor",
            "nut",
            "--trigger",
            "ia_a>0",
            "--before",
            "10",
            "--out",
            &out,
        ];
        let said = served.printed(&asked);
        assert!(
            said.contains("512 samples of the nut over 25.55 ms, 20000 a second"),
            "{said}"
        );
        let (names, rows) = columns(&file);
        assert_eq!(names[..2], ["time_s", "nut_ia_a"]);
        assert_eq!((names.len(), rows.len()), (9, 512));
        let at = rows.iter().position(|row| row[0] == 0.0).unwrap();
        assert!(at <= 51, "{at} samples before the trigger");
        if at > 0 {
            assert!(
                rows[at - 1][1] <= 0.0 && rows[at][1] >= 0.0,
                "{:?}",
                rows[at]
            );
        }
        for (k, row) in rows.iter().enumerate() {
            let expected = (k as f64 - at as f64) * 50e-6;
            assert!((row[0] - expected).abs() < 1e-9, "{row:?}");
        }
        // It is not replaced without being told.
        let said = served.fails(1, &asked);
        assert!(
            said.contains("is there already: give another --out"),
            "{said}"
        );
        let json = [&asked[..], &["--replace", "--json", "--every", "4"]].concat();
        let told: Value = serde_json::from_str(&served.printed(&json)).unwrap();
        assert_eq!(
            (&told["motor"], &told["samples"]),
            (&"nut".into(), &512.into())
        );
        assert_eq!(told["interval_s"], 0.0002);
        assert!(
            told["signals"]["ia_a"]["most"].as_f64().unwrap() > 0.0,
            "{told}"
        );
        let mean = (told["signals"]["speed_rpm"]["least"].as_f64().unwrap()
            + told["signals"]["speed_rpm"]["most"].as_f64().unwrap())
            / 2.0;
        assert!((mean - 300.0).abs() < 30.0, "{told}");
        served.printed(&["stop"]);
        jog.kill().unwrap();
        jog.wait().unwrap();
    }
}

/// Nobody is connected when the fault comes.
#[test]
fn a_burst_that_waits_for_a_fault_is_read_later() {
    let served = Served::new(&[]);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("fault.csv").display().to_string();
    let said = served.fails(1, &["burst", "--read", "--out", &out]);
    assert!(said.contains("no burst waits"), "{said}");
    served.printed(&["burst", "--trigger", "fault", "--leave"]);
    let said = served.fails(3, &["burst", "--out", &out]);
    assert!(said.contains("Another burst waits"), "{said}");
    served.printed(&["inject", "driver-fault", "--motor", "screw"]);
    served.until("fault");
    served.printed(&["burst", "--read", "--out", &out]);
    let (_, rows) = columns(std::path::Path::new(&out));
    assert_eq!((rows.len(), rows[128][0]), (512, 0.0));
    served.printed(&["burst", "--end"]);
    let said = served.fails(1, &["burst", "--read", "--replace", "--out", &out]);
    assert!(said.contains("no burst waits"), "{said}");
}

#[test]
fn what_is_no_burst_is_said_with_what_is_possible() {
    let served = Served::new(&[]);
    for (arguments, expected) in [
        (&["--trigger", "torque>3"][..], "ia_a, ib_a, iq_a"),
        (&["--trigger", "ia_a"], "neither > nor <"),
        (&["--trigger", "ia_a>9999"], "-2048 to 2048 A"),
        (&["--before", "120"], "--before is 120 %, but 0 to 100 %"),
        (&["--every", "0"], "--every is 0"),
    ] {
        let said = served.fails(1, &[&["burst"], arguments].concat());
        assert!(said.contains(expected), "{arguments:?}: {said}");
    }
}

/// Ctrl-C ends the waiting and the burst.
#[test]
#[cfg(unix)]
fn ctrl_c_ends_the_waiting() {
    let served = Served::new(&[]);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("never.csv").display().to_string();
    let asked = ["burst", "--trigger", "ia_a>8", "--out", &out];
    let waits = served
        .command(&asked)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    sleep(Duration::from_millis(1000));
    let pid = waits.id().to_string();
    let sent = std::process::Command::new("kill")
        .args(["-INT", &pid])
        .status();
    assert!(sent.unwrap().success());
    let output = waits.wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("the trigger did not come"), "{said}");
    assert!(!std::path::Path::new(&out).exists());
    served.printed(&["burst", "--out", &out]);
}
