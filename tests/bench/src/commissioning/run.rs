//! One commissioning from cold, beside the truth.

use crate::alignment::error_deg;
use commission::Session;
use commission::procedure::{Done, Options, Step, run};
use commission::tune::Tuned;
use control::format::Misfit;
use control::plate::DrivePlate;
use fft::Complex64;
use hal_sim::drive::Drive;
use hal_sim::served::{Serving, SimulatedDrive, Within};
use hal_sim::start::Start;
use link::host::client::Client;
use link::settings::{PER_KRPM, Settings};
use plant::Axis;
use plant::machine::Coupling;
use pollster::block_on;
use std::cell::RefCell;
use std::f64::consts::TAU;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// What a commissioning found, beside the truth.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Why it ended early.
    pub failure: Option<String>,
    /// The steps that were done.
    pub done: Vec<Done>,
    /// How far resistance, inductance, flux and inertia of the settings are off, %: screw, nut.
    pub error_percent: [[f64; 4]; 2],
    /// How far the drive's electrical angles are off, degrees.
    pub offset_deg: [f64; 2],
    /// Directions of both encoders and pole pairs are those of the machine.
    pub signs_right: bool,
    /// Bandwidth of the speed loops on the true machine, of what was predicted.
    pub bandwidth_part: [f64; 2],
    /// Smallest phase margin of the speed loops on the true machine, degrees.
    pub margin_deg: f64,
    /// All limits of all steps were kept.
    pub within_limits: bool,
    /// How long it took, s.
    pub seconds: f64,
}

/// What is asked of a commissioning by default.
pub const USUAL: Options = Options {
    travel_m: 10e-3,
    speed_rad_s: None,
    margin_deg: 45.0,
    steps: &Step::ALL,
};

/// Commissions the drive of `start` over its link.
///
/// # Errors
/// [`Misfit`] if what the drive is given of the machine does not fit its formats.
pub fn commission(start: &Start, options: &Options) -> Result<Outcome, Misfit> {
    let serving = Serving::new(SimulatedDrive::cold(start)?);
    let serving = Rc::new(RefCell::new(serving));
    let mut done = Vec::new();
    let failure = Client::open(Within::open(&serving))
        .and_then(|client| block_on(Session::open(client, Arc::new(AtomicBool::new(false)))))
        .and_then(|mut session| {
            block_on(run(
                &mut session,
                options,
                &mut done,
                &mut |_, _| (),
                &mut |_| Ok(()),
            ))
        })
        .err()
        .map(|error| format!("{error:#}"));
    let serving = serving.borrow();
    let drive = serving.drive();
    let settings = drive.settings();
    let r = start.model.feed.travel_per_radian();
    let table = start.model.feed.table_mass_kg * r * r;
    let motors = [&settings.screw, &settings.nut];
    let mut error_percent = [[0.0; 4]; 2];
    let mut signs_right = failure.is_none();
    for axis in Axis::ALL {
        let (motor, truth) = (motors[axis.index()], start.model.motor(axis));
        let p = f64::from(motor.pole_pairs);
        error_percent[axis.index()] = [
            motor.resistance_line_to_line_ohm / 2.0 / truth.resistance_ohm,
            motor.inductance_line_to_line_mh / 2e3 / truth.inductance_h,
            motor.voltage_constant_v_rms_per_krpm / PER_KRPM / p / truth.flux_wb,
            motor.inertia_kg_cm2 * 1e-4 / (truth.inertia_kg_m2 + table),
        ]
        .map(|part| 100.0 * (part - 1.0));
        let reversed = start.board.wiring.motors[axis.index()].encoder_reversed;
        let held = drive.drive().exchange(axis).alignment();
        signs_right &= motor.pole_pairs == truth.pole_pairs
            && held.is_some_and(|held| held.reversed == reversed);
    }
    let (mut bandwidth_part, mut margin_deg) = ([0.0; 2], 0.0);
    if failure.is_none() {
        margin_deg = f64::INFINITY;
        for axis in Axis::ALL {
            let measured = crossing(start, settings, axis)?;
            let [part, margin] = measured.unwrap_or_default();
            bandwidth_part[axis.index()] = part;
            margin_deg = margin_deg.min(margin);
        }
    }
    let within_limits = done
        .iter()
        .flat_map(|done| &done.limits)
        .all(|limited| limited.reached <= limited.limit);
    Ok(Outcome {
        failure,
        error_percent,
        offset_deg: Axis::ALL.map(|axis| error_deg(start, drive.drive(), axis)),
        signs_right,
        bandwidth_part,
        margin_deg,
        within_limits,
        seconds: serving.ms() as f64 * 1e-3,
        done,
    })
}

