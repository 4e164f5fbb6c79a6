//! `drive` against `serve`, each as a person runs it, over TCP and over a pseudo-terminal.

mod served;

use plant::Axis;
use plant::model::EncoderKind;
use serde_json::Value;
use served::{Served, ddfeed};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is no number"))
}

/// The whole of it, on either line.
fn session(served: &Served) {
    let status = served.status();
    for (part, limit) in [
        ("screw", "speed_rpm"),
        ("nut", "torque_nm"),
        ("table", "velocity_mm_s"),
    ] {
        assert!(status[part]["fault"].is_null(), "{status}");
        assert!(number(&status[part]["limits"][limit]) > 0.0, "{status}");
    }
    assert_eq!(status["armed"], false);

    let said = served.fails(3, &["jog", "--table-speed", "2"]);
    assert!(said.contains("not armed"), "{said}");
    served.printed(&["arm"]);
    served.printed(&[
        "jog",
        "--table-speed",
        "2",
        "--nut-rpm",
        "200",
        "--duration",
        "0.3",
    ]);
    let said = served.fails(3, &["jog", "--arm", "--table-speed", "200"]);
    assert!(said.contains("feed.velocity_max_mm_s"), "{said}");
    served.printed(&["stop"]);

    let moved = served.printed(&["move", "-1.5", "--arm", "--nut-rpm", "300", "--json"]);
    let moved: Value = serde_json::from_str(&moved).unwrap();
    let off = number(&moved["moved_mm"]) + 1.5;
    assert!(off.abs() < 0.005, "{off} mm off: {moved}");
    assert_eq!(served.status()["state"], "ready");
}

#[test]
fn a_session_over_tcp() {
    session(&Served::new(&[]));
}

#[test]
#[cfg(unix)]
fn a_session_over_a_pseudo_terminal() {
    session(&Served::new(&["--pty"]));
}

#[test]
fn faults_are_named_with_their_code_and_left() {
    let served = Served::new(&[]);
    let jog = served
        .command(&["jog", "--arm", "--table-speed", "3", "--nut-rpm", "400"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    served.until("running");
    sleep(Duration::from_millis(600));
    served.printed(&["inject", "encoder-frozen", "--motor", "nut"]);
    let output = jog.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(4));
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("encoder, nut"), "{said}");
    let status = served.status();
    assert_eq!(status["nut"]["fault"]["name"], "encoder, nut");
    assert!(status["screw"]["fault"].is_null());
    let faults: Value = serde_json::from_str(&served.printed(&["faults", "--json"])).unwrap();
    assert_eq!(faults["last"][0]["fault"]["name"], "encoder, nut");
    served.fails(3, &["arm"]);
    let said = served.fails(1, &["inject", "bus"]);
    assert!(said.contains("0 to 1000 V"), "{said}");
    let said = served.fails(1, &["inject", "gremlins"]);
    assert!(said.contains("encoder-slip"), "{said}");
}

/// What a first user types wrongly: the answer has the value, what is possible, and the option or setting.
#[test]
fn wrong_input_is_answered_with_what_is_possible() {
    let served = Served::new(&[]);
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (recorded, nowhere) = (path("r"), path("none/x.toml"));
    served.printed(&["record", &recorded, "--duration", "0.2"]);
    for (code, arguments, expected) in [
        (
            3,
            &["settings", "set", "--yes", "alignment.travel_um=1000"][..],
            "0.2 turns, but 0.0001 to 0.1 turns are possible",
        ),
        (
            3,
            &["settings", "set", "--yes", "screw.torque_max_nm=1000"],
            "times too large for the drive's number format",
        ),
        (
            1,
            &["settings", "set", "screw.resistance_ohm=1"],
            "screw.resistance_phase_ohm",
        ),
        (
            1,
            &["settings", "set", "brake.fited=on"],
            "the nearest are brake.fitted,",
        ),
        (
            1,
            &["settings", "set", "feed.lead_mm=5", "feed.lead_mm=6"],
            "set the same",
        ),
        (1, &["settings", "export", &nowhere], "there is no folder"),
        (
            1,
            &["jog", "--nut-rpm", "99999"],
            "--nut-rpm is 99999 rpm, but -78228 to 78228 rpm",
        ),
        (1, &["jog", "--duration", "-1"], "--duration is -1 s"),
        (
            1,
            &["move", "0"],
            "the distance is 0 mm, but up to 10000 mm",
        ),
        (1, &["move", "1e30"], "mm, but up to 10000 mm"),
        (
            1,
            &["move", "1", "--table-speed", "-1"],
            "--table-speed is -1 mm/s",
        ),
        (
            1,
            &["record", &recorded, "--name", "other"],
            "how long to record is not said",
        ),
        (
            1,
            &["record", &recorded, "--duration", "0.2"],
            "is there already: give another --name, or --replace",
        ),
        (
            1,
            &["inject", "load", "--amount", "1e9"],
            "load has -100000 to 100000 N",
        ),
        (
            1,
            &["commission", "--arm", "--travel", "-5"],
            "--travel is -5 mm, but 0.1 to 1000 mm",
        ),
    ] {
        let said = served.fails(code, arguments);
        assert!(said.contains(expected), "{arguments:?} said:\n{said}");
    }
    assert!(!folder.path().join("none").exists());
    served.printed(&["record", &recorded, "--duration", "0.2", "--replace"]);
    assert!(
        served
            .printed(&["inject", "list"])
            .contains("load -100000 to 100000 N")
    );
    served.printed(&["settings", "set", "--yes", "brake.fitted=yes"]);
    assert!(
        served
            .printed(&["settings", "get", "brake.fitted"])
            .contains("= on")
    );
}

