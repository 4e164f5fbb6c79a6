//! Clean motors of other makes: drawn motors, drives and loggers that share no code with the simulator, read from files as a user has them.
//!
//! Nothing is missing on them. What is called missing is a false alarm.

mod drive;
mod motor;

use anyhow::{Context, Result};
use drive::{Drive, Log};
use identify::records::{Mapping, OnFault};
use identify::run::{RunError, Task};
use motor::{Friction, Motor};
use rand::seq::SliceRandom;
use rand::{Rng, RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Serialize;
use std::fmt::Write;
use std::path::Path;

/// What was said of clean motors.
#[derive(Debug, Default, Serialize)]
pub struct Makes {
    /// Motors.
    runs: usize,
    /// On which something is said to be missing.
    called_missing: usize,
    /// Which have a name of an effect, or whose data are called wrong.
    false_names: usize,
    nothing_missing: usize,
    not_excited: usize,
}

/// Typical motors: resistance, inductance, pole pairs, flux, inertia, viscous and Coulomb friction, bus voltage. From a gimbal motor on a
/// battery to a servo on rectified mains.
const KINDS: [Motor; 5] = [
    Motor::typical([0.1, 3e-5, 7.0, 0.003, 6e-6, 2e-6, 0.002, 12.0]),
    Motor::typical([0.4, 4e-4, 4.0, 0.009, 3e-5, 2e-5, 0.008, 24.0]),
    Motor::typical([0.25, 3.5e-4, 4.0, 0.02, 1.2e-4, 1e-4, 0.02, 48.0]),
    Motor::typical([1.05, 4.2e-3, 4.0, 0.131, 4.4e-4, 5e-4, 0.06, 310.0]),
    Motor::typical([0.5, 3e-3, 3.0, 0.3, 3e-3, 2e-3, 0.3, 310.0]),
];

/// Holds of a fit record, and of a check record.
const HOLDS: [usize; 2] = [10, 8];
/// Length of each, s.
const HOLD_S: f64 = 1.5;

/// So many motors from a seed on; a long run is watched on standard error. `keep` is where their files stay.
///
/// # Errors
/// A file cannot be written.
pub fn measure(first: u64, runs: u64, keep: Option<&Path>) -> Result<Makes> {
    let place = tempfile::tempdir()?;
    let mut makes = Makes::default();
    for seed in first..first + runs {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let motor = drawn_motor(&mut rng);
        let drive = drawn_drive(&mut rng, &motor);
        let folder = keep.unwrap_or(place.path()).join(format!("make-{seed}"));
        let said = task(&mut rng, &motor, &drive, &folder).and_then(|task| said(&task));
        let (verdict, names) = said.with_context(|| format!("motor {seed}"))?;
        makes.runs += 1;
        makes.nothing_missing += usize::from(verdict == "nothing missing");
        makes.not_excited += usize::from(verdict == "not excited");
        makes.called_missing += usize::from(!["nothing missing", "not excited"].contains(&verdict));
        makes.false_names += usize::from(!names.is_empty());
        eprintln!("make {seed}: {verdict}; {names:?}; {motor:?}; {drive:?}");
    }
    Ok(makes)
}

fn about(rng: &mut impl Rng, value: f64, share: f64) -> f64 {
    value * rng.random_range(1.0 - share..1.0 + share)
}

fn drawn_motor(rng: &mut impl Rng) -> Motor {
    let kind = KINDS[rng.random_range(0..KINDS.len())];
    let mut other = |value: f64| value * rng.random_range(-0.3_f64..0.3).exp();
    let motor = Motor {
        resistance: other(kind.resistance),
        inductance: other(kind.inductance),
        flux: other(kind.flux),
        inertia: other(kind.inertia),
        viscous: other(kind.viscous),
        coulomb: other(kind.coulomb),
        ..kind
    };
    let slow = 0.02 * motor.top_speed();
    Motor {
        friction: match rng.random_bool(0.5) {
            true => Friction::Rounded(slow * rng.random_range(0.02..0.5)),
            false => Friction::Bristle(rng.random_range(5e-4..5e-3)),
        },
        load: match rng.random_bool(0.5) {
            true => 0.0,
            false => motor.coulomb * rng.random_range(-3.0..3.0),
        },
        ..motor
    }
}

fn drawn_drive(rng: &mut impl Rng, motor: &Motor) -> Drive {
    let of =
        |rng: &mut _, values: &[f64]| -> f64 { values[Rng::next_u32(rng) as usize % values.len()] };
    let control_hz = of(rng, &[8e3, 10e3, 16e3, 20e3]);
    Drive {
        control_hz,
        every: of(rng, &[1.0, 2.0, 4.0, 5.0, 8.0]) as usize,
        current_hz: rng.random_range(0.02..0.06) * control_hz,
        counts: of(rng, &[4096.0, 8192.0, 16_384.0, 65_536.0, 1_048_576.0]),
        noise_a: motor.rated_a() * rng.random_range(1e-4..2e-3),
        lsb_a: motor.rated_a() * rng.random_range(1e-4..2e-3),
        zero: rng.random_range(-1.0_f64..1.0).to_radians(),
        log: [Log::Rotor, Log::Stator, Log::Phases][rng.random_range(0..3)],
        amplitude: rng.random_bool(0.5),
    }
}

/// Files of a motor's runs, ready to be identified.
fn task(rng: &mut impl Rng, motor: &Motor, drive: &Drive, folder: &Path) -> Result<Task> {
    std::fs::create_dir_all(folder)?;
    let mut files = Vec::new();
    for (name, holds) in ["fit.csv", "check.csv"].into_iter().zip(HOLDS) {
        let file = folder.join(name);
        let speeds = speeds(rng, motor, holds);
        std::fs::write(&file, drive.record(rng, motor, &speeds, HOLD_S))?;
        files.push(file);
    }
    let model = folder.join("model.toml");
    std::fs::write(&model, plate(rng, motor, drive)?)?;
    std::fs::write(folder.join("map.toml"), mapping(drive))?;
    Ok(Task {
        model,
        fit: vec![files[0].clone()],
        check: vec![files[1].clone()],
        mapping: Mapping::parse(&mapping(drive), "a mapping")?,
        on_fault: OnFault::Skip,
    })
}

/// Verdict and names.
fn said(task: &Task) -> Result<(&'static str, Vec<String>)> {
    Ok(match task.run(&mut |_, _| ()) {
        Ok(done) => {
            let effects = done.report.effects.iter();
            let named = effects.filter(|effect| effect.curve.is_none());
            let names = named.map(|effect| effect.kind.clone()).collect();
            (done.report.verdict, names)
        }
        Err(RunError::WrongData(wrong)) => {
            let sentences = wrong.wrong_data.iter();
            let names = sentences.map(|finding| finding.sentence.clone()).collect();
            (wrong.verdict, names)
        }
        Err(other) => return Err(other.into()),
    })
}

/// Speeds over their range, both ways, in any order.
fn speeds(rng: &mut impl Rng, motor: &Motor, holds: usize) -> Vec<f64> {
    let top = motor.top_speed();
    let share = |k: usize| 0.06 * (1.0 / 0.06_f64).powf(k as f64 / (holds - 1) as f64);
    let way = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
    let mut speeds: Vec<f64> = (0..holds)
        .map(|k| about(rng, top * share(k), 0.1) * way(k))
        .collect();
    speeds.shuffle(rng);
    speeds
}

/// The model file, within the tolerances of plates.
fn plate(rng: &mut impl Rng, motor: &Motor, drive: &Drive) -> Result<String> {
    let mut text = String::new();
    writeln!(text, "[motor]")?;
    for (name, value, tolerance) in [
        ("resistance_ohm", motor.resistance, 0.03),
        ("inductance_h", motor.inductance, 0.03),
        ("flux_wb", motor.flux, 0.01),
        ("inertia_kg_m2", motor.inertia, 0.03),
        ("viscous_nm_s", motor.viscous, 0.2),
        ("coulomb_nm", motor.coulomb, 0.2),
    ] {
        writeln!(text, "{name} = {:e}", about(rng, value, tolerance))?;
    }
    writeln!(text, "pole_pairs = {}", motor.pole_pairs)?;
    writeln!(text, "[sensing]")?;
    writeln!(text, "encoder_counts_per_turn = {}", drive.counts)?;
    writeln!(text, "current_lsb_a = {:e}", drive.lsb_a)?;
    writeln!(text, "current_noise_a = {:e}", drive.noise_a)?;
    writeln!(text, "control_hz = {:?}", drive.control_hz)?;
    Ok(text)
}

fn mapping(drive: &Drive) -> String {
    format!(
        "machine = \"pmsm\"\namplitude_invariant = {}\n",
        drive.amplitude
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Drives at 8 to 20 kHz, encoders of 4096 to 2^20 counts, voltages in three frames. Without the ages, frames and means of voltages and
    /// currents in the balances none of 60 ended so. Nine of these 12 were clean before fast
    /// reversals were left out, 10 before a residual below the share of the smallest name counted as nothing.
    #[test]
    fn nothing_is_missing_on_most_clean_motors_and_none_has_a_name() {
        let makes = measure(0, 12, None).unwrap();
        assert!(makes.nothing_missing >= 12, "{makes:?}");
        assert_eq!(makes.false_names, 0, "{makes:?}");
    }

    /// At top speed the harmonic is above the current loop's bandwidth, where the age of a voltage turns it most.
    #[test]
    fn a_flux_harmonic_has_its_size() {
        const SIZE: f64 = 0.02;
        let place = tempfile::tempdir().unwrap();
        let mut errors = Vec::new();
        for (seed, kind) in (0..).zip(&KINDS[1..]) {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
            let motor = Motor {
                harmonic: [SIZE, 6.0],
                ..*kind
            };
            let drive = Drive {
                counts: 131_072.0,
                current_hz: 500.0,
                // A slower record would fold the harmonic.
                every: 2,
                ..drawn_drive(&mut rng, &motor)
            };
            let task = task(&mut rng, &motor, &drive, place.path()).unwrap();
            let effects = task.run(&mut |_, _| ()).unwrap().report.effects;
            let found = effects.iter().find(|effect| effect.kind == "flux_harmonic");
            errors.push(found.map(|found| found.parameters["amplitude"] / SIZE - 1.0));
        }
        let is_near = |error: &Option<f64>| error.is_some_and(|error| error.abs() < 0.03);
        assert!(errors.iter().all(is_near), "{errors:?}");
    }
}
