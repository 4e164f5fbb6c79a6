//! A load that switches on and off at the nut, with and without cross-coupling of both motors.
//!
//! The drive's speed loops know nothing of each other. The coupling here is another controller beside them: a PI of the speed error of
//! screw against nut, of `share` of the speed loop's own gains, that pushes both motors in opposite directions.

use super::deviation::about_mean;
use super::drive_name::drive_name;
use anyhow::Result;
use control::plate::Gains;
use hal_sim::experiment::{
    ExperimentError, OperatingPoint, RPM, Setup, driven, settle_quietly, settle_through,
};
use hal_sim::parallel::on_all_cores;
use hal_sim::seam::{Seam, SpeedSeen};
use plant::Axis;
use plant::machine::{Coupling, Machine};
use plant::model::Model;
use serde::Serialize;

/// Table velocity, m/s, and nut speed, rpm, of the double drive.
const VELOCITY: f64 = 2.5e-3;
const NUT_RPM: f64 = 300.0;
/// The load, N m, and how long it is on and off, s.
const LOAD_NM: f64 = 0.3;
const SWITCHES_S: f64 = 0.25;
/// Length of the record, s: three times on and off.
const RECORD_S: f64 = 6.0 * SWITCHES_S;
/// Gains of the coupling, of those of the speed loops.
const SHARE: f64 = 0.5;
/// PWM periods between two samples of the error.
const SAMPLE_EVERY: u32 = 20;

/// A load that switches.
#[derive(Debug, Serialize)]
pub struct SwitchingReport {
    /// Table velocity, mm/s.
    pub table_mm_s: f64,
    /// Gains of the coupling where it is on, of those of the speed loops.
    pub share: f64,
    /// The load at the nut, N m.
    pub load_nm: f64,
    /// Time between two switches, s.
    pub switches_s: f64,
    /// How much less the coupled double drive errs, %, root mean square: than uncoupled, and than the single drive.
    pub less_percent: [f64; 2],
    /// The drives.
    pub cases: Vec<SwitchingCase>,
}

/// One drive.
#[derive(Debug, Serialize)]
pub struct SwitchingCase {
    /// Nut speed, rpm; 0 is CDFS.
    pub nut_rpm: f64,
    /// Gains of the coupling, of those of the speed loops; 0: off.
    pub share: f64,
    /// Error of the table's position about its mean, um: root mean square.
    pub rms_um: f64,
    /// Largest error of the table's velocity, mm/s.
    pub peak_mm_s: f64,
    /// How far the load moves the table, um: the mean of the last tenth before each switch, on against off.
    pub moved_um: f64,
    /// The same by the closed form `r T / (J w^2 (1 + 2 share))`, um.
    pub closed_form_um: f64,
    /// The error: (s, um).
    pub error_um: Vec<(f64, f64)>,
}

impl SwitchingCase {
    /// How it is called.
    pub fn name(&self) -> String {
        let drive = drive_name(self.nut_rpm);
        match self.share == 0.0 {
            true => drive,
            false => format!("{drive}, coupled"),
        }
    }
}

/// Runs all cases.
pub fn run(seed: u64) -> Result<SwitchingReport> {
    let mut model = Model::coupled();
    model.screw.torque_harmonics.clear();
    model.nut.torque_harmonics.clear();
    let mut setup = Setup::ideal(model, Coupling::Coupled);
    setup.board.seed = seed;
    let cases = [(0.0, 0.0), (NUT_RPM, 0.0), (NUT_RPM, SHARE)];
    let cases = on_all_cores(&cases, |&(nut_rpm, share)| case(&setup, nut_rpm, share));
    let cases = cases.into_iter().collect::<Result<Vec<_>, _>>()?;
    let rms = |k: usize| {
        cases
            .get(k)
            .map_or(f64::NAN, |case: &SwitchingCase| case.rms_um)
    };
    Ok(SwitchingReport {
        table_mm_s: 1e3 * VELOCITY,
        share: SHARE,
        load_nm: LOAD_NM,
        switches_s: SWITCHES_S,
        less_percent: [1, 0].map(|other| 100.0 * (1.0 - rms(2) / rms(other))),
        cases,
    })
}

