//! Machines of two decades of power, and what a person knows of them at first.

use crate::alignment::{held_load_n, plain};
use control::plate::DrivePlate;
use hal_sim::board::BoardConfig;
use hal_sim::plates::{REGENERATION, plates};
use hal_sim::sensors::{Adc, incremental};
use hal_sim::start::Start;
use plant::effects::{
    Cogging, CurrentGain, DeadTime, EffectModel, EncoderEccentricity, Place, StribeckFriction,
};
use plant::machine::Coupling;
use plant::model::{FeedModel, Model, MotorModel, TorqueHarmonic};
use rand_distr::{Distribution, Uniform};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use std::f64::consts::TAU;

/// Rated power of the screw's motor, W.
const POWER_W: [f64; 2] = [50.0, 5000.0];
/// Power above which the bus is the mains'.
const MAINS_W: f64 = 400.0;
const POLE_PAIRS: [u32; 3] = [3, 4, 5];

/// Travel of alignment, of the lead: 0.1 mm of 5 mm.
const ALIGNMENT_TURN: f64 = 0.02;

/// Random numbers of a seed.
pub(crate) struct Draw(Xoshiro256PlusPlus);

impl Draw {
    /// Of a seed.
    pub(crate) fn of(seed: u64) -> Self {
        Self(Xoshiro256PlusPlus::seed_from_u64(seed))
    }

    pub(crate) fn between(&mut self, [low, high]: [f64; 2]) -> f64 {
        Uniform::new(low, high).map_or(low, |range| range.sample(&mut self.0))
    }

    /// Evenly by its logarithm.
    pub(crate) fn by_size(&mut self, range: [f64; 2]) -> f64 {
        self.between(range.map(f64::ln)).exp()
    }

    pub(crate) fn one_of<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.between([0.0, of.len() as f64]) as usize % of.len()]
    }
}

/// A motor and what its datasheet says.
pub(crate) struct Drawn {
    pub(crate) model: MotorModel,
    pub(crate) speed_max_rpm: f64,
    pub(crate) rated_nm: f64,
    /// Vector, A.
    pub(crate) rated_a: f64,
}

/// A motor of so much power on a bus of `bus_v`. What is usual: copper takes 2 to 12 % of the rated power, the inductance a
/// tenth to four tenths of the back-EMF, resistance and inductance make 0.7 to 8 ms, the mechanical time constant with the
/// screw 1 to 6 ms. The motors of the paper and of the default board lie in between.
pub(crate) fn motor(draw: &mut Draw, power_w: f64, bus_v: f64, pole_pairs: &[u32]) -> Drawn {
    let speed_max_rpm = draw.one_of(&[3000.0, 4000.0, 5000.0]);
    let pole_pairs = draw.one_of(pole_pairs);
    let speed = speed_max_rpm * TAU / 60.0;
    let rated_nm = power_w / speed;
    // The largest voltage vector is the bus over sqrt(2).
    let emf = draw.between([0.5, 0.65]) * bus_v / 2f64.sqrt();
    let flux_wb = emf / speed / f64::from(pole_pairs);
    let rated_a = rated_nm / (f64::from(pole_pairs) * flux_wb);
    let small = (MAINS_W / power_w).clamp(0.5, 2.0);
    let resistance_ohm = draw.between([0.02, 0.06]) * small * power_w / (rated_a * rated_a);
    let electrical_s =
        draw.between([0.1, 0.4]) * emf / rated_a / (f64::from(pole_pairs) * speed) / resistance_ohm;
    let inductance_h = electrical_s.clamp(0.7e-3, 8e-3) * resistance_ohm;
    let constant = f64::from(pole_pairs) * flux_wb;
    let inertia_kg_m2 = draw.between([1e-3, 6e-3]) * constant * constant / resistance_ohm;
    let harmonic = |draw: &mut Draw, order, most: f64| TorqueHarmonic {
        order,
        amplitude_nm: draw.between([0.0, most]) * rated_nm,
        phase_rad: draw.between([0.0, TAU]),
    };
    Drawn {
        model: MotorModel {
            resistance_ohm,
            inductance_h,
            pole_pairs,
            flux_wb,
            inertia_kg_m2,
            viscous_nm_s: draw.between([0.0, 0.03]) * rated_nm / speed,
            coulomb_nm: draw.between([0.02, 0.05]) * rated_nm,
            torque_harmonics: vec![harmonic(draw, 6.0, 0.03), harmonic(draw, 12.0, 0.01)],
        },
        speed_max_rpm,
        rated_nm,
        rated_a,
    }
}

