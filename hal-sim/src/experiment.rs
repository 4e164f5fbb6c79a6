//! Experiments on the drive: a set-up, profiles, records.

use crate::board::BoardConfig;
use crate::boards::BoardKind;
use crate::drive::Drive;
use crate::encoder_errors::encoder_errors;
use crate::plates::{PAPER_TUNING, RECORDED_TUNING, deadbeat, on_electronics, plates};
use crate::seam::{Seam, Straight};
use crate::sensors::Sensors;
use crate::vrf::vrf_percent;
use control::coordinator::CommandError;
use control::fault::Fault;
use control::format::Misfit;
use control::plate::{DrivePlate, Tuning};
use control::supervisor::State;
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;
use plant::recording::{AxisSample, Sample};
use std::f64::consts::TAU;

/// Mechanical rad/s of one rpm.
pub const RPM: f64 = TAU / 60.0;

/// Why an experiment cannot be done.
#[derive(Debug, thiserror::Error)]
pub enum ExperimentError {
    /// A gain of the machine's plate data does not fit the drive's formats.
    #[error("the drive cannot be configured for this machine")]
    Misfit(#[from] Misfit),
    /// The feed or a motor may not move as fast as asked.
    #[error("{0}")]
    Command(CommandError),
    /// The rows of a recording are too far apart, or their time stands still.
    #[error(
        "the rows of the recording are {interval_s} s apart in the mean, but ripple shows only between 0.00001 s and \
         0.01 s: check the time column's unit, and record faster"
    )]
    Interval {
        /// Mean time between two rows, s.
        interval_s: f64,
    },
    /// The drive did not reach its operating point.
    #[error(
        "after {seconds} s the drive is still not steady at {velocity_mm_s} mm/s and nut {base_rpm:.0} rpm (state \
         {state:?}): lower the speeds, or check the load and the torque limit"
    )]
    NotSteady {
        /// How long it was given, s.
        seconds: f64,
        /// Asked table velocity, mm/s.
        velocity_mm_s: f64,
        /// Asked nut speed, rpm.
        base_rpm: f64,
        /// What the drive is doing.
        state: State,
    },
    /// A fault ended a record.
    #[error(
        "at {velocity_mm_s} mm/s and nut {base_rpm:.0} rpm the drive stopped while it was recorded, of the fault `{}`: lower the load, \
         or record for less time. If a motor stands there: for minutes it may make no more than its rated torque over sqrt(2), for one \
         phase then takes twice its share of the heat, and the drive folds its torque back",
        fault.name()
    )]
    Faulted {
        /// Asked table velocity, mm/s.
        velocity_mm_s: f64,
        /// Asked nut speed, rpm.
        base_rpm: f64,
        /// Why it stopped.
        fault: Fault,
    },
}

impl From<CommandError> for ExperimentError {
    fn from(error: CommandError) -> Self {
        Self::Command(error)
    }
}

/// A machine, the board and the tuning of its drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// The machine.
    pub model: Model,
    /// How screw and nut meet.
    pub coupling: Coupling,
    /// The board.
    pub board: BoardConfig,
    /// The loops' tuning.
    pub tuning: Tuning,
    /// The board that ships with this plate; `None`: the control code is given what the model says.
    pub shipped: Option<BoardKind>,
    /// The board whose electronics carry a machine of one's own.
    pub electronics: Option<BoardKind>,
}

impl Setup {
    /// A board as it ships, with its own sensors, the errors of its encoders, motors and tuning: `template` is the machine around
    /// them.
    #[must_use]
    pub fn shipped(kind: BoardKind, template: &Model, coupling: Coupling) -> Self {
        let (mut model, tuning) = (kind.machine(template, coupling), kind.plate().tuning);
        model.effects.extend(encoder_errors(kind));
        Self {
            shipped: Some(kind),
            ..Self::on(model, coupling, kind.config(), tuning)
        }
    }

