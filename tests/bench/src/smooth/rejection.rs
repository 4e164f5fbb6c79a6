//! A step of load, and a base speed that wanders over a resonance, on the machine with an elastic screw.

use super::machine::still;
use super::{Machine, Smoothness, orders, sample_s, settle, setup, still_runs, velocities};
use crate::smooth::bench::LEARNING_S;
use control::plate::{CompensationPlate, RejectionPlate};
use hal_sim::drive::Drive;
use hal_sim::experiment::{ExperimentError, OperatingPoint, RPM};
use hal_sim::plates::PAPER_TUNING;
use hal_sim::seam::Disturbed;
use plant::Axis;
use plant::machine::Machine as Plant;
use std::f64::consts::TAU;

/// What keeps a disturbance from the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rejection {
    /// The PI alone.
    Pi,
    /// A notch at the axial mode.
    Notch,
    /// A disturbance observer of a quarter of the speed loop's cutoff.
    Observer,
    /// Both.
    Both,
}

impl Rejection {
    /// All.
    pub const ALL: [Self; 4] = [Self::Pi, Self::Notch, Self::Observer, Self::Both];

    /// As a report calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pi => "PI",
            Self::Notch => "PI and notch",
            Self::Observer => "PI and observer",
            Self::Both => "PI, observer and notch",
        }
    }

    /// Its plate: the notch at what the coupled model says of the axial mode.
    #[must_use]
    pub fn plate(self) -> RejectionPlate {
        let feed = setup(Machine::Coupled, 1).model.feed;
        let hz = (feed.axial_stiffness_n_per_m / feed.table_mass_kg).sqrt() / TAU;
        let notch = matches!(self, Self::Notch | Self::Both);
        let observer = matches!(self, Self::Observer | Self::Both);
        let speed_rad_s = if observer {
            PAPER_TUNING.speed_rad_s
        } else {
            0.0
        };
        RejectionPlate::of_mode(if notch { hz } else { 0.0 }, speed_rad_s)
    }
}

/// The load's step, N: a quarter of what the motors' rated torque holds.
const STEP_N: f64 = 0.25 * 1.3 * TAU / 5e-3;

/// After the step, s: from where a mode that is damped by 0.05 has fallen to an eighth of what the step itself makes of it.
const RINGS_S: [f64; 2] = [0.013, 0.1];

/// What a step of load does to a table that moves by 2.5 mm/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadStep {
    /// Largest error of its velocity, mm/s.
    pub velocity_mm_s: f64,
    /// How far it is pushed at most, um.
    pub pushed_um: f64,
    /// How far it still is half a second later, um.
    pub left_um: f64,
    /// How fast the screw is stretched in the time of [`RINGS_S`], mm/s rms: the axial mode.
    pub ringing_mm_s: f64,
}

/// Of the coupled machine at a nut speed in rpm.
///
/// # Errors
/// [`ExperimentError`] if the drive cannot be configured or is stopped by a fault.
pub fn load_step(rejection: Rejection, nut_rpm: f64) -> Result<LoadStep, ExperimentError> {
    let setup = still(1);
    let mut plate = setup.plate();
    plate.rejection = rejection.plate();
    let mut drive = Drive::aligned(&setup.model, setup.coupling, setup.board, &plate)?;
    let point = point(nut_rpm);
    let load = setup.model.feed.load_n;
    let travel = setup.model.feed.travel_per_radian();
    let mut stretching = Vec::new();
    let mut stepped = Disturbed(|machine: &mut Plant, _| {
        machine.set_load_force(load + STEP_N);
        let [screw, nut] = Axis::ALL.map(|axis| machine.motor(axis).omega);
        stretching.push(machine.table_velocity() - travel * (screw - nut));
    });
    settle(&mut drive, point, &mut hal_sim::seam::Straight)?;
    let seconds = 0.5;
    let velocities = velocities(&mut drive, seconds, &mut stepped)?;
    still_runs(&drive, point, seconds)?;
    let sample_s = sample_s(&drive);
    let errors: Vec<f64> = velocities.iter().map(|v| v - point.velocity).collect();
    let mut pushed = 0.0;
    let places: Vec<f64> = errors
        .iter()
        .map(|error| {
            pushed += error * sample_s;
            pushed
        })
        .collect();
    let most = |values: &[f64]| values.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let half_s = drive.board.config().pwm_period_s() / 2.0;
    let [from, to] = RINGS_S.map(|seconds| (seconds / half_s) as usize);
    let squares: f64 = stretching[from..to].iter().map(|v| v * v).sum();
    Ok(LoadStep {
        velocity_mm_s: 1e3 * most(&errors),
        pushed_um: 1e6 * most(&places),
        left_um: 1e6 * places.last().copied().unwrap_or_default(),
        ringing_mm_s: 1e3 * (squares / (to - from) as f64).sqrt(),
    })
}

/// The coupled machine with all its defects at a nut speed in rpm that wanders by `wander_rpm` in 4 s, the time that the ripple is
/// measured over.
///
/// # Errors
/// [`ExperimentError`] if the drive cannot be configured or is stopped by a fault.
pub fn wandering(
    nut_rpm: f64,
    wander_rpm: f64,
    compensated: bool,
) -> Result<Smoothness, ExperimentError> {
    let setup = setup(Machine::Coupled, 1);
    let mut plate = setup.plate();
    plate.base.wander_rad_s = wander_rpm * RPM;
    plate.base.wander_s = 4.0;
    let (compensation, seconds) = if compensated {
        (orders(&setup, LEARNING_S, true), super::bench::COLD_S)
    } else {
        (CompensationPlate::NONE, 0.0)
    };
    plate.compensation = compensation;
    let mut drive = Drive::aligned(&setup.model, setup.coupling, setup.board, &plate)?;
    super::smoothness(&mut drive, point(nut_rpm), seconds)
}

fn point(nut_rpm: f64) -> OperatingPoint {
    OperatingPoint {
        velocity: 2.5e-3,
        base: nut_rpm * RPM,
    }
}