/// The ripple of a recording is what `record` printed; the page draws each hold, and the names of orders are of the nut's speed.
#[test]
fn the_ripple_of_a_recording_is_printed_and_drawn() {
    let served = Served::new(&[]);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    let printed = served.printed(&["record", &out, "--arm", "--hold", "5,300,2"]);
    let figures = printed.split_once("rpm:").unwrap().1.trim();
    let recording = folder.path().join("record.csv.gz");
    let ripple = |more: &[&str]| {
        let output = ddfeed()
            .arg("ripple")
            .arg(&recording)
            .args(more)
            .output()
            .unwrap();
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let said = ripple(&["--out", &out]);
    assert!(said.contains(figures), "{said}\nrecord printed {figures}");
    assert!(said.contains("order 30 of the"), "{said}");
    let page = std::fs::read_to_string(folder.path().join("ripple.html")).unwrap();
    assert_eq!(page.matches("<svg").count(), 2);
    let report: Value = serde_json::from_str(&ripple(&["--json"])).unwrap();
    assert_eq!(
        report["holds"][0]["nut_rpm"].as_f64().unwrap().round(),
        300.0
    );
    assert!(report["holds"][0]["lines"][0]["hz"].is_number(), "{report}");
}

/// A scale whose own step is much of the ripple: `record` says how much of it, and what of the model is a guess.
#[test]
fn a_recording_says_what_the_scale_makes_and_what_is_guessed() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let mut model = plant::model::Model::coupled();
    model.installation.scale_count_m = 3e-7;
    std::fs::write(path("mine.toml"), model.to_toml()).unwrap();
    let served = Served::new(&["--model", &path("mine.toml")]);
    let output = served.drive(&["record", &path("rec"), "--arm", "--hold", "2.5,300,1"]);
    let [printed, said] =
        [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(
        printed.ends_with(
            "one count of the scale alone, 0.300 um in 1.0 ms, makes 12.00 % of 2.500 mm/s\n"
        ),
        "{printed}"
    );
    assert!(
        said.contains("load and friction of") && said.contains("are guesses: correct them"),
        "{said}"
    );
}

#[test]
fn a_simulated_drive_says_where_its_settings_are_from() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml").display().to_string();
    std::fs::write(&file, "[feed]\nvelocity_max_mm_s = 41\n").unwrap();
    let served = Served::new(&["--settings", &file]);
    let said = served.printed(&["status"]);
    assert!(
        said.contains("that it was started with, of `serve --settings`"),
        "{said}"
    );
}

/// A recording does not write over a model that a person has put beside it.
#[test]
fn a_recording_keeps_the_model_of_a_person() {
    let served = Served::new(&[]);
    let folder = tempfile::tempdir().unwrap();
    let (out, model) = (
        folder.path().display().to_string(),
        folder.path().join("model.toml"),
    );
    std::fs::write(&model, "# Mine.\n").unwrap();
    served.printed(&["record", &out, "--duration", "0.2"]);
    assert_eq!(std::fs::read_to_string(&model).unwrap(), "# Mine.\n");
}

#[test]
fn settings_go_out_and_in_all_or_none() {
    let served = Served::new(&[]);
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let file = path("drive.toml");
    served.printed(&["settings", "export", &file]);
    let said = served.fails(1, &["settings", "export", &file]);
    assert!(said.contains("is there already"), "{said}");
    assert!(
        served
            .printed(&["settings", "diff", &file])
            .contains("nothing differs")
    );

    let wrong = path("wrong.toml");
    std::fs::write(&wrong, "[feed]\nlead_mm = 10\n[nut]\npole_pairs = 1.5\n").unwrap();
    let said = served.fails(1, &["settings", "import", &wrong]);
    assert!(said.contains("nut.pole_pairs is 1.5, but whole"), "{said}");
    let unfit = [
        "settings",
        "set",
        "--yes",
        "feed.lead_mm=10",
        "nut.resistance_phase_ohm=80",
    ];
    let said = served.fails(3, &unfit);
    assert!(
        said.contains("nut.resistance_line_to_line_ohm = 160 does not fit")
            && said.contains("It fits with 3.4 ohm"),
        "{said}"
    );
    assert!(
        served
            .printed(&["settings", "diff", &file])
            .contains("nothing differs")
    );

    served.printed(&[
        "settings",
        "set",
        "--yes",
        "feed.lead_mm=10",
        "nut.torque_constant_nm_per_a_rms=0.9",
    ]);
    let now: Value =
        serde_json::from_str(&served.printed(&["settings", "get", "--json", "feed.lead"])).unwrap();
    assert_eq!(now["feed.lead_mm"], 10.0);
    let ke = "nut.voltage_constant_v_rms_per_krpm";
    let kt = "nut.torque_constant_nm_per_a_rms";
    let now = served.printed(&["settings", "get", "--json", kt, ke]);
    let now: Value = serde_json::from_str(&now).unwrap();
    assert!((number(&now[kt]) - 0.9).abs() < 1e-9, "{now}");
    // Kt = sqrt(3) * 60 / (2 pi) * Ke of a sinusoidal motor.
    let expected = 0.9 * std::f64::consts::TAU * 1000.0 / 60.0 / 3f64.sqrt();
    assert!((number(&now[ke]) - expected).abs() < 1e-6, "{now}");
    let diff = served.printed(&["settings", "diff", &file]);
    assert!(diff.contains("feed.lead_mm: 10 -> 5"), "{diff}");
    served.printed(&["settings", "import", "--yes", &file]);
    assert!(
        served
            .printed(&["settings", "diff", &file])
            .contains("nothing differs")
    );

    let model = path("model.toml");
    served.printed(&["settings", "model", &model]);
    let model = plant::model::Model::load(Path::new(&model)).unwrap();
    assert!((model.screw.resistance_ohm - 1.7).abs() < 1e-9, "{model:?}");
    // The served board's encoders: one that knows its angle, and one with an index.
    let kinds = Axis::ALL.map(|axis| model.sensing.encoder_kind(axis));
    assert_eq!(kinds, [EncoderKind::Absolute, EncoderKind::Index]);
}

