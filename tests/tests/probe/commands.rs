//! Each command that takes a probe, at the emulated chip's.

use crate::emulated::Emulated;
use crate::figures::keep;
use crate::program::{Running, board, ddfeed, printed};
use link::codes::State;
use plant::machine::Coupling;
use plant::model::Model;
use serde_json::Value;
use std::process::Command;
use std::time::{Duration, Instant};
use tests::bench::{Bench, READY, aligning_firmware_of};
use tests::chip::wiring::Wiring;
use tests::emulator::HaltedTime;

/// How long a line may take that a command prints, builds and flashing included.
const PATIENCE: Duration = Duration::from_secs(60);
/// The state of a drive as it is shipped, soon after its start.
const UNALIGNED: u32 = State::Unaligned.word();

/// A machine without a load, which would drive the screw back while the bridges are open.
fn unloaded() -> Model {
    let mut model = Model::paper();
    model.feed.load_n = 0.0;
    model
}

/// The firmware that the commands build, on a chip that starts.
fn shipped() -> Result<Bench, String> {
    let elf = aligning_firmware_of(Wiring::Nucleo)?;
    Bench::with(&elf, Wiring::Nucleo, &unloaded(), Coupling::Lumped)
}

/// The same chip as ST ships it.
fn blank() -> Result<Bench, String> {
    let mut bench = shipped()?;
    bench.emulator.deliver()?;
    Ok(bench)
}

/// A drive that knows its rotors' angles.
fn ready() -> Result<Bench, String> {
    let mut bench = Bench::new(&unloaded(), Coupling::Lumped)?;
    bench.wait_for(READY, 0.2)?;
    Ok(bench)
}

#[test]
fn flash_writes_the_firmware_and_starts_it() {
    let chip = Emulated::start(HaltedTime::Running, blank);
    let output = chip.command(board(), "flash").output().unwrap();
    let said = printed(&output);
    assert!(said.ends_with("written and started\n"), "{said}");
    let segments = chip.ask(|bench| bench.image.segments.clone());
    for (start, bytes) in segments {
        let size = bytes.len();
        let there = chip.ask(move |bench| bench.emulator.bytes(start, size));
        assert!(there == Ok(bytes), "{size} bytes at {start:#010x} differ");
    }
    assert_eq!(chip.ask(|bench| bench.wait_for(UNALIGNED, 0.5)), Ok(()));
}

#[test]
fn run_prints_the_log_from_the_start_on() {
    let chip = Emulated::start(HaltedTime::Running, blank);
    let mut run = Running::start(&mut chip.command(board(), "run"));
    run.until("written and started", PATIENCE);
    let first = run.until("started after", PATIENCE);
    assert!(first.starts_with("info "), "{first}");
    // Ctrl-C ends the session, and not the drive.
    run.interrupt();
    assert!(!run.ended(PATIENCE));
    assert_eq!(chip.ask(|bench| bench.wait_for(UNALIGNED, 0.5)), Ok(()));
}

#[test]
fn attach_shows_the_drive_and_its_resets_without_a_halt() {
    let chip = Emulated::start(HaltedTime::Running, shipped);
    chip.ask(|bench| bench.wait_for(UNALIGNED, 0.5)).unwrap();
    let mut attach = Running::start(&mut chip.command(board(), "attach"));
    attach.until("Last reset: ", PATIENCE);
    attach.until("unaligned", PATIENCE);
    // A reset under the debugger.
    let request = 0x05FA_0004_u32.to_le_bytes();
    chip.ask(move |bench| bench.emulator.debugger_writes(0xE000_ED0C, &request))
        .unwrap();
    let again = attach.until("Last reset: ", PATIENCE);
    assert!(again.contains("The firmware asked for it"), "{again}");
    attach.until("unaligned", PATIENCE);
    // A drive that nothing halts sees no step of its control missed.
    let missed = chip.ask(|bench| bench.look()).unwrap().words().motors;
    assert_eq!(missed.map(|motor| motor.missed), [0; 2]);
}