    /// A machine of one's own on the electronics of a board: its bridges, currents and bus voltage. Encoders and scale are what `model`
    /// declares.
    #[must_use]
    pub fn on_electronics(kind: BoardKind, model: Model, coupling: Coupling) -> Self {
        let (own, declared) = (kind.config(), Sensors::declared(&model));
        let board = BoardConfig {
            bus_v: model.installation.bus_v,
            sensors: Sensors {
                current: own.sensors.current,
                bus: own.sensors.bus,
                ..declared
            },
            ..own
        };
        Self {
            electronics: Some(kind),
            ..Self::on(model, coupling, board, kind.plate().tuning)
        }
    }

    /// `model` with ideal sensors: nothing between the machine and the control law but its sample time.
    #[must_use]
    pub fn ideal(model: Model, coupling: Coupling) -> Self {
        let board = BoardConfig {
            sensors: Sensors::ideal(),
            bus_v: model.installation.bus_v,
            ..BoardConfig::default()
        };
        Self::on(model, coupling, board, deadbeat(PAPER_TUNING, &board))
    }

    /// `model` with a good drive's sensors and an observer of 1000 rad/s.
    #[must_use]
    pub fn real(model: Model, coupling: Coupling) -> Self {
        let board = BoardConfig {
            bus_v: model.installation.bus_v,
            ..BoardConfig::default()
        };
        Self::on(model, coupling, board, PAPER_TUNING)
    }

    /// With the board's sensors and supply in the model's place: a recording is as good as they are.
    fn on(mut model: Model, coupling: Coupling, board: BoardConfig, tuning: Tuning) -> Self {
        model.sensing = board.sensors.described(model.sensing);
        model.installation.scale_count_m = board.sensors.scale_count_m;
        model.installation.bus_v = board.bus_v;
        Self {
            model,
            coupling,
            board,
            tuning,
            shipped: None,
            electronics: None,
        }
    }

    /// `model` with the sensors that its file declares, on a drive as the shared recordings were made with.
    #[must_use]
    pub fn declared(model: Model, coupling: Coupling) -> Self {
        let sensors = Sensors::declared(&model);
        let current = &sensors.current;
        let range_a = 0.5 * f64::from(current.counts) * current.per_count.abs();
        let board = BoardConfig {
            sensors,
            pwm_hz: model.sensing.control_hz,
            bus_v: model.installation.bus_v,
            break_a: BREAK * range_a,
            ..BoardConfig::default()
        };
        Self {
            model,
            coupling,
            board,
            tuning: RECORDED_TUNING,
            shipped: None,
            electronics: None,
        }
    }

    /// What the control code is given.
    #[must_use]
    pub fn plate(&self) -> DrivePlate {
        if let Some(kind) = self.shipped {
            return kind.plate();
        }
        let plate = plates(&self.model, self.coupling, &self.board, self.tuning);
        match self.electronics {
            Some(kind) => on_electronics(kind, plate),
            None => plate,
        }
    }

    /// The drive at rest, with its rotors aligned.
    ///
    /// # Errors
    /// [`ExperimentError::Misfit`] if a gain does not fit its format.
    pub fn drive(&self) -> Result<Drive, ExperimentError> {
        self.drive_with(&self.plate())
    }

    /// The same, told what `plate` says. A board measures its current zeros and charges its drivers before it holds a load: a brake
    /// carries it until then.
    ///
    /// # Errors
    /// [`ExperimentError::Misfit`] if a gain does not fit its format.
    pub fn drive_with(&self, plate: &DrivePlate) -> Result<Drive, ExperimentError> {
        let mut drive = Drive::aligned(&self.model, self.coupling, self.board, plate)?;
        if self.shipped.or(self.electronics).is_some() {
            drive.board.machine.set_load_force(0.0);
            for _ in 0..(BRAKED_S / self.board.pwm_period_s()) as u32 {
                drive.period();
            }
            drive.board.machine.set_load_force(self.model.feed.load_n);
        }
        Ok(drive)
    }
}

/// Phase current that trips the break input, of the range of the current sensor that a model declares.
const BREAK: f64 = 0.8;

/// How long a brake carries the load of a board's machine, s.
const BRAKED_S: f64 = 0.3;