/// A drive that compensates a dead time has bridges with that dead time. Simulated without it, what was compensated in excess
/// stopped the drive by a fault.
#[test]
fn what_a_drive_compensates_its_simulated_bridges_have() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (model, drive) = (path("model.toml"), path("drive.toml"));
    std::fs::write(&model, plant::model::Model::coupled().to_toml()).unwrap();
    let before = |dead_time_ns: &str| {
        std::fs::write(&drive, format!("[bridge]\ndead_time_ns = {dead_time_ns}\n")).unwrap();
        let output = ddfeed()
            .args(["compensate", "--model", &model, "--drive", &drive])
            .args(["--nut-rpm", "300", "--json"])
            .output()
            .unwrap();
        assert!(output.status.success(), "{dead_time_ns} ns: {output:?}");
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        report["predicted"][0]["rms_before"].as_f64().unwrap()
    };
    let (none, some) = (before("0.0"), before("400.0"));
    assert!(
        (some / none - 1.0).abs() < 0.2,
        "{none} % without, {some} % with a dead time"
    );
}

/// What a model knows of a machine goes into the drive by commands alone.
#[test]
fn what_a_model_knows_becomes_settings() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (model, file) = (path("model.toml"), path("smooth.toml"));
    std::fs::write(&model, plant::model::Model::coupled().to_toml()).unwrap();
    let compensate = || {
        ddfeed()
            .args(["compensate", "--model", &model, "--nut-rpm", "300"])
            .args(["--settings", &file])
            .output()
            .unwrap()
    };
    let output = compensate();
    assert!(output.status.success(), "{output:?}");
    let again = compensate();
    let said = String::from_utf8_lossy(&again.stderr).into_owned();
    assert!(said.contains("is there already"), "{said}");

    let served = Served::new(&[]);
    served.printed(&["settings", "import", "--yes", &file]);
    let now: Value = serde_json::from_str(&served.printed(&[
        "settings",
        "get",
        "--json",
        "screw_torque",
        "feed_friction",
    ]))
    .unwrap();
    // The paper's motors: 6 and 12 times an electrical turn of five pole pairs, and the table's friction.
    let orders = [1, 2].map(|k| now[format!("screw_torque.order_{k}")].as_f64().unwrap());
    assert_eq!(orders, [30.0, 60.0], "{now}");
    let size = now["screw_torque.re_1_a"]
        .as_f64()
        .unwrap()
        .hypot(now["screw_torque.im_1_a"].as_f64().unwrap());
    assert!(size > 0.01, "{size} A of the first order");
    assert!(
        now["feed_friction.coulomb_nm"].as_f64().unwrap() > 0.0,
        "{now}"
    );
}

/// A command that gives no base speed takes that of the drive's table, which a file or a person sets.
#[test]
fn the_drive_s_table_gives_the_base_speed() {
    // Two hosts at a time: at ten times the speed the drive's patience with a command is 50 ms of a busy computer.
    let served = Served::new(&["--speed", "2"]);
    served.printed(&[
        "settings",
        "set",
        "--yes",
        "base.table_1_mm_s=2",
        "base.nut_1_rpm=300",
        "base.table_2_mm_s=20",
        "base.nut_2_rpm=0",
    ]);
    served.until("ready");
    // Ripple is less than a tenth of that.
    for (arguments, nut_rpm) in [
        (&["--table-speed", "1"][..], 300.0),
        (&["--table-speed", "-2"], 300.0),
        (&["--table-speed", "5"], 0.0),
        (&["--table-speed", "1", "--nut-rpm", "500"], 500.0),
    ] {
        let mut jog = vec!["jog", "--arm", "--duration", "2"];
        jog.extend(arguments);
        let mut jogging = served.command(&jog).stdout(Stdio::null()).spawn().unwrap();
        sleep(Duration::from_millis(1200));
        let status = served.printed(&["status", "--json"]);
        let status: Value = serde_json::from_str(&status).unwrap();
        let rpm = number(&status["nut"]["speed_rpm"]);
        assert!(
            (rpm - nut_rpm).abs() < 30.0,
            "jog {arguments:?}: the nut turns at {rpm} rpm, expected {nut_rpm} within 30"
        );
        assert!(jogging.wait().unwrap().success());
        served.until("ready");
    }
    let said = served.fails(3, &["settings", "set", "base.table_3_mm_s=10"]);
    assert!(said.contains("table velocity of a base speed"), "{said}");
}

