//! A machine of one's own is served with its own supply, travel, encoders and brake.

use plant::model::{Brake, EncoderKind, Model};
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use tempfile::TempDir;

fn ddfeed() -> Command {
    Command::new(env!("CARGO_BIN_EXE_ddfeed"))
}

/// A served machine; it ends with the test.
struct Served {
    child: Child,
    address: String,
    _folder: TempDir,
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Served {
    /// `model`, just switched on. The heartbeat allows for a computer that is busy: the drive's time goes faster than the host's.
    fn cold(model: &Model) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let (file, settings) = (
            folder.path().join("mine.toml"),
            folder.path().join("settings.toml"),
        );
        fs::write(&file, model.to_toml()).unwrap();
        fs::write(&settings, "[command]\nheartbeat_ms = 5000\n").unwrap();
        let mut child = ddfeed()
            .args([
                "serve",
                "--cold",
                "--speed",
                "10",
                "--listen",
                "127.0.0.1:0",
            ])
            .arg("--model")
            .arg(file)
            .arg("--settings")
            .arg(settings)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let first = lines.next().unwrap().unwrap();
        let (_, rest) = first.split_once("--sim ").unwrap();
        let address = rest.split_whitespace().next().unwrap().to_owned();
        Self {
            child,
            address,
            _folder: folder,
        }
    }

    /// What a command prints, whether it succeeds or not.
    fn drive(&self, arguments: &[&str]) -> String {
        let output = ddfeed()
            .args(["drive", "--sim", &self.address])
            .args(arguments)
            .output()
            .unwrap();
        String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned()
    }

    /// The table's place, mm.
    fn table_mm(&self) -> f64 {
        let said = self.drive(&["status", "--json"]);
        let status: Value = serde_json::from_str(&said).unwrap_or_else(|_| panic!("{said}"));
        status["table"]["position_mm"]
            .as_f64()
            .unwrap_or_else(|| panic!("{said}"))
    }
}

/// A small 48 V machine with a lead of 10 mm and a travel of 1 m.
fn small() -> Model {
    let mut model = Model::coupled();
    for motor in [&mut model.screw, &mut model.nut] {
        motor.resistance_ohm = 0.3;
        motor.inductance_h = 1e-3;
        motor.flux_wb = 0.02;
    }
    model.feed.lead_m = 0.01;
    model.feed.load_n = 40.0;
    model.sensing.encoder = EncoderKind::Index;
    model.sensing.current_lsb_a = 0.02;
    model.sensing.current_noise_a = 0.02;
    model.installation.bus_v = 48.0;
    model.installation.travel_m = 1.0;
    model
}

#[test]
fn a_drive_of_48_volts_uses_its_metre_of_travel() {
    let served = Served::cold(&small());
    // Past the 100 mm that a machine has of which nothing is said.
    let said = served.drive(&["move", "--arm", "--table-speed", "80", "150"]);
    assert!(said.contains("moved 1"), "{said}");
    let place = served.table_mm();
    assert!((place - 150.0).abs() < 0.2, "{place} mm: {said}");
}

#[test]
fn a_load_falls_where_no_brake_holds_it() {
    for (brake, falls) in [
        (Brake::Ideal, false),
        (Brake::Fitted, false),
        (Brake::None, true),
    ] {
        let mut model = small();
        // 0.32 N m of torque at the screw, four times what rubs.
        model.feed.load_n = 200.0;
        model.installation.brake = brake;
        let served = Served::cold(&model);
        let before = served.table_mm();
        served.drive(&["status"]);
        std::thread::sleep(std::time::Duration::from_millis(300));
        let fallen = before - served.table_mm();
        assert_eq!(fallen > 1.0, falls, "{brake:?}: {fallen} mm");
        if brake == Brake::Fitted {
            let said = served.drive(&["move", "--arm", "20"]);
            assert!(said.contains("moved"), "{said}");
            assert!((served.table_mm() - 20.0).abs() < 0.2, "{said}");
        }
    }
}
