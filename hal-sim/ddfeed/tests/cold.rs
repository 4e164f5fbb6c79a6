//! From cold to a recording that `identify` explains, by commands alone: a machine of which the drive knows a rough datasheet, and
//! nobody an effect.

mod served;

use plant::model::{EncoderKind, Model};
use plant::recording::Recording;
use served::{Served, ddfeed};
use std::f64::consts::{PI, TAU};
use std::fs;
use std::path::Path;
use std::process::Command;

/// Runs it, expects success, and gives what was printed.
#[track_caller]
fn printed(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {said}");
    String::from_utf8(output.stdout).unwrap()
}

/// The machine: the coupled one, whose friction holds its load, with a screw that cogs. Its encoders have an index: without one, the
/// phase of an order that is no multiple of the pole pairs would be lost in the restart.
fn machine() -> String {
    let mut model = Model::coupled();
    model.feed.load_n = 40.0;
    model.sensing.encoder = EncoderKind::Index;
    model.sensing.encoder_counts_per_turn = 1 << 20;
    for motor in [&mut model.screw, &mut model.nut] {
        motor.torque_harmonics.clear();
    }
    model.to_toml()
        + "\n[[effects]]\nkind = \"cogging\"\nwhere = \"screw\"\norder = 36\namplitude = 0.03\nphase = 0.4\n"
}

/// What is known of it: resistance and inductance to a fifth, the voltage constant to a tenth, inertia to a half. The heartbeat
/// allows for a computer that is busy: the drive's time goes faster than the host's.
const ROUGH: &str = "[screw]\nresistance_phase_ohm = 2.0\ninductance_phase_mh = 5.0\n\
    voltage_constant_v_rms_per_krpm = 52.0\ninertia_kg_cm2 = 10.0\nencoder_direction = \"unknown\"\n\
    [nut]\nresistance_phase_ohm = 1.4\ninductance_phase_mh = 7.0\n\
    voltage_constant_v_rms_per_krpm = 63.0\ninertia_kg_cm2 = 5.0\n\
    [command]\nheartbeat_ms = 5000\n";

#[test]
fn from_cold_to_the_effect_that_nobody_knew() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("real.toml"), machine()).unwrap();
    fs::write(path("rough.toml"), ROUGH).unwrap();
    let [real, rough] = ["real.toml", "rough.toml"].map(|name| path(name).display().to_string());
    let served = Served::new(&[
        "--cold",
        "--speed",
        "4",
        "--model",
        &real,
        "--settings",
        &rough,
    ]);
    let drive = |arguments: &[&str], out: &Path| printed(served.command(arguments).arg(out));

    let report = drive(&["commission", "--arm", "--out"], &path("found"));
    each_step_is_told(&report, &path("found"));
    found_is_real(&path("found").join("model.toml"), &path("real.toml"));

    let holds = [
        "--hold",
        "2.5,0,2",
        "--hold=-2.5,0,2",
        "--hold",
        "2.5,300,2",
        "--hold=-5,300,2",
        "--hold",
        "8,600,2",
        "--hold",
        "2.5,150,2",
        "--hold=-2.5,-300,2",
    ];
    drive(
        &[&["record", "--arm", "--name", "fit"], &holds[..]].concat(),
        &path("rec"),
    );
    let holds = ["--hold", "3.5,0,2", "--hold=-2,200,2", "--hold", "6,450,2"];
    drive(
        &[&["record", "--arm", "--name", "check"], &holds[..]].concat(),
        &path("rec"),
    );

    let said = printed(
        ddfeed()
            .args(["identify", "--model"])
            .arg(path("found").join("model.toml"))
            .arg("--fit")
            .arg(path("rec").join("fit.csv.gz"))
            .arg("--check")
            .arg(path("rec").join("check.csv.gz"))
            .arg("--out")
            .arg(path("out")),
    );
    assert!(!said.contains("Not excited"), "{said}");
    let line = said
        .lines()
        .find(|line| line.starts_with("cogging at screw"));
    assert!(line.is_some_and(|line| line.contains("order 36")), "{said}");

    // What was found is compensated, at the rotor's angle: the encoder has another zero.
    printed(
        ddfeed()
            .args(["compensate", "--lumped", "--model"])
            .arg(path("out").join("model.toml"))
            .arg("--settings")
            .arg(path("known.toml")),
    );
    let hold = ["record", "--arm", "--hold", "2.5,100,4", "--name"];
    drive(&[&hold[..], &["before"]].concat(), &path("rec"));
    drive(&["settings", "import", "--yes"], &path("known.toml"));
    let said = drive(&[&hold[..], &["after"]].concat(), &path("rec"));
    assert!(
        said.contains("% peak to peak (Eq 19)"),
        "no ripple is printed: {said}"
    );
    drop(served);
    let ripple = |name: &str| ripple(&path("rec").join(format!("{name}.csv.gz")));
    let (before, after) = (ripple("before"), ripple("after"));
    assert!(
        after < 0.5 * before,
        "order 36 of the screw in its speed: {after:.4} rad/s compensated, {before:.4} before"
    );
}