/// A setting that needs a restart says what is lost and asks; one that needs none restarts nothing.
#[test]
fn a_restart_is_announced_and_a_setting_without_one_keeps_the_homed_position() {
    let served = Served::new(&[]);
    served.printed(&["home", "--arm"]);
    served.printed(&[
        "settings",
        "set",
        "base.table_1_mm_s=5",
        "base.nut_1_rpm=100",
    ]);
    served.printed(&["settings", "set", "travel.home_velocity_mm_s=20"]);
    served.printed(&["settings", "set", "travel.soft_most_mm=60"]);
    served.printed(&["settings", "set", "feed.jerk_max_mm_s3=9000"]);
    assert_eq!(served.status()["table"]["homed"], true);
    let said = served.fails(1, &["settings", "set", "compensation.learning_s=0.5"]);
    assert!(
        said.contains("compensation.learning_s: takes effect when the drive restarts")
            && said.contains("the homed position")
            && said.contains("--yes"),
        "{said}"
    );
    assert_eq!(served.status()["table"]["homed"], true);
    served.printed(&["settings", "set", "--yes", "compensation.learning_s=0.5"]);
    assert_eq!(served.status()["table"]["homed"], false);
}

/// A position needs a homed drive; once it has one, the table goes there.
#[test]
fn a_homed_table_moves_to_a_position() {
    let served = Served::new(&[]);
    let said = served.fails(3, &["move", "--to", "1", "--arm"]);
    assert!(said.contains("not known: `home` finds it"), "{said}");
    served.printed(&["home", "--arm"]);
    let to = ["move", "--to", "1.25", "--arm", "--json"];
    let moved: Value = serde_json::from_str(&served.printed(&to)).unwrap();
    let off = number(&moved["position_mm"]) - 1.25;
    assert!(off.abs() < 0.005, "{off} mm off: {moved}");
    let said = served.fails(2, &["move", "1", "--to", "1"]);
    assert!(said.contains("--to"), "{said}");
    let said = served.fails(1, &["move", "--to", "1e9"]);
    assert!(said.contains("--to is 1000000000 mm"), "{said}");
}

/// Speeds of screw and nut, rpm: once they are within 5 rpm of these, or after 3 s. A busy computer is slower than the drive's time,
/// and encoder errors make the measured speed ripple.
fn settled_rpm(served: &Served, asked: [f64; 2]) -> [f64; 2] {
    let end = Instant::now() + Duration::from_secs(3);
    loop {
        let status = served.status();
        let now = ["screw", "nut"].map(|motor| number(&status[motor]["speed_rpm"]));
        let near = now
            .iter()
            .zip(asked)
            .all(|(now, asked)| (now - asked).abs() < 5.0);
        if near || Instant::now() > end {
            return now;
        }
        sleep(Duration::from_millis(50));
    }
}

/// Each motor turns while the other rests; the screw turns by an angle.
#[test]
fn one_motor_turns_while_the_other_rests() {
    let served = Served::new(&[]);
    for (motor, rpm, speeds) in [("screw", "120", [120.0, 0.0]), ("nut", "-90", [0.0, -90.0])] {
        let turn = [
            "turn",
            "--motor",
            motor,
            "--rpm",
            rpm,
            "--arm",
            "--duration",
            "4",
        ];
        let mut turning = served.command(&turn).stdout(Stdio::null()).spawn().unwrap();
        served.until("running");
        let now = settled_rpm(&served, speeds);
        let near = now
            .iter()
            .zip(speeds)
            .all(|(now, asked)| (now - asked).abs() < 5.0);
        assert!(near, "screw and nut at {now:?} rpm");
        assert!(turning.wait().unwrap().success());
        served.until("ready");
    }
    // A quarter of a turn of 5 mm.
    let before = number(&served.status()["table"]["position_mm"]);
    let said = served.printed(&["turn", "--angle", "-90", "--arm"]);
    let moved: f64 = said
        .split_once("moved ")
        .and_then(|(_, rest)| rest.split_whitespace().next()?.parse().ok())
        .unwrap_or_else(|| panic!("{said}"));
    assert!((moved + 1.25).abs() < 0.005, "{moved} mm");
    // The motors no longer carry the load once their bridges are open: friction springs back by 2 to 24 um, before and after.
    let moved = number(&served.status()["table"]["position_mm"]) - before;
    assert!((moved + 1.25).abs() < 0.05, "{moved} mm");
    for (code, arguments, expected) in [
        (
            1,
            &["turn", "--motor", "nut", "--angle", "90"][..],
            "--angle is for the screw",
        ),
        (1, &["turn", "--angle", "0"], "--angle is 0 degrees"),
        (
            3,
            &["turn", "--rpm", "1300", "--arm"],
            "feed.velocity_max_mm_s",
        ),
    ] {
        let said = served.fails(code, arguments);
        assert!(said.contains(expected), "{arguments:?} said:\n{said}");
    }
}

