//! The table of smoothness: machines, modes, speeds and controllers, side by side.

use super::{
    Compensator, Machine, Rival, Smoothness, drive, learned, orders, settle, setup, smoothness,
    smoothness_through, velocities,
};
use control::current_loop::MotorSample;
use control::encoder::Interface;
use control::plate::{CompensationPlate, RejectionPlate};
use hal_sim::drive::Drive;
use hal_sim::experiment::{ExperimentError, OperatingPoint, RPM, Setup};
use hal_sim::parallel::on_all_cores;
use hal_sim::seam::{Seam, Straight};
use hal_sim::switching::Switching;
use hal_sim::vrf::vrf_percent;
use plant::Axis;
use plant::model::Model;
use rand_distr::{Distribution, StandardUniform};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use std::f64::consts::TAU;

/// Time constant of the drive's learning, s.
pub const LEARNING_S: f64 = CompensationPlate::LEARNING_S;
/// Time that a controller learns from cold, s.
pub const COLD_S: f64 = 12.0;
/// Time from saved tables, s.
pub const SAVED_S: f64 = 1.0;
/// Table velocity at which a drive learns that is then measured at a slower one, mm/s.
const LEARNED_AT_MM_S: f64 = 2.5;

/// What is known of the table while the drive learns and after.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// A scale, always.
    There,
    /// A scale while it learned, none since.
    TakenAway,
    /// None.
    Never,
}

impl Scale {
    /// As a report calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::There => "there",
            Self::TakenAway => "taken away",
            Self::Never => "never",
        }
    }
}

/// A controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Controller {
    /// Another's.
    Rival(Rival),
    /// The drive's own compensation.
    Ours(Scale),
}

impl Controller {
    /// As a report calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Rival(rival) => rival.name(),
            Self::Ours(_) => "ours",
        }
    }
}

/// A row of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// The machine.
    pub machine: Machine,
    /// Nut speed, rpm; 0 is CDFS.
    pub nut_rpm: f64,
    /// Table velocity, mm/s.
    pub table_mm_s: f64,
    /// What controls it.
    pub controller: Controller,
    /// What its bridges are made of, if they switch.
    pub switching: Option<Switching>,
}

impl Case {
    fn point(&self) -> OperatingPoint {
        OperatingPoint {
            velocity: self.table_mm_s * 1e-3,
            base: self.nut_rpm * RPM,
        }
    }

    /// The residual of the ripple.
    ///
    /// # Errors
    /// [`ExperimentError`] if the drive cannot be configured, or leaves the point by a fault.
    pub fn run(&self, seed: u64) -> Result<Smoothness, ExperimentError> {
        let mut setup = setup(self.machine, seed);
        setup.board.switching = self.switching;
        let slower = OperatingPoint {
            velocity: self.point().velocity.max(LEARNED_AT_MM_S * 1e-3),
            ..self.point()
        };
        let again = if slower == self.point() { 0.0 } else { SAVED_S };
        match self.controller {
            Controller::Rival(rival) => {
                let mut compensator = Compensator::new(rival, &setup)?;
                let mut drive = setup.drive()?;
                if rival != Rival::Pi && rival != Rival::StaticMap {
                    settle(&mut drive, slower, &mut compensator)?;
                    velocities(&mut drive, COLD_S, &mut compensator)?;
                }
                smoothness_through(&mut drive, self.point(), again, &mut compensator)
            }
            Controller::Ours(scale) => {
                let mut plate = orders(&setup, LEARNING_S, scale != Scale::Never);
                let mut first = drive(&setup, plate)?;
                settle(&mut first, slower, &mut Straight)?;
                velocities(&mut first, COLD_S, &mut Straight)?;
                if scale == Scale::TakenAway {
                    plate = learned(&first, plate);
                    plate.scale_count_m = 0.0;
                    first = drive(&setup, plate)?;
                    return smoothness(&mut first, self.point(), SAVED_S);
                }
                smoothness(&mut first, self.point(), again)
            }
        }
    }
}