/// Torque that is injected, of the largest.
const TORQUE: f64 = 0.05;
/// How long a frequency is waited for and measured, s.
const SETTLE_S: f64 = 0.1;
const MEASURE_S: f64 = 0.3;

/// Where the speed loop of `axis` crosses on the true machine under `settings`, of what they predict, and its phase margin,
/// degrees: measured on the simulated drive, by a sine torque on the shaft. `None` if it does not run.
fn crossing(start: &Start, settings: &Settings, axis: Axis) -> Result<Option<[f64; 2]>, Misfit> {
    let plate = settings.plate(&start.plate.board);
    let (period_s, step_s) = (start.board.pwm_period_s(), plate.speed_step());
    let predicted = Tuned::of(settings, period_s, step_s).speed[axis.index()].bandwidth_rad_s;
    // Without a relation that only friction holds: each motor alone with what it moves.
    let mut model = start.model.clone();
    let r = model.feed.travel_per_radian();
    let table = model.feed.table_mass_kg * r * r;
    for axis in Axis::ALL {
        model.motor_mut(axis).inertia_kg_m2 += table;
        model.motor_mut(axis).torque_harmonics.clear();
    }
    model.effects.clear();
    model.feed.load_n = 0.0;
    let truth = model.motor(axis);
    let p = f64::from(truth.pole_pairs);
    let mut last: Option<(f64, Complex64)> = None;
    for part in [0.85, 0.95, 1.05, 1.18] {
        let w = part * predicted;
        let Some(sensitivity) = sensitivity(&model, start, &plate, axis, w)? else {
            return Ok(None);
        };
        let plant = Complex64::new(truth.viscous_nm_s, truth.inertia_kg_m2 * w).inv() * p;
        let open = plant / sensitivity - 1.0;
        if let Some((before, was)) = last
            && was.norm() >= 1.0
            && open.norm() < 1.0
        {
            // Straight in the logarithms.
            let share = was.norm().ln() / (was.norm().ln() - open.norm().ln());
            let at = before * (w / before).powf(share);
            let margin = |open: Complex64| (-open).arg().to_degrees();
            let margin = margin(was) + share * (margin(open) - margin(was));
            return Ok(Some([at / predicted, margin]));
        }
        last = Some((w, open));
    }
    Ok(None)
}

/// Electrical speed per torque of `axis`, rad/s per N m, at `w` rad/s.
fn sensitivity(
    model: &plant::model::Model,
    start: &Start,
    plate: &DrivePlate,
    axis: Axis,
    w: f64,
) -> Result<Option<Complex64>, Misfit> {
    let mut board = start.board;
    let mut plate = *plate;
    for k in 0..2 {
        board.wiring.motors[k].encoder_reversed = false;
        plate.motors[k].encoder.reversed = Some(false);
    }
    let mut drive = Drive::aligned(model, Coupling::Lumped, board, &plate)?;
    let speed = 0.2
        * plate
            .motors
            .iter()
            .map(control::plate::MotorPlate::speed_max)
            .fold(f64::INFINITY, f64::min);
    if drive.command(0.0, speed).is_err() {
        return Ok(None);
    }
    let most = (10.0 / board.pwm_period_s()) as u64;
    while !(drive.state().is_driven() && drive.arrived()) {
        drive.period();
        if drive.periods() > most {
            return Ok(None);
        }
    }
    let torque = TORQUE * plate.motors[axis.index()].torque_max_nm;
    let period_s = board.pwm_period_s();
    let p = f64::from(plate.motors[axis.index()].pole_pairs);
    // Whole turns of the sine.
    let turns = (MEASURE_S * w / TAU).ceil();
    let measured = (turns * TAU / w / period_s).round() as u64;
    let before = (SETTLE_S / period_s) as u64;
    let (mut sum, mut reference, mut mean) = (Complex64::ZERO, Complex64::ZERO, 0.0);
    for k in 0..before + measured {
        let t = k as f64 * period_s;
        drive.period_with(|machine, half| {
            let at = t + 0.5 * period_s * (f64::from(half) + 0.5);
            machine.set_disturbance_torque(axis, torque * (w * at).cos());
        });
        if k >= before {
            let phasor = Complex64::cis(-w * (t + period_s));
            let speed = p * drive.board.machine.motor(axis).omega;
            sum += phasor * speed;
            reference += phasor;
            mean += speed / measured as f64;
        }
    }
    Ok(Some(
        (sum - reference * mean) * (2.0 / measured as f64 / torque),
    ))
}