/// Positions of a file and of a pipe: the table follows them, and the command says how far it was behind.
#[test]
fn a_table_follows_positions_of_a_file_and_of_a_pipe() {
    let served = Served::new(&[]);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("way.csv");
    // 1 mm to either side and back, at 200 Hz.
    let mut way = String::from("time_s,position_mm\n");
    for k in 0..=400 {
        let seconds = 5e-3 * f64::from(k);
        let position = 7.0 + 1.0 - (std::f64::consts::PI * seconds).cos();
        way += &format!("{seconds:.3},{position:.6}\n");
    }
    std::fs::write(&file, &way).unwrap();
    let path = file.display().to_string();
    let said = served.fails(3, &["follow", &path]);
    assert!(said.contains("not armed"), "{said}");
    let before = number(&served.status()["table"]["position_mm"]);
    let said = served.printed(&["follow", &path, "--arm", "--delay-ms", "200", "--json"]);
    let followed: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(followed["seconds"], 2.0, "{followed}");
    assert_eq!(followed["set_points"], 401, "{followed}");
    let [rms, most] = ["behind_um_rms", "behind_um_max"].map(|name| number(&followed[name]));
    assert!(rms < 10.0 && most < 60.0 && rms <= most, "{followed}");
    let moved = number(&followed["at_rest_mm"]) - before;
    assert!(moved.abs() < 0.1, "it ended {moved} mm off");

    let mut pipe = served
        .command(&["follow", "-", "--arm", "--delay-ms", "200"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    pipe.stdin
        .take()
        .unwrap()
        .write_all(way.as_bytes())
        .unwrap();
    let output = pipe.wait_with_output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(
        output.status.success() && said.contains("um behind (rms)"),
        "{said}"
    );

    // A step, and text that is none.
    for (text, code, expected) in [
        (
            "time_s,position_mm\n0,0\n0.005,1\n",
            3,
            "the set-point at 0.005000 s",
        ),
        (
            "time_s,position_mm\n0,0\n0.2,0\n",
            1,
            "200 ms behind the line before",
        ),
        (
            "time_s,position_mm\n0,0\n0.005,x\n",
            1,
            "line 3: position_mm is `x`",
        ),
        ("time_s,position_mm\n", 1, "there are no set-points"),
        ("0,0\n", 1, "the first line is `0,0`"),
    ] {
        std::fs::write(&file, text).unwrap();
        let said = served.fails(code, &["follow", &path, "--arm"]);
        assert!(said.contains(expected), "{text:?} said:\n{said}");
        assert_eq!(served.status()["state"], "ready");
    }
    std::fs::write(&file, &way).unwrap();
    let said = served.fails(3, &["follow", &path, "--arm", "--homed"]);
    assert!(said.contains("`home` finds it"), "{said}");
}

/// The screw has its torque, to its speed limit, and then rests.
#[test]
fn a_motor_is_asked_for_a_torque() {
    let served = Served::new(&[]);
    served.printed(&["inject", "load", "--amount", "0"]);
    let said = served.fails(3, &["torque", "--nm", "0.8"]);
    assert!(said.contains("not armed"), "{said}");
    let torque = ["torque", "--nm", "0.8", "--rpm-max", "90", "--arm"];
    let torque = [&torque[..], &["--duration", "6"]].concat();
    let mut torque = served.command(&torque).spawn().unwrap();
    served.until("running");
    let [screw, nut] = settled_rpm(&served, [90.0, 0.0]);
    assert!((screw - 90.0).abs() < 5.0, "the screw turns at {screw} rpm");
    assert!(nut.abs() < 5.0, "the nut turns at {nut} rpm");
    assert!(torque.wait().unwrap().success());
    served.until("ready");
    // 300 N on a lead of 5 mm are 0.24 N m, of which nothing is left for friction.
    let force = ["torque", "--table-force", "300", "--arm", "--duration", "1"];
    let force = [&force[..], &["--rpm-max", "90"]].concat();
    assert!(served.printed(&force).contains("at rest"));
    for (code, arguments, expected) in [
        (
            3,
            &["torque", "--nm", "9", "--arm"][..],
            "screw.torque_max_nm",
        ),
        (
            1,
            &["torque", "--nm", "1e9"],
            "but the motor allows up to 2 N m",
        ),
        (1, &["torque", "--nm", "nan"], "--nm is NaN"),
        (2, &["torque"], "--nm"),
        (
            2,
            &["torque", "--nm", "1", "--table-force", "1"],
            "--table-force",
        ),
        (
            3,
            &["torque", "--nm", "0.1", "--rpm-max", "1300", "--arm"],
            "feed.velocity_max_mm_s",
        ),
    ] {
        let said = served.fails(code, arguments);
        assert!(said.contains(expected), "{arguments:?} said:\n{said}");
    }
}

/// One terminal jogs, another sets: the table goes on, and its place is kept.
#[test]
fn a_gain_is_set_while_the_table_moves() {
    let served = Served::new(&[]);
    served.printed(&["home", "--arm"]);
    let jog = ["jog", "--table-speed", "2.5", "--arm", "--duration", "5"];
    let mut jog = served.command(&jog).stdout(Stdio::null()).spawn().unwrap();
    served.until("running");
    let said = served.printed(&["settings", "set", "tuning.speed_rad_s=150"]);
    assert!(
        said.contains("200 -> 150") && said.contains("not stored"),
        "{said}"
    );
    let said = served.fails(3, &["settings", "store"]);
    assert!(said.contains("moving"), "{said}");
    let status = served.status();
    assert_eq!(status["state"], "running", "{status}");
    assert_eq!(status["table"]["homed"], true);
    assert!(jog.wait().unwrap().success());
    assert!(served.printed(&["settings", "store"]).contains("stored"));
}

/// A drive that learns says what, and keeps it as settings.
#[test]
fn what_is_learned_is_kept() {
    let served = Served::new(&["--speed", "10"]);
    // Ten times as far as the durations say, between ends that are 100 mm to either side.
    let jog = |mm_s: &str, seconds: &str| {
        let speeds = ["jog", "--table-speed", mm_s, "--nut-rpm", "200", "--arm"];
        served.printed(&[&speeds[..], &["--duration", seconds]].concat())
    };
    served.printed(&["settings", "set", "--yes", "compensation.learning_s=0.5"]);
    served.until("ready");
    // Which orders it will learn is nothing that a restart takes.
    let lead = ["settings", "set", "feed.lead_mm=20"];
    let said = served.fails(1, &lead);
    assert!(
        said.contains("Lost with the restart: the alignment") && !said.contains("learned"),
        "{said}"
    );
    jog("5", "1");
    let said = served.fails(1, &lead);
    assert!(said.contains("that were learned and not saved"), "{said}");
    let said = served.printed(&["settings", "learned"]);
    assert!(said.contains("screw_torque.order_5: 0 -> 30"), "{said}");
    served.until("ready");
    served.printed(&["settings", "learned", "--save", "--yes"]);
    served.until("ready");
    // What was saved rounds to the steps of the drive's formats. That is nothing new.
    let said = served.printed(&["settings", "learned"]);
    assert_eq!(said, "nothing differs\n");
    let now = served.printed(&["settings", "get", "--json", "screw_torque"]);
    let now: Value = serde_json::from_str(&now).unwrap();
    let size = now["screw_torque.re_5_a"]
        .as_f64()
        .unwrap()
        .hypot(now["screw_torque.im_5_a"].as_f64().unwrap());
    assert!(
        size > 0.01,
        "{size} A of six times an electrical turn, expected more than 0.01: {now}"
    );
    // It fits at the next start, once the shafts have turned.
    jog("-5", "2.5");
    served.until("ready");
    let status = served.printed(&["status", "--json"]);
    let status: Value = serde_json::from_str(&status).unwrap();
    let table = &status["tables"][0];
    assert_eq!(
        (table["table"].as_str(), table["name"].as_str()),
        (Some("screw torque"), Some("fits")),
        "{status}"
    );
    // The table's position loop beside the compensation.
    let said = served.printed(&["move", "10", "--nut-rpm", "200", "--arm"]);
    assert!(said.contains("at rest"), "{said}");
}

#[test]
fn what_is_set_holds_when_the_drive_is_served_again() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("flash.bin").display().to_string();
    let served = Served::new(&["--flash", &file]);
    served.printed(&["settings", "set", "feed.velocity_max_mm_s=41"]);
    served.printed(&["settings", "store"]);
    served.printed(&["settings", "set", "feed.velocity_max_mm_s=42"]);
    // Written before the answer to what is asked next.
    served.printed(&["status"]);
    drop(served);
    let served = Served::new(&["--flash", &file]);
    let limit = served.status()["table"]["limits"]["velocity_mm_s"].clone();
    assert_eq!(limit, 41.0, "42 was not stored");
    std::fs::write(&file, "no flash").unwrap();
    let output = ddfeed().args(["serve", "--flash", &file]).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(
        !output.status.success() && said.contains("has 8 bytes"),
        "{said}"
    );
}

#[test]
fn a_recording_is_a_folder_that_a_model_reads() {
    let served = Served::new(&[]);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("rec").display().to_string();
    let said = served.printed(&[
        "record",
        &out,
        "--name",
        "fit",
        "--arm",
        "--hold",
        "2.5,0,1",
        "--hold",
        "2.5,300,1.5",
    ]);
    assert!(said.contains("none lost"), "{said}");
    let recording =
        plant::recording::Recording::load(&folder.path().join("rec/fit.csv.gz")).unwrap();
    let seconds = recording.samples().count() as f64 / 5000.0;
    assert!((seconds - 2.5).abs() < 0.1, "{seconds} s");
    plant::model::Model::load(&folder.path().join("rec/model.toml")).unwrap();
    assert_eq!(served.status()["state"], "ready");
}

#[test]
fn a_recording_begins_at_its_trigger_with_what_came_before() {
    let served = Served::new(&[]);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("rec").display().to_string();
    let record = |trigger: &'static str| {
        let holds = ["--hold", "2.5,0,0.6", "--hold", "2.5,300,1.5"];
        let how = ["--past", "0.2", "--duration", "0.3", "--trigger", trigger];
        [&["record", &out, "--arm"], &holds[..], &how[..]].concat()
    };
    // 100 rpm are 10.47 rad/s.
    let said = served.printed(&record("nut_speed_ref_rad_s>10.47"));
    assert!(said.contains("none lost"), "{said}");
    let file = folder.path().join("rec/record.csv.gz");
    let recording = plant::recording::Recording::load(&file).unwrap();
    let passed = recording
        .samples()
        .position(|row| row.axes[1].speed_ref_rad_s > 10.47);
    assert_eq!(passed, Some(1000), "rows of 0.2 s before it");
    // The last frame has a few rows more.
    let rows = recording.samples().count();
    assert!((2501..2530).contains(&rows), "{rows} rows of 0.5 s");

    std::fs::remove_file(&file).unwrap();
    let said = served.fails(1, &record("table_position_m>1"));
    assert!(said.contains("did not fire in 2.1 s"), "{said}");
    assert!(!file.exists(), "nothing was recorded");
    let said = served.fails(1, &record("nut_speed>1"));
    assert!(said.contains("no column `nut_speed`"), "{said}");
}

