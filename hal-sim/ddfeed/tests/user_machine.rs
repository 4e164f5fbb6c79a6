//! A machine of one's own is served with its own supply, travel, encoders and brake.

mod served;

use plant::model::{Brake, EncoderKind, Model};
use served::Served;
use std::fs;

/// `model`, just switched on. The heartbeat allows for a computer that is busy: the drive's time goes faster than the host's.
fn cold(model: &Model) -> Served {
    let folder = tempfile::tempdir().unwrap();
    let [file, settings] =
        ["mine.toml", "settings.toml"].map(|name| folder.path().join(name).display().to_string());
    fs::write(&file, model.to_toml()).unwrap();
    fs::write(&settings, "[command]\nheartbeat_ms = 5000\n").unwrap();
    Served::new(&[
        "--cold",
        "--speed",
        "10",
        "--model",
        &file,
        "--settings",
        &settings,
    ])
}

/// The table's place, mm.
fn table_mm(served: &Served) -> f64 {
    served.status()["table"]["position_mm"].as_f64().unwrap()
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
    let served = cold(&small());
    // Past the 100 mm that a machine has of which nothing is said.
    let said = served.printed(&["move", "--arm", "--table-speed", "80", "150"]);
    assert!(said.contains("moved 1"), "{said}");
    let place = table_mm(&served);
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
        // 0.32 N m of torque at the screw, four times the friction.
        model.feed.load_n = 200.0;
        model.installation.brake = brake;
        let served = cold(&model);
        let before = table_mm(&served);
        // The drive's own time: the computer may be busy.
        let uptime_s = || served.status()["uptime_s"].as_f64().unwrap();
        let until = uptime_s() + 1.0;
        while uptime_s() < until {}
        let fallen = before - table_mm(&served);
        assert_eq!(fallen > 1.0, falls, "{brake:?}: {fallen} mm");
        if brake == Brake::Fitted {
            let said = served.printed(&["move", "--arm", "20"]);
            assert!(said.contains("moved"), "{said}");
            assert!((table_mm(&served) - 20.0).abs() < 0.2, "{said}");
        }
    }
}
