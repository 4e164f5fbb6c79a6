//! Starts of a drive that does not know where its rotors stand: drawn machines, and how well they are aligned.

mod miswirings;
pub mod report;

pub use miswirings::{Miswiring, miswirings, turned_round};

use control::alignment::Misalignment;
use control::encoder::Interface;
use control::format::Misfit;
use control::supervisor::{Demand, State};
use hal_sim::board::{BoardConfig, Comparators};
use hal_sim::boards::BoardKind;
use hal_sim::drive::Drive;
use hal_sim::experiment::Setup;
use hal_sim::plates::plates;
use hal_sim::sensors::incremental;
use hal_sim::start::{Start, settle};
use plant::Axis;
use plant::effects::{
    AnyEffect, Cogging, DeadTime, EffectModel, LeadError, Place, StribeckFriction,
};
use plant::machine::{Coupling, Machine};
use plant::model::Model;
use rand_distr::{Distribution, Uniform};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use std::f64::consts::TAU;

/// What came of a start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// What the drive was doing at the end.
    pub state: State,
    /// Why it could not be aligned.
    pub misalignment: Option<Misalignment>,
    /// How far the electrical angles are off, degrees: screw, nut.
    pub error_deg: [f64; 2],
    /// Furthest that the table was from where it started, m.
    pub travel_m: f64,
    /// Largest torque that a current made, N m.
    pub torque_nm: f64,
    /// How long it took, s.
    pub seconds: f64,
}

impl Outcome {
    /// Both rotors were found.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.state == State::Ready
    }

    /// The larger error of the electrical angle, degrees.
    #[must_use]
    pub fn error_deg_worst(&self) -> f64 {
        self.error_deg
            .iter()
            .fold(0.0, |worst, error| worst.max(error.abs()))
    }
}

/// Windings and magnets, by how much they are warmer than the plate's 20 degrees Celsius, K: an unheated hall, and a motor at its rated load.
const COLD_K: f64 = -20.0;
const HOT_K: f64 = 80.0;
/// Resistance of copper a kelvin (IEC 60028: 0.00393 at 20 degrees Celsius), and flux of NdFeB magnets (usual data sheets).
const COPPER_PER_K: f64 = 0.003_93;
const MAGNET_PER_K: f64 = -0.001_1;

/// Longest that an alignment may take, s.
const LONGEST_S: f64 = 20.0;

/// The coupled machine on the default board, everything in its place, standing at zero.
#[must_use]
pub fn plain() -> Start {
    let model = Model {
        feed: plant::model::FeedModel {
            load_n: 0.0,
            ..Model::coupled().feed
        },
        ..Model::coupled()
    };
    let Setup { board, tuning, .. } = Setup::real(model.clone(), Coupling::Coupled);
    let board = BoardConfig {
        dead_time_s: 500e-9,
        measure_zeros: true,
        ..board
    };
    Start {
        plate: plates(&model, Coupling::Coupled, &board, tuning),
        model,
        board,
        angles: [0.0; 2],
    }
}

/// A machine drawn from `seed`: where the rotors stand, friction of bearings, pair and guideway with its break-away, a
/// load that this holds, cogging, torque harmonics, lead error, encoders of 2^20 or 10,000 counts that count either way,
/// with an index or without, dead time with an error, and a plate whose resistance, inductance and flux are a little wrong.
#[must_use]
pub fn drawn(seed: u64) -> Start {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut draw = |low: f64, high: f64| {
        Uniform::new(low, high)
            .map(|range| range.sample(&mut random))
            .unwrap_or(low)
    };
    let mut start = plain();
    start.angles = [draw(0.0, TAU), draw(0.0, TAU)];
    start.board.seed = seed;
    let model = &mut start.model;
    for axis in Axis::ALL {
        let motor = model.motor_mut(axis);
        motor.coulomb_nm = draw(0.03, 0.06);
        for harmonic in &mut motor.torque_harmonics {
            harmonic.phase_rad = draw(0.0, TAU);
            harmonic.amplitude_nm *= draw(0.0, 0.5);
        }
        let place = match axis {
            Axis::Screw => Place::Screw,
            Axis::Nut => Place::Nut,
        };
        model.effects.extend(EffectModel::new(
            place,
            StribeckFriction {
                amplitude: draw(0.0, 0.03),
                speed: 0.5,
            },
        ));
        model.effects.extend(EffectModel::new(
            place,
            Cogging {
                order: 36.0,
                amplitude: draw(0.0, 0.0065),
                phase: draw(0.0, TAU),
            },
        ));
        // What the drive does not know of its dead time.
        model.effects.extend(EffectModel::new(
            place,
            DeadTime {
                value: draw(0.0, 0.4),
            },
        ));
    }
    let feed = &mut model.feed;
    feed.pair_coulomb_nm = draw(0.03, 0.10);
    feed.guideway_coulomb_n = draw(10.0, 60.0);
    model.effects.extend(EffectModel::new(
        Place::Feed,
        LeadError {
            order: 1.0,
            amplitude: draw(0.0, 6e-6),
            phase: draw(0.0, TAU),
        },
    ));
    let part = draw(-0.8, 0.8);
    model.feed.load_n = part * held_load_n(model);

    let counts = if draw(0.0, 1.0) < 0.5 {
        1 << 20
    } else {
        10_000
    };
    start.board.sensors.encoders = incremental(counts);
    let tuning = Setup::real(start.model.clone(), Coupling::Coupled).tuning;
    start.plate = plates(&start.model, Coupling::Coupled, &start.board, tuning);
    for k in 0..2 {
        let reversed = draw(0.0, 1.0) < 0.5;
        start.board.wiring.motors[k].encoder_reversed = reversed;
        let plate = &mut start.plate.motors[k];
        plate.encoder.reversed = (draw(0.0, 1.0) < 0.5).then_some(reversed);
        plate.resistance_ohm *= draw(0.9, 1.1);
        plate.inductance_h *= draw(0.9, 1.1);
        plate.flux_wb *= draw(0.95, 1.05);
    }
    for k in 0..2 {
        if draw(0.0, 1.0) < 0.5 {
            let interface = Interface::IncrementalWithIndex;
            start.board.sensors.encoders[k].interface = interface;
            start.plate.motors[k].encoder.interface = interface;
        }
    }
    start
}