/// Section 6 of `docs/two-minutes.md`: what a drive has that its model lacks is recorded over the link, and named.
#[test]
fn what_the_link_records_is_traced_to_its_effect() {
    const AMPLITUDE_NM: f64 = 0.03;
    const FIT_HOLDS: &[&str] = &[
        "2.5,0,3",
        "-2.5,0,3",
        "2.5,300,3",
        "-5,300,3",
        "8,600,3",
        "2.5,150,3",
        "-2.5,-300,3",
    ];
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let declared = path("declared.toml");
    Served::new(&[]).printed(&["settings", "model", &declared]);
    let real = path("real.toml");
    let text = std::fs::read_to_string(&declared).unwrap();
    let effect = format!(
        "\n[[effects]]\nkind = \"cogging\"\nwhere = \"screw\"\norder = 36\namplitude = {AMPLITUDE_NM}\nphase = 0.4\n"
    );
    std::fs::write(&real, text + &effect).unwrap();

    let served = Served::new(&["--model", &real, "--speed", "4"]);
    let out = path("rec");
    for (name, holds) in [
        ("fit", FIT_HOLDS),
        ("check", &["3.5,0,3", "-2,200,3", "6,450,3"]),
    ] {
        let mut record = vec!["record", &out, "--name", name, "--arm"];
        record.extend(holds.iter().flat_map(|hold| ["--hold", hold]));
        served.printed(&record);
    }
    let [model, fit, check, found] = [
        "rec/model.toml",
        "rec/fit.csv.gz",
        "rec/check.csv.gz",
        "found",
    ]
    .map(path);
    let output = ddfeed()
        .args([
            "identify", "--model", &model, "--fit", &fit, "--check", &check,
        ])
        .args(["--no-simulation", "--out", &found])
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(
        said.contains("verdict") && !said.contains("Not excited"),
        "{said}"
    );
    let found = plant::model::Model::load(&folder.path().join("found/model.toml")).unwrap();
    let [effect] = &found.effects[..] else {
        panic!("{:?}", found.effects);
    };
    let said = format!("{effect:?}");
    assert!(said.to_lowercase().contains("cogging"), "{said}");
    let text = std::fs::read_to_string(folder.path().join("found/model.toml")).unwrap();
    let amplitude: f64 = text
        .lines()
        .find_map(|line| line.strip_prefix("amplitude = "))
        .and_then(|value| value.parse().ok())
        .unwrap_or_else(|| panic!("{text}"));
    assert!(
        (amplitude / AMPLITUDE_NM - 1.0).abs() < 0.05,
        "measured {amplitude} N m, expected {AMPLITUDE_NM} within 5 %"
    );
}

