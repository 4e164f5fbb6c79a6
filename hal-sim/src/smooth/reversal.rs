//! A table that reverses through friction that sticks.

use super::{Machine, drive, setup, velocities};
use crate::drive::Drive;
use crate::experiment::{ExperimentError, RPM, Setup};
use crate::seam::Straight;
use control::plate::{CompensationPlate, FrictionPlate};
use plant::Axis;
use plant::effects::{EffectModel, Place, StribeckFriction};
use std::f64::consts::TAU;

/// Amplitude, m/s, and frequency, Hz, of the table's velocity.
const AMPLITUDE: f64 = 1e-3;
const HZ: f64 = 0.5;
/// Friction of each bearing that slides, and what it takes more to break it away, N m.
const BEARING_NM: [f64; 2] = [0.05, 0.03];
/// Friction of ball pair and guideway, N m.
const FEED_NM: f64 = 0.10;
/// Speed at which what sticks has fallen to 1/e, rad/s: our choice.
const STICKS_RAD_S: f64 = 0.5;
/// Band of the feed-forward's sign, rad/s.
const BAND_RAD_S: f64 = 0.02;

/// The coupled machine with friction that sticks, and nothing that ripples. The plant has Coulomb friction with sticking, and
/// Stribeck's curve for bearings and guideway; the elastic displacement before it breaks away, which LuGre has, it lacks. A
/// guideway that sticks so and breaks away at once rings the axial mode by `F / (m omega)`, more than this velocity; so ball
/// pair and guideway slide here, and act in the pair.
fn sticking(seed: u64) -> Setup {
    let mut setup = setup(Machine::Coupled, seed);
    let model = &mut setup.model;
    model.effects.clear();
    for axis in Axis::ALL {
        let motor = model.motor_mut(axis);
        motor.torque_harmonics.clear();
        motor.coulomb_nm = BEARING_NM[0];
    }
    model.feed.pair_coulomb_nm = FEED_NM;
    model.feed.guideway_coulomb_n = 0.0;
    let sticks = StribeckFriction {
        amplitude: BEARING_NM[1],
        speed: STICKS_RAD_S,
    };
    model.effects = EffectModel::new(Place::Both, sticks).into_iter().collect();
    setup
}

/// Largest error of the table's velocity over its amplitude, %, with the PI alone and with friction fed forward, at a nut speed
/// in rpm.
///
/// # Errors
/// [`ExperimentError`] if the drive cannot be configured.
pub fn reversal(nut_rpm: f64) -> Result<[f64; 2], ExperimentError> {
    let setup = sticking(1);
    let pi = drive(&setup, CompensationPlate::NONE)?;
    let mut plate = setup.plate();
    plate.friction = FrictionPlate {
        bearings_nm: [BEARING_NM[0]; 2],
        feed_nm: FEED_NM,
        band_rad_s: BAND_RAD_S,
    };
    let ours = Drive::aligned(&setup.model, setup.coupling, setup.board, &plate)?;
    let travel = setup.model.feed.travel_per_radian();
    Ok([worst(pi, nut_rpm, travel)?, worst(ours, nut_rpm, travel)?])
}

/// The largest error in two of four periods.
fn worst(mut drive: Drive, nut_rpm: f64, travel: f64) -> Result<f64, ExperimentError> {
    let base = nut_rpm * RPM;
    drive.command(0.0, base)?;
    velocities(&mut drive, 1.0, &mut Straight)?;
    let period_s = drive.board.config().pwm_period_s();
    let periods = (4.0 / HZ / period_s) as u64;
    let mut worst: f64 = 0.0;
    for k in 0..periods {
        let t = k as f64 * period_s;
        if k % 4 == 0 {
            drive.command(AMPLITUDE * (TAU * HZ * t).sin(), base)?;
        }
        drive.period();
        let [screw, nut] = drive.speed().speed;
        let pole_pairs = f64::from(drive.pole_pairs(Axis::Screw));
        let relative = (screw.omega_e - nut.omega_e).to_num::<f64>() / pole_pairs;
        let asked = relative * travel;
        if 2 * k > periods {
            worst = worst.max((drive.board.machine.table_velocity() - asked).abs());
        }
    }
    Ok(100.0 * worst / AMPLITUDE)
}
