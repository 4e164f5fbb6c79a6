//! `ddfeed simulate literature` against closed forms, and against what the papers' abstracts claim.

use serde_json::Value;
use std::f64::consts::TAU;
use std::process::Command;
use std::sync::LazyLock;

/// The report of one run, which all tests read.
static REPORT: LazyLock<Value> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_ddfeed"))
        .current_dir(folder.path())
        .args(["simulate", "literature"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let printed = String::from_utf8_lossy(&output.stdout);
    for paper in [
        "ms-12-791-2021",
        "3915600",
        "0036850419875667",
        "1687814018774628",
        "00368504211031387",
    ] {
        assert!(printed.contains(paper), "no {paper} in:\n{printed}");
    }
    let out = folder.path().join("out/literature");
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert_eq!(page.matches("<svg class=\"plot\"").count(), 6, "charts");
    let report = std::fs::read_to_string(out.join("report.json")).unwrap();
    serde_json::from_str(&report).unwrap()
});

/// Lead of the paper's screw, m/rad; inertia at a shaft with the table, kg m2.
const R: f64 = 0.005 / TAU;
const INERTIA: f64 = 7.0e-4 + 20.0 * R * R;

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is no number"))
}

#[track_caller]
fn near(measured: f64, expected: f64, part: f64) {
    assert!(
        (measured / expected - 1.0).abs() < part,
        "measured {measured}, expected {expected} within {part}"
    );
}

/// The case of a list with these values.
fn case<'a>(of: &'a Value, wanted: &[(&str, Value)]) -> &'a Value {
    let cases = of.as_array().unwrap();
    let fits = |case: &&Value| wanted.iter().all(|(key, value)| case[key] == *value);
    cases
        .iter()
        .find(fits)
        .unwrap_or_else(|| panic!("no {wanted:?}"))
}

/// The faster of the two velocities, m/s, at which friction falls with the speed as steeply as the speed loop damps.
fn critical_velocity(speed_rad_s: f64) -> f64 {
    let damping = 2.0 * 0.7 * speed_rad_s * INERTIA + 4.0e-4 + 400.0 * R * R;
    let (sticks, stribeck) = (0.04 + 0.5 * 20.0 * R, 2e-4 / R);
    let falls = |x: f64| 2.0 * sticks / stribeck * x * (-x * x).exp();
    // Beyond the steepest place it only gets flatter.
    let (mut steep, mut flat) = (0.5_f64.sqrt(), 5.0);
    assert!(falls(steep) > damping, "no velocity is critical");
    for _ in 0..60 {
        let middle = 0.5 * (steep + flat);
        *(if falls(middle) > damping {
            &mut steep
        } else {
            &mut flat
        }) = middle;
    }
    2e-4 * flat
}

/// Wang et al. 2021: the double drive has the lower stable velocity.
#[test]
fn the_double_drive_creeps_where_the_single_drive_sticks() {
    let cases = &REPORT["creep"]["cases"];
    let lowest = |nut_rpm: f64, speed_rad_s: f64| {
        let wanted = [
            ("nut_rpm", nut_rpm.into()),
            ("speed_rad_s", speed_rad_s.into()),
        ];
        number(&case(cases, &wanted)["lowest_mm_s"])
    };
    let single = lowest(0.0, 50.0);
    near(single, 1e3 * critical_velocity(50.0), 0.1);
    near(number(&REPORT["creep"]["critical_mm_s"]), single, 0.1);
    for nut_rpm in [30.0, 100.0, 300.0] {
        let double = lowest(nut_rpm, 50.0);
        assert!(
            double < 0.25 * single,
            "{double} mm/s at {nut_rpm} rpm, single {single}"
        );
    }
    // A stiffer loop needs no double drive for this friction.
    assert!(lowest(0.0, 200.0) < 0.25 * single);
}

#[test]
fn a_sine_is_followed_as_the_integrators_let_it() {
    let cases = &REPORT["tracking"]["cases"];
    let of = |nut_rpm: f64, fed_forward: bool, what: &str| {
        let wanted = [
            ("nut_rpm", nut_rpm.into()),
            ("fed_forward", fed_forward.into()),
        ];
        number(&case(cases, &wanted)[what])
    };
    let level = |share: f64, coulomb: f64| {
        let fastest: f64 = TAU * 0.2 * 50e-6 / 2e-4;
        coulomb * (1.0 + share * (-fastest * fastest).exp())
    };
    let (bearing, feed) = (level(1.0, 0.04), 0.03 + level(0.5, 20.0) * R);
    let integral = INERTIA * 200.0 * 200.0;
    let elastic = 0.04 * R / 2e-6;
    let single = R * ((bearing + feed) / integral + feed / (integral + elastic));
    near(of(0.0, false, "peak_um"), 1e6 * single, 0.15);
    let double = R * 2.0 * feed / integral;
    near(of(300.0, false, "peak_um"), 1e6 * double, 0.15);
    for nut_rpm in [0.0, 100.0, 300.0] {
        let [unknown, known] = [false, true].map(|forward| of(nut_rpm, forward, "rms_um"));
        assert!(
            known < 0.4 * unknown,
            "{known} um known, {unknown} um unknown"
        );
    }
    assert!(of(300.0, true, "rms_um") < of(0.0, true, "rms_um"));
}