/// The rows: both boards as they ship with the PI and ours; each point of the paper's machine with all controllers, and the coupled machine's base speeds with the PI and ours.
#[must_use]
pub fn cases() -> Vec<Case> {
    const POINTS: [(Machine, f64, f64); 10] = [
        (Machine::Lumped, 0.0, 2.5),
        (Machine::Lumped, 800.0, 2.5),
        (Machine::Coupled, 0.0, 2.5),
        (Machine::Coupled, 800.0, 2.5),
        (Machine::Lumped, 0.0, 0.1),
        (Machine::Lumped, 800.0, 0.1),
        (Machine::Coupled, 0.0, 0.1),
        (Machine::Coupled, 800.0, 0.1),
        (Machine::Lumped, 800.0, 10.0),
        (Machine::Coupled, 800.0, 10.0),
    ];
    let ours = [Scale::There, Scale::TakenAway, Scale::Never].map(Controller::Ours);
    let all = Rival::ALL.map(Controller::Rival).into_iter().chain(ours);
    let points = POINTS
        .into_iter()
        .flat_map(|(machine, nut_rpm, table_mm_s)| {
            all.clone().map(move |controller| Case {
                machine,
                nut_rpm,
                table_mm_s,
                controller,
                switching: None,
            })
        });
    let bases = (3..=12).filter(|&base| base != 8).flat_map(|base| {
        [Controller::Rival(Rival::Pi), Controller::Ours(Scale::There)].map(|controller| Case {
            machine: Machine::Coupled,
            nut_rpm: 100.0 * f64::from(base),
            table_mm_s: 2.5,
            controller,
            switching: None,
        })
    });
    let shipped = [Machine::Mains, Machine::Nucleo]
        .into_iter()
        .flat_map(|machine| [0.0, 300.0, 500.0, 800.0].map(|nut_rpm| (machine, nut_rpm)))
        .flat_map(|(machine, nut_rpm)| {
            [Controller::Rival(Rival::Pi), Controller::Ours(Scale::There)].map(|controller| Case {
                machine,
                nut_rpm,
                table_mm_s: 2.5,
                controller,
                switching: None,
            })
        });
    shipped.chain(points).chain(bases).collect()
}

/// What a case left, over seeds.
#[derive(Clone, Debug)]
pub struct Row {
    /// The case.
    pub case: Case,
    /// What it left, or why a run ended.
    pub left: Result<Left, String>,
}

/// What runs of several seeds left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Left {
    /// Of each figure the median.
    pub median: Smoothness,
    /// The worst velocity ripple factor, %.
    pub worst: f64,
}

impl Left {
    fn of(runs: &[Smoothness]) -> Self {
        let sorted = |of: &dyn Fn(&Smoothness) -> f64| {
            let mut values: Vec<f64> = runs.iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let median = |of: &dyn Fn(&Smoothness) -> f64| sorted(of)[runs.len() / 2];
        Self {
            median: Smoothness {
                vrf: median(&|run| run.vrf),
                rms: median(&|run| run.rms),
                bands: [0, 1].map(|k: usize| median(&|run| run.bands[k])),
                following: [0, 1].map(|k: usize| median(&|run| run.following[k])),
            },
            worst: sorted(&|run| run.vrf)[runs.len() - 1],
        }
    }
}

/// Runs `cases` with so many seeds each, on all cores; `each` hears of each run that ends.
pub fn rows(cases: &[Case], seeds: u64, each: impl Fn() + Sync) -> Vec<Row> {
    let runs: Vec<(Case, u64)> = cases
        .iter()
        .flat_map(|&case| (1..=seeds).map(move |seed| (case, seed)))
        .collect();
    let results = on_all_cores(&runs, |(case, seed)| {
        let result = case.run(*seed);
        each();
        result
    });
    let mut results = results.into_iter();
    cases
        .iter()
        .map(|&case| {
            // All of the case's results, before the first error among them ends the case.
            let of_case: Vec<_> = results.by_ref().take(seeds as usize).collect();
            let runs: Result<Vec<Smoothness>, ExperimentError> = of_case.into_iter().collect();
            Row {
                case,
                left: runs
                    .map(|runs| Left::of(&runs))
                    .map_err(|error| error.to_string()),
            }
        })
        .collect()
}

/// What is other than the drive was told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Nothing.
    None,
    /// Inertia of both motors, %.
    Inertia(i32),
    /// Resistance of both, %.
    Resistance(i32),
    /// Flux of both, %.
    Flux(i32),
    /// The table's resonance is at 150 Hz instead of 503.
    AxialMode,
    /// The coefficient of six a turn starts with the wrong sign.
    Table,
    /// Absolute encoders of which one frame in 200 is wrong.
    Frames,
    /// The base speed sweeps from 300 to 1200 rpm in 20 s, and is never steady for long.
    Sweep,
}

impl Change {
    /// All.
    pub const ALL: [Self; 9] = [
        Self::None,
        Self::Inertia(30),
        Self::Inertia(-30),
        Self::Resistance(30),
        Self::Flux(-5),
        Self::AxialMode,
        Self::Table,
        Self::Frames,
        Self::Sweep,
    ];

    /// As a report calls it.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::None => "none".into(),
            Self::Inertia(percent) => format!("inertia {percent:+} %"),
            Self::Resistance(percent) => format!("resistance {percent:+} %"),
            Self::Flux(percent) => format!("flux {percent:+} %"),
            Self::AxialMode => "axial mode at 150 Hz".into(),
            Self::Table => "a table with the wrong sign".into(),
            Self::Frames => "1 encoder frame in 200 wrong".into(),
            Self::Sweep => "base speed sweeps 300 to 1200 rpm".into(),
        }
    }

    fn apply(self, model: &mut Model) {
        let part = |percent: i32| 1.0 + f64::from(percent) / 100.0;
        for axis in Axis::ALL {
            let motor = model.motor_mut(axis);
            match self {
                Self::Inertia(percent) => motor.inertia_kg_m2 *= part(percent),
                Self::Resistance(percent) => motor.resistance_ohm *= part(percent),
                Self::Flux(percent) => motor.flux_wb *= part(percent),
                _ => {}
            }
        }
        if self == Self::AxialMode {
            let omega = TAU * 150.0;
            model.feed.axial_stiffness_n_per_m = model.feed.table_mass_kg * omega * omega;
        }
    }
}

