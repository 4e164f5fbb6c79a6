//! Machines as users have them, with what their datasheets say and what no datasheet says.
//!
//! Motor, bus and screw are sized together, as an engineer does with datasheets:
//!
//! - The bus makes the rated current 0.15 to 40 A: 50 W has any bus, 2 kW has 50 V at least.
//! - At the rated speed the motor induces 50 to 65 % of the largest voltage that the bus makes.
//! - The electrical frequency at the rated speed is 420 Hz at most: motors of 10 pole pairs are slow ones.
//! - Bearings, ball pair and guideway each take 1 to 5 % of the rated torque.
//! - Without a brake, friction holds the load and the effects that push at rest; all of them take 80 % of it at most. With one, the load
//!   takes up to 25 % of the rated torque.
//! - At rest a shaft stands: a torque over time takes a quarter of its bearing's friction at most.
//! - The current sensor's range is 2.5 times the rated current.
//! - The travel is at least five leads.
//! - Friction is elastic before it slides on three machines of four, over 1 to 10 um of the table.

use crate::alignment::held_load_n;
use crate::commissioning::draw::{Draw, Drawn, feed, motor, size};
use control::mt6835::COUNTS_PER_TURN;
use hal_sim::experiment::Setup;
use link::host::settings::some_to_toml;
use link::settings::Settings;
use plant::Axis;
use plant::effects::{AnyEffect, EffectModel, Place};
use plant::machine::Coupling;
use plant::model::{Brake, EncoderKind, InstallationModel, Model, SensingModel};

/// Rated power of the screw's motor, W.
const POWER_W: [f64; 2] = [50.0, 2000.0];
/// Supply, V.
const BUS_V: [f64; 2] = [12.0, 310.0];
/// Rated current as power over bus, A.
const CURRENT_A: [f64; 2] = [0.15, 40.0];
/// Largest electrical frequency, Hz.
const ELECTRICAL_HZ: f64 = 420.0;
/// Leads, m.
const LEADS_M: [f64; 6] = [2e-3, 4e-3, 5e-3, 10e-3, 16e-3, 20e-3];
/// Travel, m.
const TRAVEL_M: [f64; 2] = [0.1, 2.0];
/// Travel of the table over which friction is elastic before it slides, m.
const PRESLIDING_M: [f64; 2] = [1e-6, 10e-6];
/// Part of what friction holds that pushes at most.
const HELD: f64 = 0.8;
/// Part of a bearing's friction that a torque over time takes at most.
const SHAKEN: f64 = 0.25;
/// Bits of an incremental encoder.
const BITS: [u32; 12] = [12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23];

/// A user's machine.
pub struct Machine {
    /// The truth.
    pub model: Model,
    /// The settings file: what the datasheets say.
    pub datasheet: String,
    /// The table velocity that the user records at, m/s: half a lead a second, less on a short travel.
    pub velocity: f64,
}

/// The machine of a seed.
#[must_use]
pub fn machine(seed: u64) -> Machine {
    let mut draw = Draw::of(seed);
    let power_w = draw.by_size(POWER_W);
    let bus_v = draw.by_size([
        BUS_V[0].max(power_w / CURRENT_A[1]),
        BUS_V[1].min(power_w / CURRENT_A[0]),
    ]);
    let part = draw.between([0.5, 1.0]);
    let screw = slow_enough(&mut draw, power_w, bus_v);
    let nut = slow_enough(&mut draw, part * power_w, bus_v);
    let lead_m = draw.one_of(&LEADS_M);
    let travel_m = draw.by_size([TRAVEL_M[0].max(5.0 * lead_m), TRAVEL_M[1]]);
    let rated_nm = screw.rated_nm.min(nut.rated_nm);
    let mut model = Model {
        feed: feed(&mut draw, lead_m, [&screw, &nut]),
        screw: screw.model.clone(),
        nut: nut.model.clone(),
        sensing: sensing(&mut draw, screw.rated_a.max(nut.rated_a)),
        installation: InstallationModel {
            bus_v,
            travel_m,
            scale_count_m: draw.one_of(&[1e-9, 5e-9, 10e-9, 50e-9]),
            brake: draw.one_of(&[Brake::None, Brake::Fitted]),
        },
        measured: None,
        effects: Vec::new(),
    };
    let share = draw.between([-1.0, 1.0]);
    model.feed.load_n = share
        * match model.installation.brake {
            Brake::None => HELD * held_load_n(&model),
            Brake::Ideal | Brake::Fitted => 0.25 * rated_nm / model.feed.travel_per_radian(),
        };
    // The datasheets know neither harmonics nor effects.
    for motor in [&mut model.screw, &mut model.nut] {
        motor.torque_harmonics.clear();
    }
    let datasheet = datasheet(&mut draw, &model, [&screw, &nut]);
    for _ in 0..draw.one_of(&[1, 2, 3, 4]) {
        let effect = effect(&mut draw, &model, [&screw, &nut]);
        let twice = model.effects.iter().any(|other| {
            other.effect().kind() == effect.effect().kind() && other.place() == effect.place()
        });
        if !twice {
            model.effects.push(effect);
        }
    }
    if draw.one_of(&[true, true, true, false]) {
        model.feed.presliding_m = draw.by_size(PRESLIDING_M);
    }
    if let Brake::None = model.installation.brake {
        let most = HELD * held_load_n(&model) - pushed_at_rest_n(&model);
        let most = most.max(0.0);
        model.feed.load_n = model.feed.load_n.clamp(-most, most);
    }
    Machine {
        velocity: (0.5 * lead_m).min(0.08 * travel_m),
        model,
        datasheet,
    }
}