#[test]
fn losses_are_torque_times_speed_and_squares_of_currents() {
    let warmth = &REPORT["warmth"];
    let points = warmth["points"].as_array().unwrap();
    let total = |point: &Value| {
        let copper = &point["copper_w"];
        number(&copper[0]) + number(&copper[1]) + number(&point["friction_w"])
    };
    let (velocity, relative) = (2.5e-3, 2.5e-3 / R);
    for point in points {
        let base = number(&point["nut_rpm"]) * TAU / 60.0;
        let bearing = |speed: f64| (0.04 + 4.0e-4 * speed) * speed;
        let guideway = (20.0 + 400.0 * velocity) * velocity;
        let friction = bearing(base + relative) + bearing(base) + 0.03 * relative + guideway;
        near(number(&point["friction_w"]), friction, 0.02);
        // All that the screw pushes, through 0.55 N m/A of current.
        let torque =
            (400.0 + 20.0 + 400.0 * velocity) * R + 0.03 + 0.04 + 4.0e-4 * (base + relative);
        near(
            number(&point["copper_w"][0]),
            1.7 * (torque / 0.55).powi(2),
            0.1,
        );
    }
    // The nut's bearing and motor are two more sources of heat.
    let (first, last) = (total(&points[0]), total(&points[points.len() - 1]));
    assert!(
        last > 2.0 * first,
        "{last} W at the fastest, {first} W at rest"
    );
    for (ripple, proposed) in [
        ("vrf_percent", "proposed"),
        ("compensated_percent", "compensated"),
    ] {
        let smallest = points
            .iter()
            .map(|point| number(&point[ripple]))
            .reduce(f64::min);
        let limit = 1.1 * smallest.unwrap();
        let smooth = points
            .iter()
            .filter(|point| number(&point[ripple]) <= limit);
        let coolest = smooth.min_by(|a, b| total(a).total_cmp(&total(b))).unwrap();
        assert_eq!(
            warmth[proposed]["nut_rpm"], coolest["nut_rpm"],
            "{proposed}"
        );
    }
}

#[test]
fn cross_coupling_stiffens_the_table() {
    let cases = &REPORT["switching"]["cases"];
    let of = |share: f64, what: &str| {
        let wanted = [("nut_rpm", 300.0.into()), ("share", share.into())];
        number(&case(cases, &wanted)[what])
    };
    let integral = INERTIA * 200.0 * 200.0;
    for share in [0.0, 0.5] {
        let moved = 1e6 * R * 0.3 / (integral * (1.0 + 2.0 * share));
        near(of(share, "moved_um"), moved, 0.05);
    }
    assert!(of(0.5, "rms_um") < 0.55 * of(0.0, "rms_um"));
    // The paper reports 45 % against a single drive, with more than a coupling.
    let less = number(&REPORT["switching"]["less_percent"][1]);
    assert!(
        (25.0..45.0).contains(&less),
        "{less} % less than the single drive"
    );
    assert!(of(0.5, "peak_mm_s") < 0.8 * of(0.0, "peak_mm_s"));
}

#[test]
fn the_screw_twists_at_a_quarter_of_a_wave() {
    let torsion = &REPORT["torsion"];
    let held = (79.3e9_f64 / 7850.0).sqrt() / 4.0;
    near(number(&torsion["held_hz"][0]), held, 0.015);
    let mode = 8.0 / (TAU / 2.0).powi(2) * 7850.0 * TAU / 64.0 * 0.02_f64.powi(4);
    let free = held * (1.0 + mode / (7.0e-4 - mode)).sqrt();
    near(number(&torsion["free_hz"][0]), free, 0.02);
    let ripples = torsion["ripples"].as_array().unwrap();
    let [rigid, twists] = [0, 1].map(|k: usize| number(&ripples[0]["vrf_percent"][k]));
    near(twists, rigid, 0.05);
}
