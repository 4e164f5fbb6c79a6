//! Records of every machine with numbers that no machine has: an answer or a sentence in a bounded time, and never a panic.

use identify::records::{Mapping, OnFault};
use identify::run::Task;
use plant::model::Model;
use std::fmt::Write;
use std::path::Path;
use std::time::{Duration, Instant};

/// An answer may take so long.
const LIMIT: Duration = Duration::from_secs(60);
const RATE: usize = 1000;
const ROWS: usize = 5 * RATE;

/// A way to fill a column: by its number and the row.
type Fill = fn(usize, usize) -> f64;

fn hash(column: usize, row: usize) -> f64 {
    let mixed = ((row * 31 + column) as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    ((mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 11) as f64
        / (1_u64 << 53) as f64
}

fn wave(column: usize, row: usize) -> f64 {
    (0.003 * (column + 1) as f64 * row as f64).sin()
}

const FILLS: [(&str, Fill); 11] = [
    ("nothing", |_, _| 0.0),
    ("a constant", |_, _| 1.5),
    ("one column for all", |_, row| wave(0, row)),
    ("lines", |column, row| 1e-3 * (column + row) as f64),
    ("noise", |column, row| hash(column, row) - 0.5),
    ("no numbers among them", |column, row| match row % 50 {
        7 => f64::NAN,
        _ => wave(column, row),
    }),
    ("no number at all", |_, _| f64::NAN),
    ("infinite ones among them", |column, row| match row % 97 {
        5 => f64::INFINITY,
        9 => f64::NEG_INFINITY,
        _ => wave(column, row),
    }),
    ("the smallest", |column, row| 1e-300 * wave(column, row)),
    ("large ones", |column, row| 150.0 * wave(column, row)),
    ("one peak", |_, row| f64::from(row == ROWS / 2)),
];

const MOTOR: &str = "[motor]\npole_pairs = 4\n";
const AXIS: &str = "[axis]\nmass_kg = 50.0\nviscous_n_s_per_m = 200.0\ncoulomb_n = 20.0\noffset_n = 0.0\nlead_m = 0.01\nlimit_v = 10.0\n";
const LAW: &str = "[constants]\nforce_per_volt_n = { value = 35.0 }\nkp_per_s = { value = 160.0 }\nkv_v_s_per_m = { value = 240.0 }\n";

/// A kind of machine: its name, its columns, its model, and what else its mapping says.
fn machines() -> [(&'static str, Vec<&'static str>, String, &'static str); 5] {
    let double = Model::coupled().to_toml();
    let screw = double.split("[screw]").nth(1).expect("a screw's section");
    let end = screw.find("\n[").unwrap_or(screw.len());
    let pmsm = format!("[motor]{}", &screw[..end]);
    let drive = [
        "screw_angle_rad",
        "nut_angle_rad",
        "screw_ia_a",
        "screw_ib_a",
        "nut_ia_a",
        "nut_ib_a",
        "screw_ud_v",
        "screw_uq_v",
        "nut_ud_v",
        "nut_uq_v",
        "screw_iq_ref_a",
        "nut_iq_ref_a",
        "screw_speed_ref_rad_s",
        "nut_speed_ref_rad_s",
        "table_position_m",
    ];
    [
        ("motor", vec!["position_rad", "current_a"], MOTOR.into(), ""),
        ("feed axis", vec!["position_m", "force_n"], AXIS.into(), ""),
        (
            "feed axis",
            vec!["position_m", "reference_m", "output_v"],
            AXIS.into(),
            LAW,
        ),
        (
            "pmsm",
            vec!["angle_rad", "id_a", "iq_a", "ud_v", "uq_v"],
            pmsm,
            "",
        ),
        ("double drive", drive.to_vec(), double, ""),
    ]
}

/// What is said, in words.
fn said(folder: &Path, machine: usize, fill: Fill) -> String {
    let (name, columns, text, more) = &machines()[machine];
    let model = folder.join("model.toml");
    std::fs::write(&model, text).expect("a folder that can be written");
    let record = |file: &str, shift: usize| {
        let mut csv = format!("t_s,{}\n", columns.join(","));
        for row in 0..ROWS {
            write!(csv, "{}", row as f64 / RATE as f64).expect("a string takes all");
            for column in 0..columns.len() {
                write!(csv, ",{}", fill(column, row + shift)).expect("a string takes all");
            }
            csv.push('\n');
        }
        let path = folder.join(file);
        std::fs::write(&path, csv).expect("a folder that can be written");
        path
    };
    let mapping = format!("machine = \"{name}\"\nsample_hz = {RATE}.0\n{more}");
    let task = Task {
        model,
        fit: vec![record("fit.csv", 0)],
        check: vec![record("check.csv", 12_345)],
        mapping: Mapping::parse(&mapping, "mapping").expect("a mapping"),
        on_fault: OnFault::Skip,
    };
    match task.run(&mut |_, _| ()) {
        Ok(done) => done.report.verdict.to_owned(),
        Err(error) => error.to_string(),
    }
}

#[test]
fn any_numbers_have_an_answer_in_time() {
    let folder = tempfile::tempdir().expect("a folder");
    for machine in 0..machines().len() {
        for (name, fill) in FILLS {
            let start = Instant::now();
            let said = said(folder.path(), machine, fill);
            let took = start.elapsed();
            let own = machines()[machine].0;
            println!("{own}, {name}: {said} ({:.1} s)", took.as_secs_f64());
            assert!(
                took < LIMIT,
                "{own}, {name}: {took:?}, expected less than {LIMIT:?}"
            );
            assert!(
                !matches!(&said[..], "explained" | "nothing missing"),
                "{own}, {name}: {said}, and there is nothing that moves as a machine does"
            );
        }
    }
}