/// Wrong frames.
struct BadFrames {
    random: Xoshiro256PlusPlus,
    part: f64,
}

impl Seam for BadFrames {
    fn sample(&mut self, _: Axis, sample: &mut MotorSample) {
        let drawn: f64 = StandardUniform.sample(&mut self.random);
        if drawn < self.part {
            // A bit of the angle, which its check does not match.
            sample.encoder ^= 1 << 20;
        }
    }
}

/// The PI and ours on the coupled machine at 800 rpm with something other than the drive was told: the residual, %; `None` if
/// the drive ends in a fault.
#[must_use]
pub fn robustness(change: Change) -> [Option<f64>; 2] {
    robustness_with(change, RejectionPlate::NONE)
}

/// The same with a disturbance observer and a notch beside ours.
#[must_use]
pub fn robustness_with(change: Change, rejection: RejectionPlate) -> [Option<f64>; 2] {
    let mut setup = setup(Machine::Coupled, 1);
    if change == Change::Frames {
        for encoder in &mut setup.board.sensors.encoders {
            encoder.interface = Interface::Mt6835;
            encoder.counts_per_turn = control::mt6835::COUNTS_PER_TURN;
        }
    }
    let told = setup.plate();
    change.apply(&mut setup.model);
    let run = |compensation: CompensationPlate, seconds: f64| -> Option<f64> {
        let mut plate = told;
        plate.compensation = compensation;
        if compensation != CompensationPlate::NONE {
            plate.rejection = rejection;
        }
        let mut drive = Drive::aligned(&setup.model, setup.coupling, setup.board, &plate).ok()?;
        let mut frames = BadFrames {
            random: Xoshiro256PlusPlus::seed_from_u64(7),
            part: if change == Change::Frames { 0.005 } else { 0.0 },
        };
        if change == Change::Sweep {
            return sweep(&mut drive, seconds);
        }
        let point = point(800.0);
        smoothness_through(&mut drive, point, seconds, &mut frames)
            .ok()
            .map(|smoothness| smoothness.vrf)
    };
    let mut ours = orders(&setup, LEARNING_S, true);
    if change == Change::Table {
        for torque in &mut ours.torque {
            // What it learns is -0.14 A.
            torque[2].re = 0.14;
        }
    }
    [run(CompensationPlate::NONE, 0.0), run(ours, COLD_S)]
}

fn point(rpm: f64) -> OperatingPoint {
    OperatingPoint {
        velocity: 2.5e-3,
        base: rpm * RPM,
    }
}

/// Ripple while the base speed moves on by 1 rpm every 22 ms.
fn sweep(drive: &mut Drive, learns_s: f64) -> Option<f64> {
    settle(drive, point(300.0), &mut Straight).ok()?;
    velocities(drive, learns_s, &mut Straight).ok()?;
    let mut all = Vec::new();
    for step in 0..900 {
        let point = point(300.0 + f64::from(step));
        drive.command(point.velocity, point.base).ok()?;
        all.extend(velocities(drive, 20.0 / 900.0, &mut Straight).ok()?);
    }
    (drive.state() == control::supervisor::State::Running).then(|| vrf_percent(&all, 2.5e-3))
}

/// Time from cold, and from saved tables, until a second of motion is within twice what a second has in the end: lumped, CDFS,
/// which is the slowest to turn.
///
/// # Errors
/// [`ExperimentError`] if the drive does not reach the point.
pub fn learning_s() -> Result<[f64; 2], ExperimentError> {
    let setup: Setup = setup(Machine::Lumped, 1);
    let plate = orders(&setup, LEARNING_S, true);
    let mut cold = drive(&setup, plate)?;
    let from_cold = seconds_to_final(&mut cold)?;
    let mut saved = drive(&setup, learned(&cold, plate))?;
    Ok([from_cold, seconds_to_final(&mut saved)?])
}

fn seconds_to_final(drive: &mut Drive) -> Result<f64, ExperimentError> {
    drive.command(2.5e-3, 0.0)?;
    // The references take a third of a second to their targets.
    velocities(drive, 0.4, &mut Straight)?;
    let quarters = (0..96)
        .map(|_| velocities(drive, 0.25, &mut Straight))
        .collect::<Result<Vec<_>, _>>()?;
    let ripple: Vec<f64> = quarters
        .windows(4)
        .map(|second| vrf_percent(&second.concat(), 2.5e-3))
        .collect();
    let last = ripple
        .iter()
        .rev()
        .take(12)
        .fold(0.0, |sum, x| sum + x / 12.0);
    let late = ripple.iter().rposition(|&vrf| vrf > 2.0 * last);
    Ok(late.map_or(0.0, |k| 0.25 * (k + 1) as f64) + 0.4)
}