/// A table velocity and a nut speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OperatingPoint {
    /// Table velocity, m/s.
    pub velocity: f64,
    /// Nut speed, mechanical rad/s; 0 is CDFS.
    pub base: f64,
}

/// Time that transients are given once the references are at their targets, s: many times the slowest loop's.
const SETTLE_S: f64 = 0.3;

/// Longest that references may take to their targets, s.
const REACH_S: f64 = 20.0;

/// Commands an operating point and lets the drive come to it; `each` sees the drive after each PWM period.
///
/// # Errors
/// [`ExperimentError`] if the point is not allowed or not reached, or what `each` returns.
pub fn settle<E: From<ExperimentError>>(
    drive: &mut Drive,
    point: OperatingPoint,
    each: impl FnMut(&mut Drive) -> Result<(), E>,
) -> Result<(), E> {
    settle_through(drive, point, &mut Straight, each)
}

/// [`settle`] with `seam` between board and control.
///
/// # Errors
/// As [`settle`].
pub fn settle_through<E: From<ExperimentError>>(
    drive: &mut Drive,
    point: OperatingPoint,
    seam: &mut impl Seam,
    mut each: impl FnMut(&mut Drive) -> Result<(), E>,
) -> Result<(), E> {
    drive
        .command(point.velocity, point.base)
        .map_err(ExperimentError::from)?;
    let period_s = drive.board.config().pwm_period_s();
    let (settle, reach) = ((SETTLE_S / period_s) as u64, (REACH_S / period_s) as u64);
    let mut steady = 0;
    for _ in 0..reach {
        drive.period_through(seam);
        each(drive)?;
        steady = if drive.state().is_driven() && drive.arrived() {
            steady + 1
        } else {
            0
        };
        if steady >= settle {
            return Ok(());
        }
    }
    Err(E::from(ExperimentError::NotSteady {
        seconds: REACH_S,
        velocity_mm_s: point.velocity * 1e3,
        base_rpm: point.base / RPM,
        state: drive.state(),
    }))
}

/// A drive that is recorded at a point has no fault.
///
/// # Errors
/// [`ExperimentError::Faulted`].
pub fn driven(drive: &Drive, point: OperatingPoint) -> Result<(), ExperimentError> {
    match drive.state() {
        State::Fault(fault) => Err(ExperimentError::Faulted {
            velocity_mm_s: point.velocity * 1e3,
            base_rpm: point.base / RPM,
            fault,
        }),
        _ => Ok(()),
    }
}

/// [`settle`] with nobody watching.
///
/// # Errors
/// [`ExperimentError`] if the point is not allowed or not reached.
pub fn settle_quietly(drive: &mut Drive, point: OperatingPoint) -> Result<(), ExperimentError> {
    settle(drive, point, |_| Ok(()))
}

/// True table velocities, m/s, of a drive that runs for `seconds`, sampled every `periods` PWM periods; `each` sees
/// the drive after each period.
///
/// # Errors
/// What `each` returns.
pub fn table_velocities<E>(
    drive: &mut Drive,
    seconds: f64,
    periods: u32,
    each: impl FnMut(&mut Drive) -> Result<(), E>,
) -> Result<Vec<f64>, E> {
    table_velocities_through(drive, seconds, periods, &mut Straight, each)
}

/// [`table_velocities`] with `seam` between board and control.
///
/// # Errors
/// What `each` returns.
pub fn table_velocities_through<E>(
    drive: &mut Drive,
    seconds: f64,
    periods: u32,
    seam: &mut impl Seam,
    mut each: impl FnMut(&mut Drive) -> Result<(), E>,
) -> Result<Vec<f64>, E> {
    let samples =
        (seconds / (drive.board.config().pwm_period_s() * f64::from(periods))).round() as usize;
    let mut velocities = Vec::with_capacity(samples);
    for _ in 0..samples {
        for _ in 0..periods {
            drive.period_through(seam);
            each(drive)?;
        }
        velocities.push(drive.board.machine.table_velocity());
    }
    Ok(velocities)
}

