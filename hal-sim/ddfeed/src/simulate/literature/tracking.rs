//! A sine of the table at creep speed, by single and double drive, with and without friction fed forward.

use super::creep::setup;
use super::deviation::about_mean;
use anyhow::Result;
use control::plate::{DrivePlate, FrictionPlate, RubbingPlate};
use hal_sim::experiment::{ExperimentError, OperatingPoint, RPM, Setup, driven, settle_quietly};
use hal_sim::parallel::on_all_cores;
use hal_sim::plates::PAPER_TUNING;
use hal_sim::smooth::known::Known;
use serde::Serialize;
use std::f64::consts::TAU;

/// Amplitude, m, and frequency, Hz, of the table's position.
const AMPLITUDE_M: f64 = 50e-6;
const HZ: f64 = 0.2;
/// Periods of the sine: to settle, and recorded.
const SETTLE: f64 = 1.0;
const RECORDED: f64 = 2.0;
/// Nut speeds, rpm.
const NUT_RPM: [f64; 3] = [0.0, 100.0, 300.0];
/// PWM periods between two commands, and between two samples of the error.
const COMMAND_EVERY: u64 = 4;
const SAMPLE_EVERY: u64 = 400;

/// How well drives follow a sine.
#[derive(Debug, Serialize)]
pub struct TrackingReport {
    /// Amplitude of the position, um.
    pub amplitude_um: f64,
    /// Its frequency, Hz.
    pub hz: f64,
    /// Its largest velocity, mm/s.
    pub largest_mm_s: f64,
    /// Cutoff of the speed loops, rad/s.
    pub speed_rad_s: f64,
    /// How many times as accurate, root mean square, known friction makes the fastest double drive.
    pub times: f64,
    /// The drives.
    pub cases: Vec<TrackingCase>,
}

/// One drive.
#[derive(Debug, Serialize)]
pub struct TrackingCase {
    /// Nut speed, rpm; 0 is CDFS.
    pub nut_rpm: f64,
    /// Friction is known and fed forward.
    pub fed_forward: bool,
    /// Error of the position about its mean, um: root mean square.
    pub rms_um: f64,
    /// Largest.
    pub peak_um: f64,
    /// The same by what the integrators give as the friction reverses; none where friction is fed forward.
    pub closed_form_um: Option<f64>,
    /// The error over the recorded periods: (s, um).
    pub error_um: Vec<(f64, f64)>,
}

/// Runs all cases.
pub fn run(seed: u64) -> Result<TrackingReport> {
    let setup = setup(seed, PAPER_TUNING.speed_rad_s);
    let cases: Vec<_> = [false, true]
        .into_iter()
        .flat_map(|fed_forward| NUT_RPM.map(|nut_rpm| (nut_rpm, fed_forward)))
        .collect();
    let cases = on_all_cores(&cases, |&(nut_rpm, fed_forward)| {
        follow(&setup, nut_rpm, fed_forward)
    });
    let cases = cases.into_iter().collect::<Result<Vec<_>, _>>()?;
    let rms = |k: usize| {
        cases
            .get(k)
            .map_or(f64::NAN, |case: &TrackingCase| case.rms_um)
    };
    Ok(TrackingReport {
        amplitude_um: 1e6 * AMPLITUDE_M,
        hz: HZ,
        largest_mm_s: 1e3 * AMPLITUDE_M * TAU * HZ,
        speed_rad_s: setup.tuning.speed_rad_s,
        times: rms(NUT_RPM.len() - 1) / rms(2 * NUT_RPM.len() - 1),
        cases,
    })
}

/// Largest error, m, as friction reverses: each integrator, `J w^2`, gives the torque that turns round at its shaft.
///
/// Pair and guideway turn round at both shafts. The screw's bearing turns round in the single drive alone. The nut's bearing is elastic there,
/// and holds a part.
fn closed_form_m(setup: &Setup, nut_rpm: f64) -> f64 {
    let (plate, r) = (setup.plate(), setup.model.feed.travel_per_radian());
    let integral = plate.motors[0].inertia_kg_m2 * setup.tuning.speed_rad_s.powi(2);
    let FrictionPlate { bearings, feed } = Known::of(&setup.model).friction;
    let fastest = AMPLITUDE_M * TAU * HZ / r;
    let level = |rubbing: &RubbingPlate| {
        let falls = (-(fastest / rubbing.stribeck_rad_s).powi(2)).exp();
        rubbing.coulomb_nm + rubbing.sticks_nm * falls
    };
    let (bearing, feed) = (level(&bearings[0]), level(&feed));
    match nut_rpm == 0.0 {
        true => {
            let elastic = bearings[1].coulomb_nm * r / setup.model.feed.presliding_m;
            r * ((bearing + feed) / integral + feed / (integral + elastic))
        }
        false => r * 2.0 * feed / integral,
    }
}

fn follow(setup: &Setup, nut_rpm: f64, fed_forward: bool) -> Result<TrackingCase, ExperimentError> {
    let friction = match fed_forward {
        true => Known::of(&setup.model).friction,
        false => FrictionPlate::NONE,
    };
    let plate = DrivePlate {
        friction,
        ..setup.plate()
    };
    let mut drive = setup.drive_with(&plate)?;
    let rest = OperatingPoint {
        velocity: 0.0,
        base: nut_rpm * RPM,
    };
    settle_quietly(&mut drive, rest)?;
    let period_s = setup.board.pwm_period_s();
    let start = drive.board.machine.table_position();
    let (settle, end) = (SETTLE / HZ / period_s, (SETTLE + RECORDED) / HZ / period_s);
    let mut error = Vec::new();
    for k in 0..end as u64 {
        let t = k as f64 * period_s;
        if k % COMMAND_EVERY == 0 {
            let velocity = AMPLITUDE_M * TAU * HZ * (TAU * HZ * t).sin();
            drive.command(velocity, rest.base)?;
        }
        drive.period();
        driven(&drive, rest)?;
        if k >= settle as u64 && k % SAMPLE_EVERY == 0 {
            let asked = AMPLITUDE_M * (1.0 - (TAU * HZ * (t + period_s)).cos());
            let off = drive.board.machine.table_position() - start - asked;
            error.push((t - SETTLE / HZ, 1e6 * off));
        }
    }
    let rms_um = about_mean(&mut error);
    Ok(TrackingCase {
        nut_rpm,
        fed_forward,
        rms_um,
        peak_um: error.iter().fold(0.0, |most, (_, off)| off.abs().max(most)),
        closed_form_um: (!fed_forward).then(|| 1e6 * closed_form_m(setup, nut_rpm)),
        error_um: error,
    })
}
