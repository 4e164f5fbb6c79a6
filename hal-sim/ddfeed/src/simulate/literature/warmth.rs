//! Losses of motors and friction against the common speed, and which common speed they let be proposed.

use crate::simulate::losses::{LossMeter, Losses};
use crate::simulate::proposal::{Choice, proposed};
use crate::simulate::setup::knowing_plate;
use anyhow::Result;
use control::plate::DrivePlate;
use hal_sim::drive::Drive;
use hal_sim::experiment::{
    ExperimentError, OperatingPoint, RPM, Setup, driven, record_periods, settle_quietly,
    table_velocities,
};
use hal_sim::parallel::on_all_cores;
use hal_sim::vrf::vrf_percent;
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;
use serde::Serialize;

/// Table velocity, m/s.
const VELOCITY: f64 = 2.5e-3;
/// Fastest common speed, rpm, and how many are measured.
const FASTEST_RPM: f64 = 1200.0;
const SPEEDS: u32 = 13;
/// Length of a record, s.
const SECONDS: f64 = 2.0;
/// A phase of a motor that stands may take twice its share of the heat.
const STANDS: f64 = 2.0;

/// Losses against the common speed.
#[derive(Debug, Serialize)]
pub struct WarmthReport {
    /// Table velocity, mm/s.
    pub table_mm_s: f64,
    /// Load, N.
    pub load_n: f64,
    /// The common speeds.
    pub points: Vec<WarmthPoint>,
    /// What is proposed to the drive without compensation.
    pub proposed: Option<Choice>,
    /// What is proposed to the drive that compensates the model's orders.
    pub compensated: Option<Choice>,
}

/// One common speed.
#[derive(Debug, Serialize)]
pub struct WarmthPoint {
    /// Nut speed, rpm; 0 is CDFS.
    pub nut_rpm: f64,
    /// Ripple, peak to peak, %.
    pub vrf_percent: f64,
    /// The same of a drive that compensates the orders and the friction of the model, %.
    pub compensated_percent: f64,
    /// Copper loss of screw and nut, W.
    pub copper_w: [f64; 2],
    /// Friction of bearings, pair and guideway, W.
    pub friction_w: f64,
    /// The same by torque times speed of the model's friction, W.
    pub friction_closed_form_w: f64,
    /// Heat of the windings, of what the setting `rated_current_a_rms` lets them bear for long, %. A winding's steady temperature rise is
    /// this part of its rated rise.
    pub winding_percent: [f64; 2],
}

/// Measures them.
pub fn run(seed: u64) -> Result<WarmthReport> {
    let mut setup = Setup::real(Model::coupled(), Coupling::Coupled);
    setup.board.seed = seed;
    let last = f64::from(SPEEDS - 1);
    let speeds: Vec<f64> = (0..SPEEDS)
        .map(|k| FASTEST_RPM * f64::from(k) / last)
        .collect();
    let points = on_all_cores(&speeds, |&nut_rpm| point(&setup, nut_rpm));
    let points = points
        .into_iter()
        .collect::<Result<Vec<WarmthPoint>, ExperimentError>>()?;
    let propose = |ripple: fn(&WarmthPoint) -> f64| {
        proposed(points.iter().map(|point| Choice {
            nut_rpm: point.nut_rpm,
            vrf_percent: ripple(point),
            loss_w: Some(point.total_w()),
        }))
    };
    Ok(WarmthReport {
        table_mm_s: 1e3 * VELOCITY,
        load_n: setup.model.feed.load_n,
        proposed: propose(|point| point.vrf_percent),
        compensated: propose(|point| point.compensated_percent),
        points,
    })
}

impl WarmthPoint {
    /// All losses, W.
    pub fn total_w(&self) -> f64 {
        Losses {
            copper_w: self.copper_w,
            friction_w: self.friction_w,
        }
        .total_w()
    }
}

fn point(setup: &Setup, nut_rpm: f64) -> Result<WarmthPoint, ExperimentError> {
    let at = OperatingPoint {
        velocity: VELOCITY,
        base: nut_rpm * RPM,
    };
    let mut meter = LossMeter::new(setup);
    let plate = setup.plate();
    let velocities = recorded(setup, &plate, at, |drive| meter.take(drive))?;
    let compensated = recorded(setup, &knowing_plate(setup), at, |_| ())?;
    let losses = meter.losses().unwrap_or_default();
    let winding_percent = Axis::ALL.map(|axis| {
        let k = axis.index();
        let rated = plate.motors[k].thermal.rated_rms_a;
        let bears = 3.0 * setup.model.motor(axis).resistance_ohm * rated * rated;
        let stands = axis == Axis::Nut && nut_rpm == 0.0;
        100.0 * losses.copper_w[k] * if stands { STANDS } else { 1.0 } / bears
    });
    Ok(WarmthPoint {
        nut_rpm,
        vrf_percent: vrf_percent(&velocities, VELOCITY),
        compensated_percent: vrf_percent(&compensated, VELOCITY),
        copper_w: losses.copper_w,
        friction_w: losses.friction_w,
        friction_closed_form_w: friction_w(&setup.model, at),
        winding_percent,
    })
}

/// True table velocities of a drive with this plate, m/s; `each` sees it after each PWM period.
fn recorded(
    setup: &Setup,
    plate: &DrivePlate,
    at: OperatingPoint,
    mut each: impl FnMut(&Drive),
) -> Result<Vec<f64>, ExperimentError> {
    let mut drive = setup.drive_with(plate)?;
    settle_quietly(&mut drive, at)?;
    let periods = record_periods(&setup.board);
    table_velocities(&mut drive, SECONDS, periods, |drive| {
        each(drive);
        driven(drive, at)
    })
}

/// Torque times speed of all friction of a model.
fn friction_w(model: &Model, at: OperatingPoint) -> f64 {
    let feed = &model.feed;
    let relative = (at.velocity / feed.travel_per_radian()).abs();
    let speeds = [at.base + relative, at.base];
    let bearings = Axis::ALL.map(|axis| {
        let (motor, speed) = (model.motor(axis), speeds[axis.index()].abs());
        (motor.coulomb_nm + motor.viscous_nm_s * speed) * speed
    });
    let velocity = at.velocity.abs();
    let guideway =
        (feed.guideway_coulomb_n + feed.guideway_viscous_n_s_per_m * velocity) * velocity;
    bearings.iter().sum::<f64>() + feed.pair_coulomb_nm * relative + guideway
}