/// Table velocity, mm/s, and nut speed, rpm, of the operating points of a fit record.
pub const FIT: [(f64, f64); 6] = [
    (2.5, 0.0),
    (-2.5, 0.0),
    (2.5, 300.0),
    (-5.0, 300.0),
    (8.0, 600.0),
    (2.5, -400.0),
];
/// Those of the check record.
pub const CHECK: [(f64, f64); 4] = [(3.5, 0.0), (-2.0, 200.0), (6.0, 450.0), (2.5, -250.0)];
/// How long each is held, s.
pub const HELD_S: f64 = 1.5;
/// Length of a velocity record, s: at least one beat of the motors' harmonics, and what the reference figures use.
pub const RECORD_S: f64 = 4.0;

/// Rate of a velocity record, Hz.
pub const RECORD_HZ: f64 = 10_000.0;

/// PWM periods between two samples of a velocity record on `board`, at [`RECORD_HZ`] or as near as the periods allow.
#[must_use]
pub fn record_periods(board: &BoardConfig) -> u32 {
    (1.0 / (RECORD_HZ * board.pwm_period_s())).round().max(1.0) as u32
}

/// Velocity ripple factor, %, of a fresh drive at `point`: true table velocity, [`RECORD_S`] long, no filter.
///
/// # Errors
/// [`ExperimentError`] if the drive cannot be configured or does not reach the point.
pub fn ripple_percent(setup: &Setup, point: OperatingPoint) -> Result<f64, ExperimentError> {
    let mut drive = setup.drive()?;
    settle_quietly(&mut drive, point)?;
    let periods = record_periods(&setup.board);
    let velocities = table_velocities(&mut drive, RECORD_S, periods, |_| {
        Ok::<(), ExperimentError>(())
    })?;
    Ok(vrf_percent(&velocities, point.velocity))
}

/// Turns what the drive knows into rows of a recording.
#[derive(Debug, Default)]
pub struct Recorder {
    turns: [i64; 2],
    before: [Option<u32>; 2],
}

impl Recorder {
    /// One row, of the last period of `drive`. Call it at least twice a turn of the fastest motor.
    pub fn row(&mut self, drive: &mut Drive) -> Sample {
        let config = *drive.board.config();
        let axes = Axis::ALL.map(|axis| {
            let (sample, voltage) = (drive.sample(axis), drive.ended_voltage(axis));
            let speed = drive.speed();
            let k = axis.index();
            let encoder = &config.sensors.encoders[k];
            let counts = encoder.interface.counts(sample.encoder).unwrap_or_default();
            let pole_pairs = f64::from(drive.pole_pairs(axis));
            let amps = |counts: u16| {
                (f64::from(counts) - config.sensors.current.zero) * config.sensors.current.per_count
            };
            AxisSample {
                angle_rad: self.unwrap(k, counts, encoder.counts_per_turn),
                ia_a: amps(sample.current[0]),
                ib_a: amps(sample.current[1]),
                ud_v: voltage.d.to_num(),
                uq_v: voltage.q.to_num(),
                iq_ref_a: speed.current[k].i_q.to_num(),
                speed_ref_rad_s: speed.speed[k].omega_e.to_num::<f64>() / pole_pairs,
            }
        });
        Sample {
            time_s: drive.periods() as f64 * config.pwm_period_s(),
            axes,
            table_position_m: drive.board.scale_counts() as f64 * config.sensors.scale_count_m,
        }
    }

    /// Many-turn angle, rad, of the encoder of motor `k`.
    fn unwrap(&mut self, k: usize, counts: u32, per_turn: u32) -> f64 {
        if let Some(before) = self.before[k] {
            let step = i64::from(counts) - i64::from(before);
            let half = i64::from(per_turn) / 2;
            self.turns[k] += i64::from(step < -half) - i64::from(step > half);
        }
        self.before[k] = Some(counts);
        (self.turns[k] as f64 + f64::from(counts) / f64::from(per_turn)) * TAU
    }
}
