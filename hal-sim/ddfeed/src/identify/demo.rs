//! `ddfeed identify --demo`: a machine with an effect drawn at random, recorded and identified.

use super::{IdentifyOptions, trace};
use crate::output::{Folder, refuse_inputs};
use anyhow::{Context, Result};
use hal_sim::experiment::{
    CHECK, FIT, HELD_S, OperatingPoint, RPM, Recorder, Setup, settle_quietly,
};
use identify::records::{Mapping, OnFault};
use identify::run::Task;
use indicatif::{ProgressBar, ProgressStyle};
use plant::effects::{AnyEffect, EffectModel, Place};
use plant::machine::Coupling;
use plant::model::Model;
use plant::recording::Recording;
use std::time::SystemTime;

/// Ramp from one to the next, s.
const RAMP_S: f64 = 0.25;

/// An effect by its kind, its place, and its parameters, of sizes that are well seen.
pub(super) type Drawn = (&'static str, Place, &'static [(&'static str, f64)]);

/// The effects that a demonstration draws from.
pub const EFFECTS: [Drawn; 8] = [
    (
        "cogging",
        Place::Screw,
        &[("order", 36.0), ("amplitude", 0.03), ("phase", 0.4)],
    ),
    (
        "cogging",
        Place::Nut,
        &[("order", 24.0), ("amplitude", 0.025), ("phase", -1.1)],
    ),
    (
        "coupling_misalignment",
        Place::Nut,
        &[("order", 1.0), ("amplitude", 0.04), ("phase", 0.9)],
    ),
    (
        "torque_harmonic",
        Place::Screw,
        &[("order", 18.0), ("amplitude", 0.03), ("phase", 2.0)],
    ),
    (
        "current_offset",
        Place::Nut,
        &[("off_a", 0.05), ("off_b", -0.04)],
    ),
    // No drift: its time begins again with each stretch that is recorded.
    (
        "flux_harmonic",
        Place::Screw,
        &[("order", 6.0), ("amplitude", 0.03), ("phase", 0.7)],
    ),
    (
        "encoder_eccentricity",
        Place::Screw,
        &[("order", 1.0), ("amplitude", 1.5e-3), ("phase", 0.2)],
    ),
    (
        "lead_error",
        Place::Feed,
        &[("order", 1.0), ("amplitude", 4e-6), ("phase", 1.3)],
    ),
];

/// Records, identifies, and says what was injected.
pub(super) fn run(options: &IdentifyOptions) -> Result<()> {
    let seed = options.seed.unwrap_or_else(|| {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        now.map_or(1, |since| u64::from(since.subsec_nanos()) % 1000)
    });
    let records = options.out.join("demo");
    refuse_inputs(&options.out, &trace::WRITTEN, &[])?;
    let folder = Folder::open(&records)?;
    let (kind, place, parameters) = EFFECTS[seed as usize % EFFECTS.len()];
    // Sizes differ from seed to seed, by up to a third.
    let size = 1.0 + ((seed / EFFECTS.len() as u64) % 7) as f64 / 20.0;
    let parameters: Vec<(&str, f64)> = parameters
        .iter()
        .map(|(name, value)| match *name {
            "order" | "phase" => (*name, *value),
            _ => (*name, size * value),
        })
        .collect();
    let effect =
        AnyEffect::from_parameters(kind, parameters.iter().copied()).map_err(anyhow::Error::msg)?;
    let declared = Model::coupled();
    let mut real = declared.clone();
    real.effects
        .push(EffectModel::new(place, effect).context("a place that the kind allows")?);
    let bar = ProgressBar::new((FIT.len() + CHECK.len()) as u64);
    let style = ProgressStyle::with_template(
        "recording a simulated machine {bar:40} {pos}/{len} ({elapsed})",
    );
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.tick();
    for (k, (name, points)) in [("fit.csv.gz", &FIT[..]), ("check.csv.gz", &CHECK[..])]
        .into_iter()
        .enumerate()
    {
        let recording = record([&declared, &real], points, HELD_S, seed + k as u64, || {
            bar.inc(1)
        })?;
        folder.put(name, |path| Ok(recording.save(path)?))?;
    }
    bar.finish_and_clear();
    folder.put_text("model.toml", &declared.to_toml())?;
    println!(
        "recorded: {}, {}, and what the machine declares: {}",
        folder.path("fit.csv.gz").display(),
        folder.path("check.csv.gz").display(),
        folder.path("model.toml").display()
    );
    let task = Task {
        model: folder.path("model.toml"),
        fit: vec![folder.path("fit.csv.gz")],
        check: vec![folder.path("check.csv.gz")],
        mapping: Mapping::default(),
        on_fault: OnFault::Refuse,
    };
    trace::carry_out(&task, options, Some(seed))?;
    let values: Vec<String> = parameters
        .iter()
        .map(|(name, value)| format!("{name} {value}"))
        .collect();
    println!(
        "what was put in with --seed {seed}: {kind} at {}: {}. Another machine: --seed {}",
        place.name(),
        values.join(", "),
        seed + 1
    );
    Ok(())
}

/// A run of the second model's machine, under the drive that is set up for the first one, over operating points.
pub fn record(
    [declared, real]: [&Model; 2],
    points: &[(f64, f64)],
    held_s: f64,
    seed: u64,
    mut done: impl FnMut(),
) -> Result<Recording> {
    let mut setup = Setup::declared(declared.clone(), Coupling::Coupled);
    setup.board.seed = seed;
    // An offset that the drive measures before it starts would be none.
    setup.board.measure_zeros = false;
    let mut drive =
        hal_sim::drive::Drive::aligned(real, setup.coupling, setup.board, &setup.plate())?;
    let every = (declared.sensing.control_hz / declared.sensing.sample_hz).round() as u32;
    let mut recorder = Recorder::default();
    let mut recording = Recording::default();
    let mut from = points[0];
    let first = OperatingPoint {
        velocity: from.0 * 1e-3,
        base: from.1 * RPM,
    };
    settle_quietly(&mut drive, first)?;
    let rows = |seconds: f64| (seconds * declared.sensing.sample_hz) as usize;
    for &to in points {
        for row in 0..rows(held_s + RAMP_S) {
            let share = (row as f64 / rows(RAMP_S) as f64).min(1.0);
            let between = |a: f64, b: f64| a + (b - a) * share;
            drive
                .command(between(from.0, to.0) * 1e-3, between(from.1, to.1) * RPM)
                .map_err(hal_sim::experiment::ExperimentError::from)?;
            (0..every).for_each(|_| drive.period());
            recording.push(&recorder.row(&mut drive));
        }
        from = to;
        done();
    }
    Ok(recording)
}
