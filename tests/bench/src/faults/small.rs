//! Sensor faults of growing size: from which size on the drive stops, and what the smaller ones do to the table.
//!
//! The machine is a board's own, as it ships, with the load of the coupled model.

use control::supervisor::State;
use hal_sim::boards::BoardKind;
use hal_sim::drive::Drive;
use hal_sim::experiment::{ExperimentError, OperatingPoint, RPM, Setup, settle_quietly};
use hal_sim::seam::Seam;
use hal_sim::sensors::encoder_word;
use hal_sim::switching::Switching;
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;
use std::f64::consts::TAU;

/// How long the drive is watched after the fault, s.
const WATCHED_S: f64 = 2.0;
/// Both motors turn from then on where the nut's encoder froze while it stood, s.
const TURNS_S: f64 = 0.5;
/// Table velocity of all points, m/s.
const VELOCITY: f64 = 2.5e-3;

/// What is wrong with the nut's motor or its sensors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SmallFault {
    /// Its encoder slips on its shaft, or loses counts: at once, degrees of the shaft.
    Slip(f64),
    /// Its magnets have lost so much of their flux, a part.
    WeakFlux(f64),
    /// The channel of its phase a shows so much less than flows, a part: 1 is a channel that is stuck at zero.
    Gain(f64),
    /// Its encoder froze while the nut stood. Both motors are asked to turn later.
    FrozenAtRest,
}

impl SmallFault {
    /// All sizes.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let mut all = Vec::new();
        all.extend([0.02, 0.1, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0].map(Self::Slip));
        all.extend([0.05, 0.1, 0.2, 0.3, 0.4].map(Self::WeakFlux));
        all.extend([0.02, 0.05, 0.1, 0.25, 0.5, 1.0].map(Self::Gain));
        all.push(Self::FrozenAtRest);
        all
    }

    /// In a few words.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Slip(degrees) => format!("encoder slips by {degrees} degrees"),
            Self::WeakFlux(part) => format!("flux {:.0} % weaker", 100.0 * part),
            Self::Gain(part) => format!("channel shows {:.0} % less", 100.0 * part),
            Self::FrozenAtRest => "encoder frozen while it stands".to_owned(),
        }
    }
}

/// What came of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmallOutcome {
    /// What the drive was doing at the end.
    pub state: State,
    /// From the fault, or from when a motor with a frozen encoder is asked to turn, to the drive's reaction, s; `None`: it did not react; 0: it reacted before it was at its point.
    pub stopped_s: Option<f64>,
    /// Furthest that the table was from where the healthy drive has it, until the drive reacted, m.
    pub table_m: f64,
    /// Ripple of the table's velocity in the last second, rms of its mean, of a drive that did not react.
    pub ripple: f64,
    /// Largest current reference of the nut, of its largest.
    pub current: f64,
}

/// What stands between the board and the drive.
struct FaultySensors {
    fault: SmallFault,
    board: BoardKind,
    frozen: Option<u32>,
}

impl Seam for FaultySensors {
    fn currents(&mut self, axis: Axis, amps: &mut [f64; 3]) {
        if let (Axis::Nut, SmallFault::Gain(part)) = (axis, self.fault) {
            amps[0] *= 1.0 - part;
        }
    }

    fn sample(&mut self, axis: Axis, sample: &mut control::current_loop::MotorSample) {
        if axis != Axis::Nut {
            return;
        }
        match self.fault {
            SmallFault::Slip(degrees) => {
                let encoder = self.board.plate().motors[axis.index()].encoder;
                let counts = encoder.interface.counts(sample.encoder).unwrap_or_default();
                let turned = f64::from(counts) / f64::from(encoder.counts_per_turn);
                let slipped = (turned + degrees / 360.0).rem_euclid(1.0);
                // The middle of a count.
                let half = 0.5 / f64::from(encoder.counts_per_turn);
                sample.encoder = encoder_word(&encoder, TAU * (slipped + half));
            }
            SmallFault::FrozenAtRest => {
                sample.encoder = *self.frozen.get_or_insert(sample.encoder);
            }
            SmallFault::WeakFlux(_) | SmallFault::Gain(_) => {}
        }
    }
}

