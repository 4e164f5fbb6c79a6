//! The machine that smoothness is measured on: the paper's, with the defects of real drives.

use control::compensation::TORQUES;
use control::plate::{CompensationPlate, TorqueOrderPlate};
use hal_sim::board::BoardConfig;
use hal_sim::boards::BoardKind;
use hal_sim::experiment::Setup;
use hal_sim::plates::PAPER_TUNING;
use hal_sim::sensors::Sensors;
use plant::Axis;
use plant::effects::{
    AnyEffect, Cogging, CurrentGain, CurrentOffset, DeadTime, EffectModel, EncoderEccentricity,
    LeadError, Place,
};
use plant::machine::Coupling;
use plant::model::Model;
use std::f64::consts::{PI, TAU};

/// Which machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Machine {
    /// As the paper has it: all inertia in the motors, no friction.
    Lumped,
    /// With friction, an elastic screw and a table of 503 Hz on it.
    Coupled,
    /// The coupled one with the mains board's motors and sensors, without a load.
    Mains,
    /// The same of the NUCLEO board.
    Nucleo,
}

/// Rated torque of the paper's motors, N m.
const RATED_NM: f64 = 1.3;

/// Errors of the current sensors: offsets A, gains; and of the phase voltage, V: 0.5 us of dead time on 310 V.
const OFFSETS_A: [f64; 2] = [0.010, -0.006];
const GAIN: f64 = 0.01;
const DEAD_V: f64 = 3.1;
/// An encoder's eccentricity, rad.
const ECCENTRICITY: f64 = 20.0 / 3600.0 * PI / 180.0;
/// Wobble of the lead, m per relative turn.
const WOBBLE_M: f64 = 6e-6;
/// Cogging, repetitions a turn.
const SLOTS: f64 = 36.0;

impl Machine {
    /// All.
    pub const ALL: [Self; 4] = [Self::Lumped, Self::Coupled, Self::Mains, Self::Nucleo];

    /// As a report calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Lumped => "lumped",
            Self::Coupled => "coupled",
            Self::Mains => "mains",
            Self::Nucleo => "nucleo",
        }
    }

    /// The board that ships with it.
    #[must_use]
    pub fn board(self) -> Option<BoardKind> {
        match self {
            Self::Lumped | Self::Coupled => None,
            Self::Mains => Some(BoardKind::Mains),
            Self::Nucleo => Some(BoardKind::Nucleo),
        }
    }

    /// Its model, with 1 N m of load at each motor; without one on a board that ships, which has a dead time of its own and
    /// measures the zeros of its current sensors.
    #[must_use]
    pub fn model(self) -> Model {
        let mut model = match self {
            Self::Lumped => Model::paper(),
            Self::Coupled => Model::coupled(),
            Self::Mains | Self::Nucleo => {
                let mut model = Model::coupled();
                model.feed.load_n = 0.0;
                // A board brings the errors of its own encoders.
                model.effects = Self::defects(Vec::new());
                return model;
            }
        };
        model.feed.load_n = TAU / model.feed.lead_m;
        let offset = CurrentOffset {
            off_a: OFFSETS_A[0],
            off_b: OFFSETS_A[1],
        };
        let eccentricity = EncoderEccentricity {
            order: 1.0,
            amplitude: ECCENTRICITY,
            phase: 0.0,
        };
        let dead_time = DeadTime { value: DEAD_V };
        model.effects = Self::defects(vec![eccentricity.into(), offset.into(), dead_time.into()]);
        model
    }

    /// The defects of all, and `more` of the motors.
    fn defects(more: Vec<AnyEffect>) -> Vec<EffectModel> {
        let motors: [AnyEffect; 2] = [
            CurrentGain {
                gain_a: GAIN,
                gain_b: 0.0,
            }
            .into(),
            Cogging {
                order: SLOTS,
                amplitude: 0.003 * RATED_NM,
                phase: 0.0,
            }
            .into(),
        ];
        let lead = LeadError {
            order: 1.0,
            amplitude: WOBBLE_M,
            phase: 0.0,
        };
        motors
            .into_iter()
            .chain(more)
            .filter_map(|effect| EffectModel::new(Place::Both, effect))
            .chain(EffectModel::new(Place::Feed, lead))
            .collect()
    }

    /// How screw and nut meet.
    #[must_use]
    pub fn coupling(self) -> Coupling {
        match self {
            Self::Lumped => Coupling::Lumped,
            Self::Coupled | Self::Mains | Self::Nucleo => Coupling::Coupled,
        }
    }
}

/// The machine on a drive with 20-bit encoders, a 12-bit ADC of 5 A with half a count of noise, and a table scale of 20 nm a
/// count with 10 nm of noise; or on a board that ships, with what that has.
#[must_use]
pub fn setup(machine: Machine, seed: u64) -> Setup {
    if let Some(board) = machine.board() {
        let mut setup = Setup::shipped(board, &machine.model(), machine.coupling());
        setup.board.seed = seed;
        return setup;
    }
    let sensors = Sensors {
        scale_count_m: 20e-9,
        scale_noise_m: 10e-9,
        ..Sensors::real()
    };
    let mut model = machine.model();
    model.sensing = sensors.described(model.sensing);
    Setup {
        model,
        coupling: machine.coupling(),
        board: BoardConfig {
            sensors,
            seed,
            ..BoardConfig::default()
        },
        tuning: PAPER_TUNING,
        shipped: None,
        electronics: None,
    }
}

/// Orders of a motor's torque, a mechanical turn: once and twice an electrical turn (offset and gain of current sensors), multiples of
/// six (current and flux harmonics, dead time), its slots.
#[must_use]
pub fn torque_orders(pole_pairs: u32) -> [f64; 7] {
    let p = f64::from(pole_pairs);
    [p, 2.0 * p, 6.0 * p, 12.0 * p, 18.0 * p, 24.0 * p, SLOTS]
}

/// The orders of such a machine, of which nothing is known yet: those of [`torque_orders`], and with a scale the usual ones of
/// encoders and lead.
#[must_use]
pub fn orders(setup: &Setup, learning_s: f64, scale: bool) -> CompensationPlate {
    let pole_pairs = [setup.model.screw.pole_pairs, setup.model.nut.pole_pairs];
    let torque = |pole_pairs: u32| {
        let mut plates = [TorqueOrderPlate::NONE; TORQUES];
        for (plate, order) in plates.iter_mut().zip(torque_orders(pole_pairs)) {
            *plate = TorqueOrderPlate::unknown(order);
        }
        plates
    };
    let count_m = if scale {
        setup.board.sensors.scale_count_m
    } else {
        0.0
    };
    CompensationPlate {
        torque: pole_pairs.map(torque),
        ..CompensationPlate::usual(pole_pairs, learning_s, count_m)
    }
}

/// The coupled machine with nothing that ripples.
pub(super) fn still(seed: u64) -> Setup {
    let mut setup = setup(Machine::Coupled, seed);
    without_ripple(&mut setup.model);
    setup
}

/// Takes away what ripples.
pub(super) fn without_ripple(model: &mut Model) {
    model.effects.clear();
    for axis in Axis::ALL {
        model.motor_mut(axis).torque_harmonics.clear();
    }
}
