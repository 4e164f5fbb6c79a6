//! `model.toml`: what is read, what is written, and what is refused with which words.

use plant::Axis;
use plant::effects::AnyEffect;
use plant::machine::{Bridge, Coupling, Machine};
use plant::model::Model;
use proptest::prelude::*;

fn text() -> String {
    Model::coupled().to_toml()
}

/// The error of a changed model; the change must be one.
fn error(from: &str, to: &str) -> String {
    let changed = text().replacen(from, to, 1);
    assert_ne!(changed, text(), "nothing to change for `{from}`");
    Model::parse(&changed, "m.toml").unwrap_err().to_string()
}

fn effect_error(lines: &str) -> String {
    let text = text() + "\n[[effects]]\n" + lines;
    Model::parse(&text, "m.toml").unwrap_err().to_string()
}

fn says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
}

#[test]
fn presets_survive_being_written_and_read() {
    for model in [Model::paper(), Model::coupled()] {
        assert_eq!(Model::parse(&model.to_toml(), "preset").unwrap(), model);
    }
}

#[test]
fn the_written_layout_is_that_of_the_recordings() {
    let text = text();
    says(
        &text,
        &["[screw]\nresistance_ohm = 1.7\ninductance_h = 0.0059\npole_pairs = 5\n"],
    );
    says(
        &text,
        &["torque_harmonics = [\n    { order = 6, amplitude_nm = 0.078, phase_rad = 0.0 },\n"],
    );
    says(
        &text,
        &["\n\n[feed]\nlead_m = 0.005\n", "table_noise_m = 1e-8\n"],
    );
}

#[test]
fn every_effect_survives_being_written_and_read() {
    for kind in AnyEffect::CATALOGUE {
        let (kind, (place, parameters)) = (kind.name, kind.example);
        let lines: String = (parameters.iter())
            .map(|(name, value)| format!("{name} = {value:?}\n"))
            .collect();
        let text = format!(
            "{}\n[[effects]]\nkind = \"{kind}\"\nwhere = \"{}\"\n{lines}\n",
            text(),
            place.name()
        );
        let model = Model::parse(&text, "m.toml").unwrap();
        assert_eq!(model.effects[0].effect().kind(), kind);
        assert_eq!(Model::parse(&model.to_toml(), "copy").unwrap(), model);
        let parameters = model.effects[0].effect().parameters();
        let names = parameters
            .iter()
            .map(|(name, value)| (name.as_str(), *value));
        assert_eq!(
            &AnyEffect::from_parameters(kind, names).unwrap(),
            model.effects[0].effect()
        );
        for coupling in [Coupling::Lumped, Coupling::Coupled] {
            let mut machine = Machine::new(&model, coupling);
            machine.set_bridge(Axis::Screw, Bridge::Driven([5.0, 0.0, -5.0]));
            (0..1000).for_each(|_| machine.advance(25e-6));
            assert!(
                machine.motor(Axis::Screw).omega.is_finite()
                    && machine.table_position().is_finite(),
                "speed {} rad/s and position {} m must be finite",
                machine.motor(Axis::Screw).omega,
                machine.table_position()
            );
        }
    }
}

#[test]
fn a_measured_effect_survives_being_written_and_read() {
    let effect = |keys: &str| {
        let effect = format!("\n[[effects]]\nkind = \"measured\"\nwhere = \"screw\"\n{keys}");
        Model::parse(&(text() + &effect), "m.toml")
    };
    let sound = "quantity = \"torque\"\nover = \"speed\"\nrange = [-10.0, 10.0]\nvalue = [0.1, 0.0, -0.1]\n";
    let model = effect(sound).unwrap();
    assert_eq!(Model::parse(&model.to_toml(), "copy").unwrap(), model);
    for (key, wrong, says) in [
        (
            "[-10.0, 10.0]",
            "[10.0, -10.0]",
            "expected two finite numbers",
        ),
        ("[0.1, 0.0, -0.1]", "[0.1]", "expected two or more"),
        (
            "\"torque\"",
            "\"force\"",
            "expected for `measured` one of `feed`",
        ),
    ] {
        let error = effect(&sound.replace(key, wrong)).unwrap_err().to_string();
        assert!(error.contains(says), "{error}: expected {says}");
    }
}

