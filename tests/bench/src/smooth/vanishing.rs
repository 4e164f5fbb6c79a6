//! A load that vanishes while the table creeps. Harmonics that scale with the current go with it; cogging stays.

use super::{Machine, orders, settle, setup, still_runs, velocities};
use crate::smooth::bench::{COLD_S, LEARNING_S};
use control::plate::CompensationPlate;
use hal_sim::experiment::{ExperimentError, OperatingPoint, RPM, Setup};
use hal_sim::seam::{Disturbed, Straight};
use hal_sim::smooth::known::Known;
use hal_sim::vrf::vrf_percent;
use plant::effects::{AnyEffect, EffectModel, FluxHarmonic, Place};
use plant::machine::Machine as Plant;
use std::f64::consts::TAU;

/// Table velocity, m/s.
const VELOCITY: f64 = 2.5e-3;
/// Amplitude of the flux's sixth harmonic, of the flux: a torque of 10 mN m under 1 N m.
const FLUX: f64 = 0.01;
/// Time in which the load falls, s, and after which the fall's own error of the table's speed has settled.
const FALLS_S: f64 = 0.2;
const SETTLES_S: f64 = 0.1;
/// The first look, and the time before the second, s.
const FIRST_S: f64 = 0.4;
const LATER_S: f64 = 4.0;

/// What the drive knows before the load vanishes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Experience {
    /// It has learned under the load alone.
    OneLoad,
    /// It has learned without a load before, and under it again.
    TwoLoads,
    /// The model's effects: which of the harmonics scale with the current. It learns on.
    Identified,
}

impl Experience {
    /// All.
    pub const ALL: [Self; 3] = [Self::OneLoad, Self::TwoLoads, Self::Identified];

    /// As a report calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::OneLoad => "learned under the load",
            Self::TwoLoads => "learned with and without it",
            Self::Identified => "identified",
        }
    }
}

/// Ripple of the table (Eq 19), %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vanished {
    /// Under the load.
    pub loaded: f64,
    /// In the first 0.4 s without it.
    pub first: f64,
    /// After 4 s without it.
    pub later: f64,
}

/// A machine whose table creeps at a nut speed in rpm, under 1 N m at each motor, which then vanishes.
///
/// # Errors
/// [`ExperimentError`] if the drive cannot be configured or is stopped by a fault.
pub fn vanishing(
    machine: Machine,
    experience: Experience,
    nut_rpm: f64,
) -> Result<Vanished, ExperimentError> {
    let setup = loaded(machine);
    let point = OperatingPoint {
        velocity: VELOCITY,
        base: nut_rpm * RPM,
    };
    let load = setup.model.feed.load_n;
    let empty = orders(&setup, LEARNING_S, true);
    let compensation = match experience {
        Experience::Identified => CompensationPlate {
            learning_s: empty.learning_s,
            scale_count_m: empty.scale_count_m,
            ..Known::of(&setup.model).compensation
        },
        Experience::OneLoad | Experience::TwoLoads => empty,
    };
    let mut drive = super::drive(&setup, compensation)?;
    settle(&mut drive, point, &mut Straight)?;
    let half_s = drive.board.config().pwm_period_s() / 2.0;
    let mut ripple = |seconds: f64, [from, to]: [f64; 2]| {
        let mut passed = 0.0;
        let mut changing = Disturbed(|machine: &mut Plant, _| {
            passed += half_s;
            let part = (passed / FALLS_S).min(1.0);
            machine.set_load_force(from + part * (to - from));
        });
        let velocities = velocities(&mut drive, seconds, &mut changing)?;
        still_runs(&drive, point, seconds)?;
        Ok::<_, ExperimentError>(vrf_percent(&velocities, VELOCITY))
    };
    ripple(COLD_S, [load, load])?;
    if experience == Experience::TwoLoads {
        ripple(COLD_S, [load, 0.0])?;
        ripple(COLD_S, [0.0, load])?;
    }
    let loaded = ripple(LATER_S, [load, load])?;
    ripple(FALLS_S + SETTLES_S, [load, 0.0])?;
    let first = ripple(FIRST_S, [0.0; 2])?;
    ripple(LATER_S - FIRST_S, [0.0; 2])?;
    let later = ripple(LATER_S, [0.0; 2])?;
    Ok(Vanished {
        loaded,
        first,
        later,
    })
}

/// A machine under 1 N m at each motor, whose flux has a sixth harmonic in both. The paper's drive compensates no dead time, so its bridges
/// have none here.
fn loaded(machine: Machine) -> Setup {
    let mut setup = setup(machine, 1);
    let flux = FluxHarmonic {
        order: 6.0,
        amplitude: FLUX,
        phase: 0.5,
    };
    let is_dead_time = |effect: &EffectModel| matches!(effect.effect(), AnyEffect::DeadTime(_));
    let model = &mut setup.model;
    model.effects.retain(|effect| !is_dead_time(effect));
    model.effects.extend(EffectModel::new(Place::Both, flux));
    model.feed.load_n = TAU / model.feed.lead_m;
    setup
}