/// The same machine with a load of one and a half to three times what friction holds.
#[must_use]
pub fn loose(seed: u64) -> Start {
    let mut start = drawn(seed);
    let part = 1.5 + 1.5 * (seed % 8) as f64 / 7.0;
    let held = held_load_n(&start.model);
    start.model.feed.load_n = if seed.is_multiple_of(2) { part } else { -part } * held;
    start
}

/// A board's own machine ([`BoardKind::machine`] of the coupled model), drawn from `seed`: where the rotors stand, a load of
/// up to half of what friction holds, either way, and torque over the rotors' angle of up to the paper's.
#[must_use]
pub fn of_board(board: BoardKind, seed: u64) -> Start {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut draw = |low: f64, high: f64| {
        Uniform::new(low, high)
            .map(|range| range.sample(&mut random))
            .unwrap_or(low)
    };
    let mut model = board.machine(&Model::coupled(), Coupling::Coupled);
    let angles = [draw(0.0, TAU), draw(0.0, TAU)];
    model.feed.load_n = draw(-0.5, 0.5) * held_load_n(&model);
    let part = draw(0.0, 1.0);
    for axis in Axis::ALL {
        for harmonic in &mut model.motor_mut(axis).torque_harmonics {
            harmonic.amplitude_nm *= part;
            harmonic.phase_rad = draw(0.0, TAU);
        }
    }
    Start {
        model,
        board: BoardConfig {
            seed,
            comparators: Comparators::Amplifiers,
            ..board.config()
        },
        plate: board.plate(),
        angles,
    }
}

/// The same as [`of_board`], of which nobody says how its encoders count, each either way; friction is elastic over 1 to 10 um of the table.
/// Even seeds are cold, odd ones hot.
#[must_use]
pub fn unknown(board: BoardKind, seed: u64) -> Start {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(!seed);
    let mut draw = |low: f64, high: f64| {
        Uniform::new(low, high)
            .map(|range| range.sample(&mut random))
            .unwrap_or(low)
    };
    let mut start = of_board(board, seed);
    start.model.feed.presliding_m = draw(1e-6, 10e-6);
    let kelvin = if seed.is_multiple_of(2) {
        COLD_K
    } else {
        HOT_K
    };
    for axis in Axis::ALL {
        let motor = start.model.motor_mut(axis);
        motor.resistance_ohm *= 1.0 + COPPER_PER_K * kelvin;
        motor.flux_wb *= 1.0 + MAGNET_PER_K * kelvin;
        start.board.wiring.motors[axis.index()].encoder_reversed = draw(0.0, 1.0) < 0.5;
        start.plate.motors[axis.index()].encoder.reversed = None;
    }
    start
}

/// By how much friction holds the rotors at every angle without a current, N m: the smallest of either alone, by bearing, ball pair
/// and guideway against the load and what torque its harmonics and cogging make at most; and of both together, which only
/// the bearings hold, for neither pair nor guideway nor load sees them turn. Below 0 a rotor that leaves the angle where
/// it stands by a little goes on to the next one where it stands: half a period of its harmonics at most, and, alone, with the table.
#[must_use]
pub fn margin_nm(start: &Start) -> f64 {
    let feed = &start.model.feed;
    let r = feed.travel_per_radian();
    let held = feed.pair_coulomb_nm + feed.guideway_coulomb_n * r - feed.load_n.abs() * r;
    let bearings = Axis::ALL.map(|axis| {
        let motor = start.model.motor(axis);
        let harmonics = motor.torque_harmonics.iter();
        let most: f64 = harmonics.map(|harmonic| harmonic.amplitude_nm.abs()).sum();
        let effects = start.model.effects.iter();
        let more: f64 = effects
            .filter(|effect| effect.place().has(axis))
            .map(|effect| match effect.effect() {
                AnyEffect::StribeckFriction(friction) => friction.amplitude,
                AnyEffect::Cogging(cogging) => -cogging.amplitude,
                _ => 0.0,
            })
            .sum();
        motor.coulomb_nm + more - most
    });
    let together = bearings.iter().sum();
    bearings
        .map(|bearing| bearing + held)
        .into_iter()
        .fold(together, f64::min)
}

