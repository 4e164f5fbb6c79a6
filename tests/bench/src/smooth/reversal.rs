//! A table that reverses through friction that sticks.

use super::lugre::{LuGre, PRESLIDING_M, STRIBECK_M_S};
use super::machine::still;
use super::rejection::Rejection;
use super::{drive, still_runs};
use control::plate::{CompensationPlate, FrictionPlate, RejectionPlate, RubbingPlate};
use hal_sim::drive::Drive;
use hal_sim::experiment::{ExperimentError, OperatingPoint, RPM, Setup};
use plant::Axis;
use std::f64::consts::TAU;

/// Amplitude, m/s, and frequency, Hz, of the table's velocity.
const AMPLITUDE: f64 = 1e-3;
const HZ: f64 = 0.5;
/// Friction of each bearing, and of ball pair and guideway: sliding and breaking away, N m.
const BEARING_NM: [f64; 2] = [0.05, 0.08];
const FEED_NM: [f64; 2] = [0.10, 0.16];

/// The coupled machine with nothing that ripples; its friction is [`LuGre`]'s.
fn sticking(seed: u64) -> Setup {
    let mut setup = still(seed);
    let model = &mut setup.model;
    for axis in Axis::ALL {
        model.motor_mut(axis).coulomb_nm = 0.0;
    }
    model.feed.pair_coulomb_nm = 0.0;
    model.feed.guideway_coulomb_n = 0.0;
    setup
}

/// Largest error of the table's velocity over its amplitude, %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reversal {
    /// With the PI alone.
    pub pi: f64,
    /// With friction fed forward that is known.
    pub known: f64,
    /// With 30 % less of it, and with 30 % more.
    pub off: [f64; 2],
    /// With a disturbance observer and a notch at the axial mode, and no friction known, 30 % less, all, and 30 % more of it.
    pub observed: [f64; 4],
}

/// At a nut speed in rpm.
///
/// # Errors
/// [`ExperimentError`] if the drive cannot be configured.
pub fn reversal(nut_rpm: f64) -> Result<Reversal, ExperimentError> {
    let setup = sticking(1);
    let travel = setup.model.feed.travel_per_radian();
    let observer = Rejection::Both.plate();
    let run = |part: f64, rejection: RejectionPlate| {
        let known = |[coulomb_nm, static_nm]: [f64; 2]| RubbingPlate {
            coulomb_nm: part * coulomb_nm,
            sticks_nm: part * (static_nm - coulomb_nm),
            stribeck_rad_s: STRIBECK_M_S / travel,
            presliding_rad: PRESLIDING_M / travel * static_nm / coulomb_nm,
        };
        let mut plate = setup.plate();
        plate.friction = FrictionPlate {
            bearings: [known(BEARING_NM); 2],
            feed: known(FEED_NM),
        };
        plate.rejection = rejection;
        let drive = Drive::aligned(&setup.model, setup.coupling, setup.board, &plate)?;
        worst(drive, &setup, nut_rpm)
    };
    Ok(Reversal {
        pi: worst(drive(&setup, CompensationPlate::NONE)?, &setup, nut_rpm)?,
        known: run(1.0, RejectionPlate::NONE)?,
        off: [
            run(0.7, RejectionPlate::NONE)?,
            run(1.3, RejectionPlate::NONE)?,
        ],
        observed: [
            run(0.0, observer)?,
            run(0.7, observer)?,
            run(1.0, observer)?,
            run(1.3, observer)?,
        ],
    })
}

/// The largest error in two of four periods.
fn worst(mut drive: Drive, setup: &Setup, nut_rpm: f64) -> Result<f64, ExperimentError> {
    let travel = setup.model.feed.travel_per_radian();
    let base = nut_rpm * RPM;
    let period_s = drive.board.config().pwm_period_s();
    let mut friction = LuGre::new(BEARING_NM, FEED_NM, &setup.model, period_s);
    drive.command(0.0, base)?;
    for _ in 0..(1.0 / period_s) as u64 {
        drive.period_through(&mut friction);
    }
    let periods = (4.0 / HZ / period_s) as u64;
    let mut worst: f64 = 0.0;
    for k in 0..periods {
        let t = k as f64 * period_s;
        if k % 4 == 0 {
            drive.command(AMPLITUDE * (TAU * HZ * t).sin(), base)?;
        }
        drive.period_through(&mut friction);
        let [screw, nut] = drive.speed().speed;
        let pole_pairs = f64::from(drive.pole_pairs(Axis::Screw));
        let relative = (screw.omega_e - nut.omega_e).to_num::<f64>() / pole_pairs;
        let asked = relative * travel;
        if 2 * k > periods {
            worst = worst.max((drive.board.machine.table_velocity() - asked).abs());
        }
    }
    let point = OperatingPoint {
        velocity: AMPLITUDE,
        base,
    };
    still_runs(&drive, point, 4.0 / HZ)?;
    Ok(100.0 * worst / AMPLITUDE)
}