#[test]
#[cfg(unix)]
fn ctrl_c_brings_the_table_to_rest_and_leaves_whole_files() {
    let served = Served::new(&[]);
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    let hold = ["record", &out, "--arm", "--hold", "5,300,60"];
    let jog = ["jog", "--arm", "--table-speed", "5", "--nut-rpm", "300"];
    for arguments in [&hold[..], &jog[..]] {
        let child = served
            .command(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        served.until("running");
        sleep(Duration::from_millis(700));
        let pid = child.id().to_string();
        let killed = Command::new("kill").args(["-INT", &pid]).status().unwrap();
        assert!(killed.success());
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success(), "{arguments:?}");
        let status = served.status();
        assert_eq!(status["state"], "ready", "{arguments:?}");
        assert!(status["fault"].is_null(), "{status}");
    }
    let mut names: Vec<String> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, ["model.toml", "record.csv.gz"]);
    let recording =
        plant::recording::Recording::load(&folder.path().join("record.csv.gz")).unwrap();
    assert!(recording.samples().count() > 1000);
}

#[test]
fn a_host_that_dies_stops_the_drive() {
    let served = Served::new(&[]);
    let mut jog = served
        .command(&["jog", "--arm", "--table-speed", "5"])
        .spawn()
        .unwrap();
    served.until("running");
    jog.kill().unwrap();
    jog.wait().unwrap();
    served.until("fault");
    assert_eq!(served.status()["fault"]["name"], "nobody commands");
    served.printed(&["reset"]);
    served.until("ready");
}

#[test]
fn a_flood_of_garbage_does_not_keep_others_from_the_drive() {
    let served = Served::new(&[]);
    let mut stream = TcpStream::connect(&served.address).unwrap();
    stream.set_nonblocking(true).unwrap();
    // More than a second of the drive takes, from a simple generator of bytes.
    let mut state = 1u32;
    let flood: Vec<u8> = (0..1 << 20)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        })
        .collect();
    let _ = stream.write(&flood);
    served.printed(&["move", "0.5", "--arm"]);
    let mut rest = Vec::new();
    let _ = stream.read_to_end(&mut rest);
    assert_eq!(served.status()["state"], "ready");
}