#[test]
fn unphysical_values_are_refused() {
    says(
        &error("inertia_kg_m2 = 0.0007", "inertia_kg_m2 = -0.0007"),
        &[
            "m.toml, line 6, key `screw.inertia_kg_m2`",
            "-0.0007",
            "a finite number above 0",
        ],
    );
    says(
        &error("flux_wb = 0.11", "flux_wb = nan"),
        &["line 5", "screw.flux_wb", "NaN", "finite"],
    );
    says(
        &error("coulomb_nm = 0.04", "coulomb_nm = inf"),
        &["screw.coulomb_nm", "inf", "0 or above"],
    );
    says(
        &error("lead_m = 0.005", "lead_m = 0"),
        &["feed.lead_m", "other than 0"],
    );
    says(
        &error("pole_pairs = 5", "pole_pairs = 5.5"),
        &["screw.pole_pairs", "5.5", "whole number"],
    );
    says(
        &error("pole_pairs = 5", "pole_pairs = 0"),
        &["screw.pole_pairs", "`0`", "from 1"],
    );
    says(
        &error("order = 12", "order = -12"),
        &["screw.torque_harmonics[1].order", "-12", "above 0"],
    );
    says(
        &error("load_n = 400.0", "load_n = \"much\""),
        &["feed.load_n", "much", "a finite number"],
    );
}

#[test]
fn unknown_and_missing_and_double_keys_are_refused() {
    says(
        &error("viscous_nm_s", "viscosity"),
        &["line 7, key `screw.viscosity`", "unknown", "viscous_nm_s"],
    );
    says(
        &error("[nut]", "[nuts]"),
        &["key `nuts`", "unknown", "`nut`"],
    );
    says(
        &error("flux_wb = 0.11\n", ""),
        &["missing", "flux_wb", "screw", "line 1"],
    );
    says(
        &error("flux_wb = 0.11\n", "flux_wb = 0.11\nflux_wb = 0.12\n"),
        &["line 6", "duplicate"],
    );
    says(&error("flux_wb = 0.11", "flux_wb = "), &["line 5"]);
}

#[test]
fn an_empty_model_says_where_a_whole_one_is() {
    let empty = Model::parse("", "m.toml").unwrap_err().to_string();
    says(
        &empty,
        &["m.toml", "missing", "`screw`", "`ddfeed serve --example`"],
    );
}

#[test]
fn effects_are_checked_too() {
    says(
        &effect_error("where = \"nut\"\n"),
        &["missing key `kind`", "`dead_time`", "effects[0]"],
    );
    says(
        &effect_error("kind = \"hum\"\nwhere = \"nut\"\n"),
        &["read `hum`", "`cogging`", "effects[0].kind"],
    );
    says(
        &effect_error("kind = \"cogging\"\nwhere = \"feed\"\norder = 36\namplitude = 1\n"),
        &["effects[0].where", "read `feed`", "`screw`, `nut`, `both`"],
    );
    says(
        &effect_error("kind = \"cogging\"\nwhere = \"nut\"\norder = 1.5\namplitude = 1\n"),
        &["effects[0].order", "1.5", "whole number"],
    );
    says(
        &effect_error("kind = \"cogging\"\nwhere = \"nut\"\norder = 36\n"),
        &["missing", "amplitude", "effects[0]"],
    );
    says(
        &effect_error("kind = \"cogging\"\nwhere = \"nut\"\norder = 36\namplitude = 1\nhz = 3\n"),
        &["effects[0].hz", "unknown"],
    );
    says(
        &Model::parse("effects = 3", "m.toml")
            .unwrap_err()
            .to_string(),
        &["effects", "[[effects]]"],
    );
}