#[test]
fn drive_is_commanded_at_the_probe() {
    let chip = Emulated::start(HaltedTime::Running, ready);
    let drive = |words: &[&str]| {
        let mut command = chip.command(ddfeed(), "drive");
        printed(&command.args(words).output().unwrap())
    };
    let status = || serde_json::from_str::<Value>(&drive(&["status", "--json"])).unwrap();
    assert_eq!(status()["state"], "ready");
    assert_eq!(drive(&["arm"]), "armed\n");
    let table = |bench: &mut Bench| bench.joint.borrow().board.machine.table_position();
    let before = chip.ask(table);
    let told = drive(&["move", "0.5", "--table-speed", "5", "--json"]);
    let told: Value = serde_json::from_str(&told).unwrap();
    let moved_mm = 1e3 * (chip.ask(table) - before);
    let told_mm = |name: &str| told[name].as_f64().unwrap();
    assert!((told_mm("moved_mm") - 0.5).abs() < 0.01, "{told}");
    // Once the bridges are open the rotors turn to where they rest.
    assert!((moved_mm - 0.5).abs() < 0.1, "{told}, {moved_mm} mm");
    drive(&["stop"]);
    assert_eq!(status()["state"], "ready");
}

#[test]
fn bringup_asks_the_board_and_finds_nothing() {
    let chip = Emulated::start(HaltedTime::Running, || {
        let bench = blank()?;
        bench.joint.borrow_mut().board.set_bus_voltage(0.0);
        Ok(bench)
    });
    let folder = tempfile::tempdir().unwrap();
    let began = Instant::now();
    let mut bringup = chip.command(board(), "bringup");
    bringup.arg("--json").arg("--out").arg(folder.path());
    let output = bringup.output().unwrap();
    println!(
        "{:?}: {}",
        began.elapsed(),
        String::from_utf8_lossy(&output.stderr)
    );
    let said = printed(&output);
    let json = &said[said.find('{').unwrap()..];
    let report: Value = serde_json::from_str(json).unwrap();
    assert_eq!(report["findings"], 0, "{said}");
    let items = report["items"].as_array().unwrap();
    let rate = items
        .iter()
        .find(|item| item["id"] == "probe.rate")
        .unwrap();
    let (kilobytes, _) = rate["read"].as_str().unwrap().split_once(" kB/s").unwrap();
    keep("rtt_bytes_per_s", 1e3 * kilobytes.parse::<f64>().unwrap());
    assert!(folder.path().join("bringup.html").exists());
}

#[test]
fn emulate_serves_the_chip_to_each_of_them() {
    let mut emulate = Command::new(env!("CARGO_BIN_EXE_emulate"));
    emulate.args(["--probe", "127.0.0.1:0", "--link", "127.0.0.1:0"]);
    let mut emulate = Running::start(&mut emulate);
    let word = |line: String| line.split_whitespace().last().unwrap().to_owned();
    let probe = word(emulate.until("cargo xtask attach", PATIENCE));
    let line = emulate.until("drive --sim", PATIENCE);
    let link = line.split_whitespace().nth(4).unwrap().to_owned();
    for place in [format!("--sim={link}"), format!("--probe={probe}")] {
        let mut drive = ddfeed();
        drive.args(["drive", &place, "status", "--json"]);
        let status: Value = serde_json::from_str(&printed(&drive.output().unwrap())).unwrap();
        assert_eq!(status["state"], "unaligned", "{place}");
    }
    let mut attach = board();
    attach.args(["attach", "--probe", &probe]);
    Running::start(&mut attach).until("unaligned", PATIENCE);
    // Its addresses are taken.
    let mut second = Command::new(env!("CARGO_BIN_EXE_emulate"));
    second.args(["--probe", &probe, "--link", "127.0.0.1:0"]);
    let output = second.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        !output.status.success() && said.contains("Name another port"),
        "{said}"
    );
}
