//! Feed axes with a force column and no control law, whatever the numbers: an answer or a sentence, and never a panic.

use identify::records::{Mapping, OnFault};
use identify::run::Task;
use std::fmt::Write;
use std::path::Path;

const MODEL: &str = "[axis]\nmass_kg = 50.0\nviscous_n_s_per_m = 200.0\ncoulomb_n = 20.0\noffset_n = 0.0\nlead_m = 0.01\nlimit_v = 10.0\n";
const MAPPING: &str = "machine = \"feed axis\"\nsample_hz = 500.0\n";

/// A table of position and force, row by row over time, s.
fn table(seconds: f64, row: impl Fn(f64) -> [f64; 2]) -> String {
    let mut text = "t_s,position_m,force_n\n".to_owned();
    for k in 0..(500.0 * seconds) as usize {
        let t = k as f64 / 500.0;
        let [position, force] = row(t);
        writeln!(text, "{t},{position},{force}").expect("a string takes all");
    }
    text
}

/// What is said of two tables: the verdict, or the error.
fn said(folder: &Path, texts: [String; 2]) -> Result<&'static str, String> {
    let [fit, check] = ["fit.csv", "check.csv"].map(|name| folder.join(name));
    let model = folder.join("model.toml");
    for (path, text) in [(&fit, &texts[0]), (&check, &texts[1])] {
        std::fs::write(path, text).expect("a folder that can be written");
    }
    std::fs::write(&model, MODEL).expect("a folder that can be written");
    let task = Task {
        model,
        fit: vec![fit],
        check: vec![check],
        mapping: Mapping::parse(MAPPING, "mapping").expect("a mapping"),
        on_fault: OnFault::Skip,
    };
    task.run(&mut |_, _| ())
        .map(|done| done.report.verdict)
        .map_err(|error| error.to_string())
}

#[test]
fn a_force_column_is_answered_whatever_it_holds() {
    let folder = tempfile::tempdir().expect("a folder");
    let moved = |t: f64, k: f64| 0.02 * (k * t).sin() + 0.01 * (0.37 * t).sin();
    type Row = fn(f64, f64) -> f64;
    let forces: [(&str, Row); 5] = [
        ("friction", |t, k| {
            20.0 * (k * t).cos().signum() + 0.1 * (997.0 * t * k).sin()
        }),
        ("nothing", |_, _| 0.0),
        ("a constant", |_, _| 7.0),
        ("the largest numbers", |t, _| 1e5 * (9.0 * t).sin()),
        ("the smallest numbers", |t, _| 1e-300 * (9.0 * t).sin()),
    ];
    for (name, force) in forces {
        let of = |k: f64| table(6.0, |t| [moved(t, k), force(t, k)]);
        let said = said(folder.path(), [of(2.0), of(2.3)]);
        println!("{name}: {said:?}");
        assert!(!matches!(said, Ok("explained")), "{name}: {said:?}");
    }
}

#[test]
fn a_carriage_that_stands_is_not_excited() {
    let folder = tempfile::tempdir().expect("a folder");
    let noise = |t: f64, k: f64| (1e4 * (k * t * 1.618).sin()).fract();
    let of = |k: f64| {
        table(6.0, |t| {
            [1e-7 * noise(t, k).round(), 5.0 + 0.2 * noise(t, k + 1.0)]
        })
    };
    let said = said(folder.path(), [of(2.0), of(3.0)]);
    assert!(matches!(said, Ok("not excited") | Err(_)), "{said:?}");
}