/// A feed of `lead_m` for these motors, without a load. The table's mass is 1 to 15 % of what they turn, its friction a few percent of
/// the weaker one's rated torque.
pub(crate) fn feed(draw: &mut Draw, lead_m: f64, motors: [&Drawn; 2]) -> FeedModel {
    let [screw, nut] = motors;
    let rated_nm = screw.rated_nm.min(nut.rated_nm);
    let r = lead_m / TAU;
    let inertia = screw.model.inertia_kg_m2.min(nut.model.inertia_kg_m2);
    let table_mass_kg = draw.between([0.01, 0.15]) * inertia / (r * r);
    let hz = draw.between([150.0, 500.0]);
    FeedModel {
        lead_m,
        table_mass_kg,
        axial_stiffness_n_per_m: table_mass_kg * (TAU * hz).powi(2),
        axial_damping_ratio: draw.between([0.02, 0.1]),
        guideway_coulomb_n: draw.between([0.01, 0.04]) * rated_nm / r,
        guideway_viscous_n_s_per_m: draw.between([0.0, 0.03]) * rated_nm / (r * r * 300.0),
        pair_coulomb_nm: draw.between([0.02, 0.05]) * rated_nm,
        presliding_m: 0.0,
        load_n: 0.0,
    }
}

/// A machine of any size with defects, friction, load and noise, whose drive knows what a rough datasheet says:
/// resistance and inductance to a quarter, flux to a tenth, inertia to a factor of 1.8.
#[must_use]
pub fn any_size(seed: u64) -> Start {
    let mut draw = Draw::of(seed);
    let power_w = draw.by_size(POWER_W);
    let bus_v = if power_w < MAINS_W { 48.0 } else { 310.0 };
    let screw = motor(&mut draw, power_w, bus_v, &POLE_PAIRS);
    let part = draw.between([0.5, 1.0]);
    let nut = motor(&mut draw, part * power_w, bus_v, &POLE_PAIRS);
    let rated_nm = screw.rated_nm.min(nut.rated_nm);
    let most_a = screw.rated_a.max(nut.rated_a);

    let lead_m = draw.one_of(&[5e-3, 10e-3, 20e-3]);
    let mut model = Model {
        feed: feed(&mut draw, lead_m, [&screw, &nut]),
        screw: screw.model.clone(),
        nut: nut.model.clone(),
        ..Model::coupled()
    };
    model.feed.load_n = draw.between([-0.8, 0.8]) * held_load_n(&model);
    for place in [Place::Screw, Place::Nut] {
        let mut add = |effect: Option<EffectModel>| model.effects.extend(effect);
        add(EffectModel::new(
            place,
            StribeckFriction {
                amplitude: draw.between([0.0, 0.01]) * rated_nm,
                speed: 0.5,
            },
        ));
        add(EffectModel::new(
            place,
            Cogging {
                order: 36.0,
                amplitude: draw.between([0.0, 0.005]) * rated_nm,
                phase: draw.between([0.0, TAU]),
            },
        ));
        add(EffectModel::new(
            place,
            DeadTime {
                value: draw.between([0.0, 1.3e-3]) * bus_v,
            },
        ));
        add(EffectModel::new(
            place,
            CurrentGain {
                gain_a: draw.between([-0.01, 0.01]),
                gain_b: draw.between([-0.01, 0.01]),
            },
        ));
        add(EffectModel::new(
            place,
            EncoderEccentricity {
                order: 1.0,
                amplitude: draw.between([0.0, 20.0]) / 3600.0 * TAU / 360.0,
                phase: draw.between([0.0, TAU]),
            },
        ));
    }

    let mut start = plain();
    start.model = model;
    start.angles = [draw.between([0.0, TAU]), draw.between([0.0, TAU])];
    let range_a = 2.5 * most_a * (2f64 / 3.0).sqrt();
    let board = &mut start.board;
    *board = BoardConfig {
        bus_v,
        break_a: 0.95 * range_a,
        seed,
        ..*board
    };
    board.sensors.current = Adc::bipolar(12, range_a, draw.between([0.3, 1.0]));
    board.sensors.bus = Adc::unipolar(12, 1.45 * bus_v, 0.5);
    board.sensors.scale_count_m = 10e-9;
    board.sensors.scale_noise_m = 10e-9;
    board.sensors.encoders = incremental(draw.one_of(&[1 << 20, 1 << 17, 10_000]));
    know_roughly(&mut start, &mut draw, [&screw, &nut]);
    charge_legs(&mut start, &mut draw, most_a);
    start
}