#[test]
fn a_drive_that_is_not_there_is_said_with_its_code() {
    let nobody = ["drive", "--sim", "127.0.0.1:9", "status"];
    let output = ddfeed().args(nobody).output().unwrap();
    assert_eq!(output.status.code(), Some(5));
    let output = ddfeed()
        .args(["drive", "--serial", "/dev/none", "status"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(5));
    let output = ddfeed().args(["drive", "status"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
}

/// The table's place is found by commands alone, and the soft limits act from then on.
#[test]
fn a_table_is_homed_and_stands_before_its_soft_limit() {
    let served = Served::new(&["--speed", "2"]);
    let table = |served: &Served| served.status()["table"].clone();
    served.printed(&[
        "settings",
        "set",
        "--yes",
        "travel.home_velocity_mm_s=100",
        "travel.home_leaving_mm_s=5",
        "travel.home_position_mm=-10",
        "travel.soft_least_mm=-8",
        "travel.soft_most_mm=8",
        "brake.load_drives_back=on",
    ]);
    served.until("ready");
    let before = table(&served);
    assert_eq!(before["homed"], false);
    assert_eq!(before["limits"]["position_limits_act"], false);
    assert_eq!(served.status()["warnings"][0]["name"], "no brake");
    // A phase's peak at the largest torque is past the bridge's limit of 20 A of the served board.
    served.printed(&["settings", "set", "--yes", "nut.torque_max_nm=40"]);
    served.until("ready");
    let warnings = &served.status()["warnings"];
    assert_eq!(warnings[1]["name"], "nut torque", "{warnings}");
    assert!(
        served
            .printed(&["status"])
            .contains("the drive is not homed")
    );

    let said = served.fails(3, &["home"]);
    assert!(said.contains("not armed"), "{said}");
    let homed = served.printed(&["home", "--arm", "--json"]);
    let homed: Value = serde_json::from_str(&homed).unwrap();
    let at = number(&homed["position_mm"]);
    assert!((-10.0..-9.0).contains(&at), "the table is at {at} mm");
    assert_eq!(table(&served)["limits"]["position_limits_act"], true);

    let jog = ["jog", "--arm", "--table-speed", "20", "--duration", "3"];
    let mut jogging = served.command(&jog).stdout(Stdio::null()).spawn().unwrap();
    sleep(Duration::from_millis(1200));
    let status = served.status();
    assert_eq!(status["limited_by"][0]["name"], "travel", "{status}");
    assert!(status["fault"].is_null(), "{status}");
    assert!(jogging.wait().unwrap().success());
    let at = number(&table(&served)["position_mm"]);
    assert!((7.5..8.0).contains(&at), "the table is at {at} mm");
    let said = served.fails(3, &["move", "2", "--arm"]);
    assert!(said.contains("travel.soft_most_mm"), "{said}");
    served.printed(&["move", "-2", "--arm"]);
}

/// Gains come from the settings that hold: proposed, refused where the margin is not to be had, and set.
#[test]
fn a_tuning_is_proposed_refused_and_set() {
    let served = Served::new(&[]);
    let report = |arguments: &[&str]| -> Value {
        let all = [&["tune", "--json"], arguments].concat();
        serde_json::from_str(&served.printed(&all)).unwrap()
    };
    let all = |report: &Value, what: &str| -> Vec<(f64, Value)> {
        let quantities = report["quantities"].as_array().unwrap().iter();
        quantities
            .filter(|quantity| quantity["name"].as_str().unwrap().contains(what))
            .map(|quantity| {
                let now = number(&quantity["estimate"]["value"]);
                (now, quantity["before"].clone())
            })
            .collect()
    };
    let held = |name: &str| {
        let settings = served.printed(&["settings", "get", "--json", name]);
        let settings: Value = serde_json::from_str(&settings).unwrap();
        number(&settings[name])
    };
    let (cutoff, set) = ("tuning.speed_rad_s", held("tuning.speed_rad_s"));

    let report_1 = report(&["--speed-loop", "100"]);
    assert_eq!(report_1["set"], false);
    assert_eq!(held(cutoff), set, "proposed only");
    assert_eq!(all(&report_1, cutoff), [(100.0, Value::from(set))]);
    let margins = all(&report_1, "phase margin");
    assert_eq!(margins.len(), 4, "two loops of two motors: {report_1}");
    for (margin, before) in margins {
        assert!(margin >= 45.0 && before.is_number(), "{report_1}");
    }
    // Eq 11 is linear in the cutoff.
    let [(now, ref before), _] = all(&report_1, "gain Kpw (Eq 11)")[..] else {
        panic!("{report_1}");
    };
    let before = number(before);
    assert!((now / before - 100.0 / set).abs() < 1e-9, "{report_1}");

    let said = served.fails(1, &["tune", "--speed-loop", "9000", "--set"]);
    assert!(said.contains("but 45 are wanted"), "{said}");
    assert_eq!(held(cutoff), set, "refused");
    let largest = said.split("--speed-loop ").nth(1).unwrap();
    let largest = largest.split_whitespace().next().unwrap();
    let said = served.fails(1, &["tune", "--margin", "79"]);
    assert!(said.contains("expected: 79 degrees"), "{said}");
    let said = served.fails(1, &["tune", "--margin", "90"]);
    assert!(said.contains("20 to 80 are possible"), "{said}");

    // What the sentence says can be had is had, and holds.
    let report_2 = report(&["--speed-loop", largest, "--set", "--yes"]);
    assert_eq!(report_2["set"], true);
    served.until("ready");
    assert_eq!(held(cutoff).to_string(), largest);
    let margin = all(&report_2, "phase margin")
        .iter()
        .map(|(now, _)| *now)
        .fold(f64::INFINITY, f64::min);
    assert!((45.0..50.0).contains(&margin), "{report_2}");
    let said = served.printed(&["tune"]);
    assert!(said.contains("this is what is set"), "{said}");
}