/// What the effects push the table with while it rests, N: those of the worse shaft, and those of the feed.
fn pushed_at_rest_n(model: &Model) -> f64 {
    const PUSHES: [&str; 5] = [
        "cogging",
        "torque_harmonic",
        "coupling_misalignment",
        "angle_periodic",
        "time_periodic",
    ];
    let at = |place: Place, kinds: &[&str]| -> f64 {
        let effects = model
            .effects
            .iter()
            .filter(|effect| effect.place() == place && kinds.contains(&effect.effect().kind()));
        effects
            .flat_map(|effect| effect.effect().parameters())
            .filter(|(name, _)| name == "amplitude")
            .map(|(_, amplitude)| amplitude)
            .sum()
    };
    let shaft = at(Place::Screw, &PUSHES).max(at(Place::Nut, &PUSHES));
    (shaft + at(Place::Feed, &["ball_passage"])) / model.feed.travel_per_radian()
}

/// A motor whose electrical frequency a drive of 20 kHz is made for.
fn slow_enough(draw: &mut Draw, power_w: f64, bus_v: f64) -> Drawn {
    loop {
        let drawn = motor(draw, power_w, bus_v, &[2, 3, 4, 5, 6, 7, 8, 10]);
        if f64::from(drawn.model.pole_pairs) * drawn.speed_max_rpm / 60.0 <= ELECTRICAL_HZ {
            return drawn;
        }
    }
}

fn sensing(draw: &mut Draw, rated_a: f64) -> SensingModel {
    let encoder = draw.one_of(&[
        EncoderKind::Incremental,
        EncoderKind::Index,
        EncoderKind::Absolute,
    ]);
    let bits = draw.one_of(&BITS);
    let current_lsb_a = 2.5 * rated_a * (2f64 / 3.0).sqrt() / 2048.0;
    SensingModel {
        encoder,
        // The absolute encoder that the drive reads is an MT6835.
        encoder_counts_per_turn: match encoder {
            EncoderKind::Absolute => COUNTS_PER_TURN,
            EncoderKind::Incremental | EncoderKind::Index => 1 << bits,
        },
        current_lsb_a,
        current_noise_a: draw.between([0.3, 1.0]) * current_lsb_a,
        table_noise_m: draw.by_size([1e-9, 20e-9]),
        ..Model::coupled().sensing
    }
}

/// Resistance and inductance are off by 10 to 25 %, the voltage constant by up to 10 %, inertia by up to 80 %. Half of the users do
/// not know which way an encoder counts.
fn datasheet(draw: &mut Draw, model: &Model, drawn: [&Drawn; 2]) -> String {
    let mut plate = Setup::declared(model.clone(), Coupling::Coupled).plate();
    for motor in &mut plate.motors {
        let mut off = || 1.0 + draw.one_of(&[-1.0, 1.0]) * draw.between([0.1, 0.25]);
        motor.resistance_ohm *= off();
        motor.inductance_h *= off();
        motor.flux_wb *= draw.between([0.9, 1.1]);
        motor.inertia_kg_m2 *= draw.by_size([1.0 / 1.8, 1.8]);
        if draw.one_of(&[true, false]) {
            motor.encoder.reversed = None;
        }
    }
    size(&mut plate, drawn);
    let settings = Settings::of_plate(&plate);
    some_to_toml(&settings, |setting| {
        ["screw", "nut", "bridge", "feed", "alignment"].contains(&setting.group())
    })
}