/// What commissioning prints has each step, and its report how long each took.
fn each_step_is_told(report: &str, found: &Path) {
    for step in [
        "start",
        "electrical",
        "mechanical",
        "tuning",
        "angle",
        "response",
    ] {
        assert!(
            report.contains(&format!("## {step}")),
            "no step {step}: {report}"
        );
    }
    // A step restarts the drive, and its clock: 17 s of the start had become -12 s of the next step.
    let steps = fs::read_to_string(found.join("report.json")).unwrap();
    let steps: Vec<serde_json::Value> = serde_json::from_str(&steps).unwrap();
    for (step, least_s) in steps.iter().zip([1.0, 1.0, 1.0, 0.0, 1.0, 1.0]) {
        let seconds = step["seconds"].as_f64().unwrap();
        assert!((least_s..60.0).contains(&seconds), "{seconds} s: {step}");
    }
}

/// The model that was found is the machine's within 5 %.
fn found_is_real(found: &Path, real: &Path) {
    let found = Model::load(found).unwrap();
    let real = Model::load(real).unwrap();
    for (name, measured, truth) in [
        (
            "screw's resistance",
            found.screw.resistance_ohm,
            real.screw.resistance_ohm,
        ),
        (
            "nut's inductance",
            found.nut.inductance_h,
            real.nut.inductance_h,
        ),
        ("screw's flux", found.screw.flux_wb, real.screw.flux_wb),
        (
            "screw's inertia",
            found.screw.inertia_kg_m2,
            real.screw.inertia_kg_m2,
        ),
        (
            "nut's inertia",
            found.nut.inertia_kg_m2,
            real.nut.inertia_kg_m2,
        ),
    ] {
        let off = 100.0 * (measured / truth - 1.0);
        assert!(
            off.abs() < 5.0,
            "{name}: measured {measured:e}, true {truth:e}, {off:.1} % off"
        );
    }
}

/// Amplitude of order 36 of the screw's angle in its own speed, rad/s, over the second half of a recording.
fn ripple(path: &Path) -> f64 {
    let recording = Recording::load(path).unwrap();
    let samples: Vec<_> = recording.samples().skip(recording.len() / 2).collect();
    let (mut re, mut im, mut mean) = (0.0_f64, 0.0, 0.0);
    let speeds: Vec<(f64, f64)> = samples
        .windows(5)
        .map(|five| {
            let [first, last] = [&five[0], &five[4]];
            let turned = last.axes[0].angle_rad - first.axes[0].angle_rad;
            let turned = (turned + PI).rem_euclid(TAU) - PI;
            (
                five[2].axes[0].angle_rad,
                turned / (last.time_s - first.time_s),
            )
        })
        .collect();
    for (_, speed) in &speeds {
        mean += speed / speeds.len() as f64;
    }
    for (angle, speed) in &speeds {
        re += (speed - mean) * (36.0 * angle).cos();
        im += (speed - mean) * (36.0 * angle).sin();
    }
    2.0 * re.hypot(im) / speeds.len() as f64
}