/// Switches the drive on and lets it align, or find why it cannot.
///
/// # Errors
/// [`Misfit`] if a gain does not fit its format.
pub fn switch_on(start: &Start) -> Result<Outcome, Misfit> {
    switch_on_with(start, |_| ())
}

/// The same, with `each` called after each PWM period.
///
/// # Errors
/// [`Misfit`] if a gain does not fit its format.
pub fn switch_on_with(start: &Start, mut each: impl FnMut(&Drive)) -> Result<Outcome, Misfit> {
    let mut drive = Drive::new(&start.model, Coupling::Coupled, start.board, &start.plate)?;
    drive.request.demand = Demand::Align;
    settle(&mut drive.board, start.angles);
    let begun = drive.board.machine.table_position();
    let (mut travel_m, mut torque_nm) = (0.0f64, 0.0f64);
    let period_s = start.board.pwm_period_s();
    let longest = (LONGEST_S / period_s) as u64;
    while drive.periods() < longest && !matches!(drive.state(), State::Ready | State::Fault(_)) {
        drive.period();
        each(&drive);
        let machine = &drive.board.machine;
        travel_m = travel_m.max((machine.table_position() - begun).abs());
        for axis in Axis::ALL {
            torque_nm = torque_nm.max(torque(start, machine, axis).abs());
        }
    }
    // What still moves when the bridges are open belongs to it.
    for _ in 0..(0.1 / period_s) as u64 {
        drive.period();
        each(&drive);
        let moved = drive.board.machine.table_position() - begun;
        travel_m = travel_m.max(moved.abs());
    }
    Ok(Outcome {
        state: drive.state(),
        misalignment: match drive.state() {
            State::Fault(fault) if fault.is_misalignment() => drive.misalignment(),
            _ => None,
        },
        error_deg: Axis::ALL.map(|axis| error_deg(start, &drive, axis)),
        travel_m,
        torque_nm,
        seconds: drive.periods() as f64 * period_s,
    })
}

/// Torque of the currents of `axis`, N m.
fn torque(start: &Start, machine: &Machine, axis: Axis) -> f64 {
    let (motor, state) = (start.model.motor(axis), machine.motor(axis));
    let p = f64::from(motor.pole_pairs);
    let (sin, cos) = (p * state.theta).sin_cos();
    p * motor.flux_wb * (state.i_beta * cos - state.i_alpha * sin)
}

/// How far the electrical angle that the drive has of `axis` is from that of the magnets, seen from the bridge's legs,
/// degrees; 180 if it has none.
#[must_use]
pub fn error_deg(start: &Start, drive: &Drive, axis: Axis) -> f64 {
    let k = axis.index();
    let Some(alignment) = drive.exchange(axis).alignment() else {
        return 180.0;
    };
    let theta_e =
        f64::from(start.model.motor(axis).pole_pairs) * drive.board.machine.motor(axis).theta;
    let windings = [0.0, 1.0, 2.0].map(|phase: f64| (theta_e - phase * TAU / 3.0).cos());
    let [a, b, c] = start.board.wiring.motors[k].legs(windings);
    let truth = (3f64.sqrt() * (b - c)).atan2(2.0 * a - b - c);
    let encoder = &start.board.sensors.encoders[k];
    let word = drive.board.encoder_word(axis, encoder.age_s);
    let counts = f64::from(encoder.interface.counts(word).unwrap_or_default());
    let turns = counts / f64::from(encoder.counts_per_turn);
    let sense = if alignment.reversed { -1.0 } else { 1.0 };
    let zero = f64::from(alignment.theta_e_at_zero.0) / 2f64.powi(32);
    let known = (sense * turns * f64::from(drive.pole_pairs(axis)) + zero) * TAU;
    let off = known - truth;
    off.sin().atan2(off.cos()).to_degrees()
}

/// The load that friction just holds, N: what the guideway takes, and through the lead the pair and the weaker bearing.
#[must_use]
pub fn held_load_n(model: &Model) -> f64 {
    let feed = &model.feed;
    let weaker = model.screw.coulomb_nm.min(model.nut.coulomb_nm);
    feed.guideway_coulomb_n + (feed.pair_coulomb_nm + weaker) / feed.travel_per_radian()
}
