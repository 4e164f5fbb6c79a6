//! Machines drawn at random, as an identification has not seen them: plates that err, effects of every kind, profiles of
//! their own, run as the full drive in closed loop with quantised sensors.
//!
//! Two things make them easier than real machines. A torque has the orders by which the identification names its kind (misalignment 1
//! and 2): a right answer shows the order, not the cause. And their drives do not measure current zeros, so that offsets exist;
//! both boards do.

mod effect;
mod friction;
pub mod profile;

pub use effect::effect;

pub use friction::Widths;

use friction::{Rounded, WIDTHS};
use hal_sim::drive::Drive;
use hal_sim::experiment::{Recorder, Setup};
use plant::effects::{AnyEffect, EffectModel, Place};
use plant::machine::Coupling;
use plant::model::{Model, TorqueHarmonic};
use plant::recording::Recording;
use profile::Profile;
use rand::{Rng, RngExt};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

/// A machine as drawn, with two records of it.
pub struct Machine {
    /// What its plate says.
    pub declared: Model,
    /// What it has beyond that.
    pub effects: Vec<EffectModel>,
    /// What it is, with its effects: plates err.
    pub real: Model,
    /// Its profiles and its friction, in words.
    pub style: String,
    /// The record to identify from.
    pub fit: Recording,
    /// Another one.
    pub check: Recording,
}

/// Length of the ramp to an operating point, s.
const RAMP_S: f64 = 0.25;

/// How the machine's friction turns round.
#[derive(Debug, Clone, Copy)]
enum Rubbing {
    /// At once, and holds what rests.
    Sticks,
    /// As in the shared recordings.
    Rounded,
}

/// Even between two values.
pub fn between(rng: &mut impl Rng, low: f64, high: f64) -> f64 {
    rng.random_range(low..high)
}

/// Even in the logarithm: as many small as large.
fn spread(rng: &mut impl Rng, low: f64, high: f64) -> f64 {
    (low.ln() + (high / low).ln() * rng.random::<f64>()).exp()
}

/// One of a list.
pub fn pick<'a, T>(rng: &mut impl Rng, list: &'a [T]) -> &'a T {
    &list[rng.random_range(0..list.len())]
}

fn sign(rng: &mut impl Rng) -> f64 {
    if rng.random::<bool>() { 1.0 } else { -1.0 }
}

/// The plate: that of the shared recordings' kind, with torque harmonics at phases of the machine's own.
fn plate(rng: &mut impl Rng) -> Model {
    let mut model = Model::coupled();
    for motor in [&mut model.screw, &mut model.nut] {
        motor.torque_harmonics = [
            (6.0, between(rng, 0.07, 0.082)),
            (12.0, between(rng, 0.024, 0.03)),
        ]
        .map(|(order, amplitude_nm)| TorqueHarmonic {
            order,
            amplitude_nm,
            phase_rad: between(rng, -3.1, 3.1),
        })
        .to_vec();
    }
    model
}

/// The machine behind a plate: off by what plates are off by.
fn real(rng: &mut impl Rng, declared: &Model) -> Model {
    let mut model = declared.clone();
    for motor in [&mut model.screw, &mut model.nut] {
        for value in [
            &mut motor.resistance_ohm,
            &mut motor.inductance_h,
            &mut motor.inertia_kg_m2,
        ] {
            *value *= between(rng, 0.97, 1.03);
        }
        motor.flux_wb *= between(rng, 0.99, 1.01);
        for value in [&mut motor.viscous_nm_s, &mut motor.coulomb_nm] {
            *value *= between(rng, 0.8, 1.2);
        }
    }
    let feed = &mut model.feed;
    for value in [
        &mut feed.guideway_coulomb_n,
        &mut feed.guideway_viscous_n_s_per_m,
        &mut feed.pair_coulomb_nm,
        &mut feed.axial_damping_ratio,
    ] {
        *value *= between(rng, 0.8, 1.2);
    }
    model
}

/// What acts on a machine from outside while a period passes.
pub type Act<'a> = dyn Fn(&mut plant::machine::Machine) + 'a;

/// Runs a machine under the drive that its plate gives, over a profile.
fn run(
    declared: &Model,
    (machine, coupling): (&Model, Coupling),
    act: &Act,
    profile: &Profile,
    seed: u64,
) -> Recording {
    let mut setup = Setup::declared(declared.clone(), coupling);
    setup.board.seed = seed;
    // An offset that the drive measures before it starts would be none.
    setup.board.measure_zeros = false;
    let mut drive = Drive::aligned(machine, setup.coupling, setup.board, &setup.plate())
        .expect("gains that fit");
    let every = (declared.sensing.control_hz / declared.sensing.sample_hz).round() as u32;
    let mut recorder = Recorder::default();
    let mut recording = Recording::default();
    let seconds = |s: f64| (s * declared.sensing.sample_hz) as usize;
    let period = |drive: &mut Drive| drive.period_with(|machine, _| act(machine));
    let mut record = |drive: &mut Drive, rows: usize, ask: &mut dyn FnMut(&mut Drive, usize)| {
        for row in 0..rows {
            ask(drive, row);
            recording.push(&recorder.row(drive));
            (0..every).for_each(|_| period(drive));
        }
    };
    // The sensors are read for the first time within the first period.
    period(&mut drive);
    record(&mut drive, seconds(profile.rest_s), &mut |_, _| ());
    let mut from = (0.0, 0.0);
    for leg in &profile.legs {
        let ramp = seconds(RAMP_S);
        record(&mut drive, seconds(leg.seconds), &mut |drive, row| {
            if row <= ramp {
                let part = row as f64 / ramp as f64;
                let between = |a: f64, b: f64| a + (b - a) * part;
                drive
                    .command(between(from.0, leg.velocity), between(from.1, leg.base))
                    .expect("speeds that the drive allows");
            }
        });
        from = (leg.velocity, leg.base);
    }
    recording
}

