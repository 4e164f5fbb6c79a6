//! The screw's first torsional mode: how torque turns the screw, and what the mode makes of the table's ripple.

use super::shaft::{FreeEnd, Shaft, Twisting};
use anyhow::Result;
use control::plate::DrivePlate;
use hal_sim::experiment::{
    ExperimentError, OperatingPoint, RECORD_S, RPM, Setup, driven, record_periods, settle_through,
    table_velocities_through,
};
use hal_sim::parallel::on_all_cores;
use hal_sim::response::{measure, measure_beside};
use hal_sim::seam::{Seam, Straight};
use hal_sim::vrf::vrf_percent;
use plant::machine::Coupling;
use plant::model::Model;
use serde::Serialize;
use std::f64::consts::TAU;

/// The screw beyond the nut: of the size of common feed axes.
const SHAFT: Shaft = Shaft {
    diameter_m: 0.02,
    length_m: 1.0,
    damping_ratio: 0.01,
};
/// Table velocity, m/s, and nut speeds, rpm, of the ripple.
const VELOCITY: f64 = 2.5e-3;
const NUT_RPM: [f64; 4] = [0.0, 300.0, 500.0, 800.0];
/// The order of the screw's torque that a last nut speed brings to the mode.
const ORDER: f64 = 12.0;
/// Speed at which the response is measured, rpm: no friction holds the shaft then.
const TURNS_RPM: f64 = 100.0;
/// Frequencies of the response, of the mode's: the first, the step, how many.
const FIRST: f64 = 0.6;
const STEP: f64 = 0.01;
const FREQUENCIES: u32 = 81;

/// Torsion of the screw.
#[derive(Debug, Serialize)]
pub struct TorsionReport {
    /// Diameter and free length of the screw, mm.
    pub shaft_mm: [f64; 2],
    /// Damping of the mode, relative to critical.
    pub damping_ratio: f64,
    /// Frequency at which the screw hardly moves, Hz: in the simulated response, and by `sqrt(G / rho) / (4 L)`.
    pub held_hz: [f64; 2],
    /// Frequency at which it moves most, Hz: the same, and that times `sqrt(1 + J / Jm)`.
    pub free_hz: [f64; 2],
    /// Speed of the screw for a torque, electrical rad/s per N m, without the mode: (Hz, gain).
    pub rigid: Vec<(f64, f64)>,
    /// With it.
    pub twisting: Vec<(f64, f64)>,
    /// Ripple of the table. At the last nut speed an order of the screw's torque meets the mode.
    pub ripples: Vec<TorsionRipple>,
}

/// Ripple at one nut speed.
#[derive(Debug, Serialize)]
pub struct TorsionRipple {
    /// Nut speed, rpm; 0 is CDFS.
    pub nut_rpm: f64,
    /// Ripple without the mode, and with it, %.
    pub vrf_percent: [f64; 2],
}

/// The machine, whose motor keeps the inertia that it and the mode have together.
fn setup(seed: u64) -> (Setup, Setup) {
    let of = |model| {
        let mut setup = Setup::ideal(model, Coupling::Coupled);
        setup.board.seed = seed;
        setup
    };
    let mut twisting = of(Model::coupled());
    twisting.model.screw.inertia_kg_m2 -= SHAFT.mode_inertia();
    (of(Model::coupled()), twisting)
}

/// Measures responses and ripples.
pub fn run(seed: u64) -> Result<TorsionReport> {
    let (rigid, twisting) = setup(seed);
    let hz: Vec<f64> = (0..FREQUENCIES)
        .map(|k| SHAFT.held_hz() * (FIRST + STEP * f64::from(k)))
        .collect();
    let plain = on_all_cores(&hz, |&hz| -> Result<_, ExperimentError> {
        Ok((hz, measure(&rigid, TURNS_RPM * RPM, TAU * hz)?.norm()))
    });
    let twisted = on_all_cores(&hz, |&hz| -> Result<_, ExperimentError> {
        let mut end = FreeEnd::new(&SHAFT);
        let beside = |machine: &_, dt| end.step(machine, dt);
        let gain = measure_beside(&twisting, TURNS_RPM * RPM, TAU * hz, beside)?;
        Ok((hz, gain.norm()))
    });
    let plate = rigid.plate();
    let mut speeds = NUT_RPM.to_vec();
    speeds.push(meeting_rpm(&twisting));
    let ripples = on_all_cores(&speeds, |&nut_rpm| -> Result<_, ExperimentError> {
        let mut seam = Twisting {
            end: FreeEnd::new(&SHAFT),
            half_s: 0.5 * twisting.board.pwm_period_s(),
        };
        Ok(TorsionRipple {
            nut_rpm,
            vrf_percent: [
                ripple(&rigid, &plate, nut_rpm, &mut Straight)?,
                ripple(&twisting, &plate, nut_rpm, &mut seam)?,
            ],
        })
    });
    let twisted: Vec<(f64, f64)> = twisted.into_iter().collect::<Result<_, _>>()?;
    let at = |found: Option<&(f64, f64)>| found.map_or(f64::NAN, |point| point.0);
    let lowest = at(twisted.iter().min_by(|a, b| a.1.total_cmp(&b.1)));
    let highest = at(twisted.iter().max_by(|a, b| a.1.total_cmp(&b.1)));
    let root = twisting.model.screw.inertia_kg_m2;
    Ok(TorsionReport {
        shaft_mm: [1e3 * SHAFT.diameter_m, 1e3 * SHAFT.length_m],
        damping_ratio: SHAFT.damping_ratio,
        held_hz: [lowest, SHAFT.held_hz()],
        free_hz: [highest, SHAFT.free_hz(root)],
        rigid: plain.into_iter().collect::<Result<_, _>>()?,
        twisting: twisted,
        ripples: ripples.into_iter().collect::<Result<_, _>>()?,
    })
}

/// Nut speed, rpm, at which [`ORDER`] of the screw's torque is at the mode with the motor free.
fn meeting_rpm(setup: &Setup) -> f64 {
    let screw = &setup.model.screw;
    let turns_s = SHAFT.free_hz(screw.inertia_kg_m2) / (ORDER * f64::from(screw.pole_pairs));
    (60.0 * turns_s - VELOCITY / setup.model.feed.travel_per_radian() / RPM).round()
}

fn ripple(
    setup: &Setup,
    plate: &DrivePlate,
    nut_rpm: f64,
    seam: &mut impl Seam,
) -> Result<f64, ExperimentError> {
    let at = OperatingPoint {
        velocity: VELOCITY,
        base: nut_rpm * RPM,
    };
    let mut drive = setup.drive_with(plate)?;
    settle_through(&mut drive, at, seam, |_| Ok::<(), ExperimentError>(()))?;
    let periods = record_periods(&setup.board);
    let velocities = table_velocities_through(&mut drive, RECORD_S, periods, seam, |drive| {
        driven(drive, at)
    })?;
    Ok(vrf_percent(&velocities, VELOCITY))
}