#[test]
fn parameters_by_name_are_checked_as_a_file_is() {
    let wrong = |kind, parameters: &[(&str, f64)]| {
        AnyEffect::from_parameters(kind, parameters.iter().copied()).unwrap_err()
    };
    says(&wrong("hum", &[]), &["hum", "cogging"]);
    says(&wrong("backlash", &[]), &["backlash", "missing", "value"]);
    says(
        &wrong("backlash", &[("value", -1.0)]),
        &["-1", "0 or above"],
    );
    says(
        &wrong("backlash", &[("value", 1.0), ("size", 1.0)]),
        &["unknown", "size"],
    );
}

#[test]
fn a_missing_file_says_so() {
    let message = Model::load(std::path::Path::new("no/such.toml"))
        .unwrap_err()
        .to_string();
    says(&message, &["no/such.toml", "cannot read"]);
}

proptest! {
    #[test]
    fn no_text_makes_it_panic(text in ".{0,200}") {
        let _ = Model::parse(&text, "any");
    }

    #[test]
    fn no_damage_makes_it_panic(at in 0usize..1500, byte in any::<u8>(), cut in any::<bool>()) {
        let whole = text() + "\n[[effects]]\nkind = \"cogging\"\nwhere = \"nut\"\norder = 36\namplitude = 1\n";
        let mut bytes = whole.into_bytes();
        let at = at % bytes.len();
        if cut { bytes.truncate(at) } else { bytes[at] = byte }
        let text = String::from_utf8_lossy(&bytes);
        if let Ok(model) = Model::parse(&text, "damaged") {
            let mut machine = Machine::new(&model, Coupling::Coupled);
            (0..10).for_each(|_| machine.advance(25e-6));
        }
    }

    #[test]
    fn friction_alone_never_adds_energy(
        torque in -2.0..2.0f64, load in -2000.0..2000.0f64, pair in 0.0..0.5f64, guide in 0.0..500.0f64, bearing in 0.0..0.5f64,
    ) {
        let mut model = Model::coupled();
        for axis in Axis::ALL {
            model.motor_mut(axis).torque_harmonics.clear();
            model.motor_mut(axis).coulomb_nm = bearing;
        }
        model.feed.pair_coulomb_nm = pair;
        model.feed.guideway_coulomb_n = guide;
        model.feed.load_n = 0.0;
        let mut machine = Machine::new(&model, Coupling::Coupled);
        machine.set_disturbance_torque(Axis::Screw, torque);
        machine.set_load_force(load);
        (0..200).for_each(|_| machine.advance(25e-6));
        machine.set_disturbance_torque(Axis::Screw, 0.0);
        machine.set_load_force(0.0);
        let energy = |machine: &Machine| {
            let mut sum = 0.5 * model.feed.table_mass_kg * machine.table_velocity().powi(2);
            for axis in Axis::ALL {
                sum += 0.5 * model.motor(axis).inertia_kg_m2 * machine.motor(axis).omega.powi(2);
            }
            sum + 0.5 * model.feed.axial_stiffness_n_per_m * stretch(&model, machine).powi(2)
        };
        // The spring's discrete energy breathes within a period; over whole periods it only falls.
        let mut last = f64::INFINITY;
        for _ in 0..20 {
            let mut peak = 0.0_f64;
            for _ in 0..160 {
                machine.advance(25e-6);
                peak = peak.max(energy(&machine));
            }
            prop_assert!(peak <= last * (1.0 + 1e-9) + 1e-15, "{peak} after {last}");
            last = peak;
        }
    }
}

/// Stretch of the axial spring of a machine that started at angles 0.
fn stretch(model: &Model, machine: &Machine) -> f64 {
    let relative = machine.motor(Axis::Screw).theta - machine.motor(Axis::Nut).theta;
    model.feed.travel_per_radian() * relative - machine.table_position()
}