/// Draws a machine with effects of the given kinds and records it.
pub fn draw(seed: u64, kinds: &[&str]) -> Machine {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let declared = plate(&mut rng);
    let mut machine = real(&mut rng, &declared);
    let bold = rng.random::<bool>();
    let effects: Vec<EffectModel> = kinds
        .iter()
        .map(|kind| effect(&mut rng, kind, bold))
        .collect();
    let rubbing = *pick(&mut rng, &[Rubbing::Sticks, Rubbing::Rounded]);
    let profiles = profile::draw(&mut rng, kinds.contains(&"stribeck_friction"));
    let mut of_run = |profile: &Profile, seed: u64| {
        machine.effects = effects
            .iter()
            .map(|effect| over(effect, profile.seconds()))
            .collect();
        match rubbing {
            Rubbing::Sticks => run(
                &declared,
                (&machine, Coupling::Coupled),
                &|_| (),
                profile,
                seed,
            ),
            Rubbing::Rounded => {
                let (smooth, rounded) = Rounded::split(&machine, WIDTHS);
                let smooth = (&smooth, Coupling::Coupled);
                run(&declared, smooth, &|m| rounded.act(m), profile, seed)
            }
        }
    };
    let fit = of_run(&profiles.fit, seed);
    let check = of_run(&profiles.check, seed ^ 0x5555);
    Machine {
        declared,
        effects,
        real: machine,
        style: format!("{} {rubbing:?}", profiles.style),
        fit,
        check,
    }
}

/// A machine without effects on which something acts, over given profiles. Lumped, its motors are two that know nothing
/// of each other, each with a constant load.
pub fn acted_on_as(seed: u64, coupling: Coupling, act: &Act, profiles: [Profile; 2]) -> Machine {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let declared = plate(&mut rng);
    let machine = real(&mut rng, &declared);
    recorded([declared, machine], seed, coupling, act, profiles)
}

/// A machine that is what its plate says, on which something acts, over given profiles.
pub fn as_declared(model: Model, seed: u64, act: &Act, profiles: [Profile; 2]) -> Machine {
    recorded(
        [model.clone(), model],
        seed,
        Coupling::Coupled,
        act,
        profiles,
    )
}

/// A machine that is what its plate says, whose friction turns round over given widths.
pub fn rubbing(model: Model, widths: Widths, seed: u64, profiles: [Profile; 2]) -> Machine {
    let (smooth, friction) = Rounded::split(&model, widths);
    let act = |machine: &mut plant::machine::Machine| friction.act(machine);
    recorded([model, smooth], seed, Coupling::Coupled, &act, profiles)
}

/// The records of a machine without effects of its own, of which a plate is declared.
fn recorded(
    [declared, machine]: [Model; 2],
    seed: u64,
    coupling: Coupling,
    act: &Act,
    [fit, check]: [Profile; 2],
) -> Machine {
    let acted = (&machine, coupling);
    Machine {
        fit: run(&declared, acted, act, &fit, seed),
        check: run(&declared, acted, act, &check, seed ^ 0x5555),
        style: "acted on".into(),
        effects: Vec::new(),
        real: machine,
        declared,
    }
}

/// Draws a motor alone: the nut's of a machine whose motors know nothing of each other. `act` acts on it.
pub fn alone(seed: u64, kinds: &[&str], act: &Act) -> Machine {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let declared = plate(&mut rng);
    let mut machine = real(&mut rng, &declared);
    let bold = rng.random::<bool>();
    let place = |effect: EffectModel| {
        EffectModel::new(Place::Nut, effect.effect().clone()).expect("a kind that motors have")
    };
    let effects: Vec<EffectModel> = kinds
        .iter()
        .map(|kind| {
            loop {
                let drawn = effect(&mut rng, kind, bold);
                if drawn.place() != Place::Feed {
                    break place(drawn);
                }
            }
        })
        .collect();
    let [fit, check] = [9, 6].map(|legs| profile::alone(&mut rng, legs));
    let mut of_run = |profile: &Profile, seed: u64| {
        machine.effects = effects
            .iter()
            .map(|effect| over(effect, profile.seconds()))
            .collect();
        run(&declared, (&machine, Coupling::Lumped), act, profile, seed)
    };
    let fit = of_run(&fit, seed);
    let check = of_run(&check, seed ^ 0x5555);
    Machine {
        fit,
        check,
        style: "alone".into(),
        effects,
        real: machine,
        declared,
    }
}

/// As [`acted_on_as`], of a double drive.
pub fn acted_on(seed: u64, act: &Act, profiles: [Profile; 2]) -> Machine {
    acted_on_as(seed, Coupling::Coupled, act, profiles)
}

/// A drift is given over the run, whatever its length.
fn over(effect: &EffectModel, run_s: f64) -> EffectModel {
    let mut parameters = effect.effect().parameters();
    for (name, value) in &mut parameters {
        if name == "duration_s" {
            *value = run_s;
        }
    }
    let parameters = parameters
        .iter()
        .map(|(name, value)| (name.as_str(), *value));
    let same = AnyEffect::from_parameters(effect.effect().kind(), parameters)
        .expect("parameters that were valid");
    EffectModel::new(effect.place(), same).expect("the place that it was at")
}