/// The turning current of a leg, of the amplitude of the larger motor's rated current: the shipped boards have 0.05 and 0.06.
const TURNING: [f64; 2] = [0.01, 0.1];

/// Gives half of the boards switches with a capacitance, of which the drive knows what a datasheet says: a factor of 1.5.
fn charge_legs(start: &mut Start, draw: &mut Draw, rated_a: f64) {
    let turning_a = draw.by_size(TURNING) * rated_a * (2f64 / 3.0).sqrt();
    let known = draw.by_size([1.0 / 1.5, 1.5]);
    if draw.between([0.0, 1.0]) < 0.5 {
        start.board.leg_f = turning_a * start.board.dead_time_s / (2.0 * start.board.bus_v);
        let fade = &mut start.plate.bridge.dead_time_fade_a;
        *fade = fade.max(2.0 * known * turning_a);
    }
}

/// What the drive is given.
fn know_roughly(start: &mut Start, draw: &mut Draw, drawn: [&Drawn; 2]) {
    let tuning = start.plate.tuning;
    let mut plate = plates(&start.model, Coupling::Coupled, &start.board, tuning);
    for (k, motor) in plate.motors.iter_mut().enumerate() {
        motor.resistance_ohm *= draw.between([0.75, 1.25]);
        motor.inductance_h *= draw.between([0.75, 1.25]);
        motor.flux_wb *= draw.between([0.9, 1.1]);
        motor.inertia_kg_m2 *= draw.by_size([1.0 / 1.8, 1.8]);
        let reversed = draw.between([0.0, 1.0]) < 0.5;
        start.board.wiring.motors[k].encoder_reversed = reversed;
        motor.encoder.reversed = (draw.between([0.0, 1.0]) < 0.5).then_some(reversed);
    }
    size(&mut plate, drawn);
    let [from, to] = REGENERATION.map(|part| part * start.board.bus_v);
    (plate.bridge.brake_fade_from_v, plate.bridge.brake_fade_to_v) = (from, to);
    start.plate = plate;
}

/// The limits that the motors' datasheets have, and accelerations that the torque makes of the inertia that is declared.
pub(crate) fn size(plate: &mut DrivePlate, drawn: [&Drawn; 2]) {
    for (motor, drawn) in plate.motors.iter_mut().zip(drawn) {
        motor.speed_max_rpm = drawn.speed_max_rpm;
        motor.torque_max_nm = 2.0 * drawn.rated_nm;
        motor.thermal.rated_rms_a = drawn.rated_a / 3f64.sqrt();
        motor.alignment_torque_nm = 0.3 * drawn.rated_nm;
    }
    let motors = &plate.motors;
    let least = |of: &dyn Fn(&control::plate::MotorPlate) -> f64| {
        motors.iter().map(of).fold(f64::INFINITY, f64::min)
    };
    let acceleration = 0.25 * least(&|motor| motor.torque_max_nm / motor.inertia_kg_m2);
    let (speed, r) = (least(&|motor| motor.speed_max_rpm), plate.feed.lead_m / TAU);
    plate.bridge.thermal.rated_rms_a = 2.0
        * motors
            .iter()
            .map(|m| m.thermal.rated_rms_a)
            .fold(0.0, f64::max);
    // Several counts of the converters: their noise must not switch the compensation.
    plate.bridge.dead_time_fade_a = (4.0 * plate.board.amps_per_count).max(0.02);
    plate.alignment.speed_rpm = speed / 15.0;
    plate.alignment.travel_m = ALIGNMENT_TURN * plate.feed.lead_m;
    plate.feed.base_acceleration_max = acceleration;
    plate.feed.base_jerk_max = acceleration / 0.035;
    plate.feed.acceleration_max = acceleration * r;
    plate.feed.jerk_max = acceleration * r / 0.025;
}