/// The drive's way after the fault.
struct Watched {
    path_m: Vec<f64>,
    velocities: Vec<f64>,
    stopped_s: Option<f64>,
    current: f64,
    state: State,
}

fn watch(
    setup: &Setup,
    point: OperatingPoint,
    later: Option<OperatingPoint>,
    seam: &mut impl Seam,
) -> Result<Watched, ExperimentError> {
    let mut drive: Drive = setup.drive()?;
    settle_quietly(&mut drive, point)?;
    let (period_s, origin) = (
        setup.board.pwm_period_s(),
        drive.board.machine.table_position(),
    );
    let largest = setup.plate().motors[Axis::Nut.index()].current_max();
    let periods = (WATCHED_S / period_s) as usize;
    let mut watched = Watched {
        path_m: Vec::with_capacity(periods),
        velocities: Vec::with_capacity(periods),
        stopped_s: None,
        current: 0.0,
        state: drive.state(),
    };
    for n in 0..periods {
        let time_s = n as f64 * period_s;
        if let Some(point) = later.filter(|_| n == (TURNS_S / period_s) as usize) {
            drive.command(point.velocity, point.base)?;
        }
        drive.period_through(seam);
        if !drive.state().is_driven() {
            watched.stopped_s.get_or_insert(time_s);
        }
        let machine = &drive.board.machine;
        watched.path_m.push(machine.table_position() - origin);
        watched.velocities.push(machine.table_velocity());
        let i_q: f64 = drive.speed().current[Axis::Nut.index()].i_q.to_num();
        watched.current = watched.current.max(i_q.abs() / largest);
    }
    watched.state = drive.state();
    Ok(watched)
}

/// Of a board's drive that turns its nut with `nut_rpm`.
///
/// # Errors
/// [`ExperimentError`] if the drive cannot be configured, or does not come to its point in health.
pub fn small_fault(
    board: BoardKind,
    switching: Option<Switching>,
    fault: SmallFault,
    nut_rpm: f64,
) -> Result<SmallOutcome, ExperimentError> {
    let mut healthy = Setup::shipped(board, &Model::coupled(), Coupling::Coupled);
    healthy.board.switching = switching;
    let at = |rpm: f64| OperatingPoint {
        velocity: VELOCITY,
        base: rpm * RPM,
    };
    let frozen = fault == SmallFault::FrozenAtRest;
    let (point, later) = if frozen {
        (at(0.0), Some(at(nut_rpm)))
    } else {
        (at(nut_rpm), None)
    };
    let expected = watch(&healthy, point, later, &mut hal_sim::seam::Straight)?;
    let mut setup = healthy;
    if let SmallFault::WeakFlux(part) = fault {
        setup.model.motor_mut(Axis::Nut).flux_wb *= 1.0 - part;
    }
    let mut sensors = FaultySensors {
        fault,
        board,
        frozen: None,
    };
    let found = match watch(&setup, point, later, &mut sensors) {
        // Weak magnets are there from the start.
        Err(ExperimentError::NotSteady { state, .. }) if matches!(state, State::Fault(_)) => {
            return Ok(SmallOutcome {
                state,
                stopped_s: Some(0.0),
                table_m: 0.0,
                ripple: 0.0,
                current: 0.0,
            });
        }
        found => found?,
    };
    let until = found.stopped_s.map_or(found.path_m.len(), |seconds| {
        (seconds / setup.board.pwm_period_s()) as usize
    });
    let since_s = if frozen { TURNS_S } else { 0.0 };
    let both = found.path_m.iter().zip(&expected.path_m).take(until);
    let last = &found.velocities[found.velocities.len() / 2..];
    let mean = last.iter().sum::<f64>() / last.len() as f64;
    let variance = last.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / last.len() as f64;
    Ok(SmallOutcome {
        state: found.state,
        stopped_s: found.stopped_s.map(|seconds| seconds - since_s),
        table_m: both.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max),
        ripple: variance.sqrt() / mean.abs(),
        current: found.current,
    })
}