fn case(setup: &Setup, nut_rpm: f64, share: f64) -> Result<SwitchingCase, ExperimentError> {
    let at = OperatingPoint {
        velocity: VELOCITY,
        base: nut_rpm * RPM,
    };
    let mut drive = setup.drive()?;
    settle_quietly(&mut drive, at)?;
    let mut coupled = Coupled::new(setup, share);
    settle_through(&mut drive, at, &mut coupled, |_| {
        Ok::<(), ExperimentError>(())
    })?;
    let period_s = setup.board.pwm_period_s();
    let start = drive.board.machine.table_position();
    let (mut error, mut peak) = (Vec::new(), 0.0_f64);
    for k in 0..(RECORD_S / period_s) as u32 {
        let t = f64::from(k) * period_s;
        coupled.load_nm = if is_on(t) { LOAD_NM } else { 0.0 };
        drive.period_through(&mut coupled);
        driven(&drive, at)?;
        let machine = &drive.board.machine;
        peak = peak.max((machine.table_velocity() - VELOCITY).abs());
        if k % SAMPLE_EVERY == 0 {
            let off = machine.table_position() - start - VELOCITY * (t + period_s);
            error.push((t, 1e6 * off));
        }
    }
    let rms_um = about_mean(&mut error);
    let plate = setup.plate();
    let stiffness = plate.motors[1].inertia_kg_m2 * setup.tuning.speed_rad_s.powi(2);
    Ok(SwitchingCase {
        nut_rpm,
        share,
        rms_um,
        peak_mm_s: 1e3 * peak,
        moved_um: moved(&error),
        closed_form_um: 1e6 * setup.model.feed.travel_per_radian() * LOAD_NM
            / (stiffness * (1.0 + 2.0 * share)),
        error_um: error,
    })
}

/// The load is on: every second time.
fn is_on(t: f64) -> bool {
    (t / SWITCHES_S) as u32 % 2 == 1
}

/// Mean error where the load has been on for long, less that where it has been off, without its sign.
fn moved(error: &[(f64, f64)]) -> f64 {
    let mean = |on: bool| {
        let late = error.iter().filter(|(t, _)| {
            let part = (t / SWITCHES_S).fract();
            // Before the first switch nothing has happened.
            *t > SWITCHES_S && part > 0.9 && is_on(*t) == on
        });
        let (sum, count) = late.fold((0.0, 0.0), |(sum, count), (_, off)| {
            (sum + off, count + 1.0)
        });
        sum / count
    };
    (mean(true) - mean(false)).abs()
}

/// Cross-coupling beside the speed loops, and the load at the nut.
struct Coupled {
    share: f64,
    gains: [Gains; 2],
    /// Time between two steps of the speed task, s.
    step_s: f64,
    /// The last speed errors, electrical rad/s, and the integral of screw against nut.
    errors: [f64; 2],
    integral: f64,
    load_nm: f64,
}

impl Coupled {
    fn new(setup: &Setup, share: f64) -> Self {
        let plate = setup.plate();
        Self {
            share,
            gains: plate.motors.map(|motor| motor.gains(&setup.tuning)),
            step_s: setup.board.pwm_period_s() * f64::from(plate.board.speed_divider),
            errors: [0.0; 2],
            integral: 0.0,
            load_nm: 0.0,
        }
    }
}

impl Seam for Coupled {
    fn machine(&mut self, machine: &mut Machine, _: u32) {
        machine.set_disturbance_torque(Axis::Nut, -self.load_nm);
    }

    fn current(&mut self, axis: Axis, seen: &SpeedSeen) -> Option<f64> {
        if self.share == 0.0 {
            return None;
        }
        let k = axis.index();
        self.errors[k] = seen.error;
        let [screw, nut] = self.errors;
        if axis == Axis::Screw {
            self.integral += self.step_s * (screw - nut);
        }
        let gains = &self.gains[k];
        let push = self.share * (gains.k_pw * (screw - nut) + gains.k_iw * self.integral);
        Some(if axis == Axis::Screw { push } else { -push })
    }
}