/// An effect that the datasheets do not have, in proportion to the machine.
fn effect(draw: &mut Draw, model: &Model, drawn: [&Drawn; 2]) -> EffectModel {
    let (axis, place) = draw.one_of(&[(0, Place::Screw), (1, Place::Nut)]);
    let Drawn {
        rated_nm, rated_a, ..
    } = *drawn[axis];
    let lead_m = model.feed.lead_m;
    let travel = model.feed.travel_per_radian();
    let phase = draw.between([-3.1, 3.1]);
    let order = |order: f64, amplitude: f64| {
        vec![("order", order), ("amplitude", amplitude), ("phase", phase)]
    };
    let nm = |draw: &mut Draw| draw.by_size([0.005, 0.03]) * rated_nm;
    let kind = draw.one_of(&KINDS);
    let (place, parameters) = match kind {
        "cogging" => (
            place,
            order(draw.one_of(&[12.0, 24.0, 36.0, 20.0]), nm(draw)),
        ),
        "torque_harmonic" => (place, order(draw.one_of(&[6.0, 12.0]), nm(draw))),
        "flux_harmonic" => (
            place,
            order(draw.one_of(&[6.0, 12.0]), draw.by_size([0.005, 0.03])),
        ),
        "coupling_misalignment" => (place, order(draw.one_of(&[1.0, 2.0]), nm(draw))),
        "angle_periodic" => (
            place,
            order(draw.one_of(&[7.0, 11.0, 17.0, 23.0]), nm(draw)),
        ),
        "encoder_eccentricity" => (place, order(1.0, draw.by_size([1e-4, 2e-3]))),
        "current_offset" => {
            let mut off = || draw.one_of(&[-1.0, 1.0]) * draw.by_size([0.003, 0.02]) * rated_a;
            (place, vec![("off_a", off()), ("off_b", off())])
        }
        "current_gain" => (
            place,
            vec![
                ("gain_a", draw.between([-0.03, 0.03])),
                ("gain_b", draw.between([-0.03, 0.03])),
            ],
        ),
        "time_periodic" => (
            place,
            vec![
                ("hz", draw.between([6.0, 140.0])),
                (
                    "amplitude",
                    nm(draw).min(SHAKEN * model.motor(Axis::ALL[axis]).coulomb_nm),
                ),
                ("phase", phase),
            ],
        ),
        "stribeck_friction" => (
            place,
            vec![
                ("amplitude", draw.by_size([0.005, 0.03]) * rated_nm),
                ("speed", draw.between([3.0, 12.0])),
            ],
        ),
        // Both bridges hang on one timer's dead time.
        "dead_time" => (
            Place::Both,
            vec![(
                "value",
                draw.between([3e-3, 15e-3]) * model.installation.bus_v,
            )],
        ),
        "lead_error" => (
            Place::Feed,
            order(
                draw.one_of(&[1.0, 2.0]),
                draw.by_size([4e-5, 1e-3]) * lead_m,
            ),
        ),
        "ball_passage" => (Place::Feed, order(draw.between([3.2, 18.0]), nm(draw))),
        "position_load" => (
            Place::Feed,
            // Over the travel it takes up to a tenth of the rated torque.
            vec![(
                "value",
                draw.between([-0.1, 0.1]) * rated_nm / travel / model.installation.travel_m,
            )],
        ),
        "backlash" => (
            Place::Feed,
            vec![("value", draw.by_size([1e-4, 2e-3]) * lead_m)],
        ),
        other => unreachable!("no sizes for {other}"),
    };
    let effect =
        AnyEffect::from_parameters(kind, parameters).expect("parameters within their ranges");
    EffectModel::new(place, effect).expect("a place that the kind allows")
}

/// Effects that act while a speed is held. Drifts act over hours; a stiffness is a part of the feed.
const KINDS: [&str; 15] = [
    "cogging",
    "torque_harmonic",
    "flux_harmonic",
    "coupling_misalignment",
    "angle_periodic",
    "encoder_eccentricity",
    "current_offset",
    "current_gain",
    "time_periodic",
    "stribeck_friction",
    "dead_time",
    "lead_error",
    "ball_passage",
    "position_load",
    "backlash",
];
