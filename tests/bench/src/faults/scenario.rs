//! What may happen to a drive at work, each as a story in time: what it costs in travel, current and bus voltage.
//!
//! On the machine of the matrix and the bus that the board's wiring page asks for; the stop from full speed has a smaller one.

use super::bench::{Ends, STOP_N_PER_M};
use super::cell::{Defect, Input};
use super::run::{Run, stop_m};
use super::{Limits, Situation};
use control::plate::DrivePlate;
use control::supervisor::{Demand, State};
use hal_sim::boards::BoardKind;
use hal_sim::experiment::{ExperimentError, OperatingPoint, RPM};
use plant::Axis;
use std::f64::consts::TAU;

/// Energy that a small bus takes from its voltage to where braking ends, J.
const SMALL_BUS_J: f64 = 5.0;
/// Torque with which a seized nut is held, N m, and the speed below which it falls, rad/s.
const SEIZED: (f64, f64) = (8.0, 1.0);
/// Table velocity below which the force against it falls, m/s.
const CUTS_M_S: f64 = 1e-3;
/// How far the stop is ahead where the table goes on to it, m.
const TO_STOP_M: f64 = 1e-3;
/// How long a mains dip lasts, s.
const DIP_S: f64 = 20e-3;
/// Watched before and, at most, after the event, s.
const BEFORE_S: f64 = 0.05;
const AFTER_S: f64 = 20.0;
/// Of a scenario that ends in no fault.
const RUNS_ON_S: f64 = 1.5;
/// Furthest that the table may move at a start with an encoder that is dead, m.
const START_TRAVEL_M: f64 = 1e-3;
/// Time between two points of a plot, s.
const POINT_S: f64 = 2e-3;

/// A story.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scenario {
    /// The gate driver of the screw's bridge opens it, with both motors near their largest speed (2500 rpm on the default board,
    /// 3000 rpm on the mains board).
    MotorLost,
    /// The nut seizes at 800 rpm.
    NutSeized,
    /// The mains are gone for 20 ms at full speed.
    MainsDip,
    /// A tool that runs into the work: against the motion, up to twice the force of the rated torque.
    LoadStep,
    /// A stop from full speed on a bus that takes 5 J.
    FullStop,
    /// The commanding host is gone, at 100 mm/s.
    LinkPulled,
    /// An axis that is not homed, whose end switch is welded, goes on to its stop.
    EndStop,
    /// A motor's encoder keeps its count from rest on, and both motors are to start to the largest table velocity.
    DeadEncoder(Axis),
}

impl Scenario {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::MotorLost,
        Self::NutSeized,
        Self::MainsDip,
        Self::LoadStep,
        Self::FullStop,
        Self::LinkPulled,
        Self::EndStop,
        Self::DeadEncoder(Axis::Screw),
        Self::DeadEncoder(Axis::Nut),
    ];

    /// Its name in a few words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::MotorLost => "screw's motor lost at full speed",
            Self::NutSeized => "nut seizes at 800 rpm",
            Self::MainsDip => "mains dip of 20 ms at full speed",
            Self::LoadStep => "load step to twice the rated force",
            Self::FullStop => "stop from full speed, bus takes 5 J",
            Self::LinkPulled => "link pulled at 100 mm/s",
            Self::EndStop => "onto an end stop at 20 mm/s",
            Self::DeadEncoder(Axis::Screw) => "start, screw's encoder dead",
            Self::DeadEncoder(Axis::Nut) => "start, nut's encoder dead",
        }
    }

    fn point(self, plate: &DrivePlate) -> OperatingPoint {
        let (velocity, slow) = (20e-3, 800.0 * RPM);
        let [velocity, base] = match self {
            Self::MotorLost | Self::MainsDip | Self::FullStop => {
                // The screw turns that much faster than the nut.
                let table = velocity * TAU / plate.feed.lead_m;
                [velocity, 0.98 * plate.motors[0].speed_max() - table]
            }
            Self::NutSeized | Self::LoadStep | Self::EndStop => [velocity, slow],
            Self::LinkPulled | Self::DeadEncoder(_) => [plate.feed.velocity_max * 0.999, slow],
        };
        OperatingPoint { velocity, base }
    }
}

/// A point of a plot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// After the event, s.
    pub seconds: f64,
    /// Table, from where it was at the event, m.
    pub travel_m: f64,
    /// Shafts, rpm: screw, nut.
    pub rpm: [f64; 2],
    /// Largest phase current of screw and nut since the last point, A.
    pub peak_a: [f64; 2],
    /// Bus, V.
    pub bus_v: f64,
}

/// What came of it, each beside its limit.
#[derive(Clone, Debug, PartialEq)]
pub struct Story {
    /// How far the table went wrong, m: ahead of its way or back, until the drive reacts; then as in the matrix.
    pub travel_m: f64,
    /// At most.
    pub travel_max_m: f64,
    /// Largest phase current, A.
    pub peak_a: f64,
    /// The board's limit.
    pub peak_max_a: f64,
    /// Largest bus voltage, V.
    pub bus_v: f64,
    /// The guard's limit.
    pub bus_max_v: f64,
    /// Largest force on an end stop, N.
    pub end_force_n: f64,
    /// What both motors' torque and the energy of what moves make on a buffer.
    pub end_force_max_n: f64,
    /// After how long it was at rest, or was watched no longer, s.
    pub seconds: f64,
    /// What the drive did in the end.
    pub state: State,
    /// In time.
    pub points: Vec<Point>,
}

impl Story {
    /// Each is within its limit.
    #[must_use]
    pub fn within(&self) -> bool {
        self.travel_m <= self.travel_max_m
            && self.peak_a <= self.peak_max_a
            && self.bus_v <= self.bus_max_v
            && self.end_force_n <= self.end_force_max_n
    }
}

/// Lets it happen.
///
/// # Errors
/// [`ExperimentError`] if the drive cannot be configured or does not come to speed.
pub fn run(board: BoardKind, scenario: Scenario) -> Result<Story, ExperimentError> {
    let bus_v = board.bus_v();
    let plate = board.plate();
    let full = plate.bridge.brake_fade_to_v;
    let mut config = board.config_on_its_bus();
    if scenario == Scenario::FullStop {
        config.bus_f = 2.0 * SMALL_BUS_J / (full * full - bus_v * bus_v);
        config.chopper = None;
    }
    let mut run = Run::on(board, &plate, Situation::Ready, &[], 0, config)?;
    let point = scenario.point(&plate);
    if let Scenario::DeadEncoder(axis) = scenario {
        run.bench.put_in(Input::Encoder(axis), Defect::Frozen, 0);
        run.ask(point)?;
    } else {
        run.ask(point)?;
        run.pass(3.0);
        run.until(State::Running)?;
        run.pass(BEFORE_S);
    }

    let motor = &plate.motors[0];
    let torque =
        f64::from(motor.pole_pairs) * motor.flux_wb * 3f64.sqrt() * motor.thermal.rated_rms_a;
    let rated_n = torque.min(motor.torque_max_nm) * TAU / plate.feed.lead_m;
    match scenario {
        Scenario::MotorLost => run.drive.board.trip_break(Axis::Screw),
        Scenario::NutSeized | Scenario::LoadStep | Scenario::DeadEncoder(_) => {}
        Scenario::MainsDip => run.drive.board.set_supply(0.0),
        Scenario::FullStop => run.drive.request.demand = Demand::Rest,
        Scenario::LinkPulled => run.drive.attended = false,
        Scenario::EndStop => {
            run.bench.ends = Ends {
                middle: run.bench.position,
                switch: f64::INFINITY,
                stop: TO_STOP_M,
            };
        }
    }
    let (origin, load_n) = (run.bench.position, run.bench.load_n);
    let mut told = Story {
        travel_m: 0.0,
        travel_max_m: match scenario {
            Scenario::DeadEncoder(_) => START_TRAVEL_M,
            _ => Limits::OF_THE_MATRIX.travel_m,
        },
        peak_a: 0.0,
        peak_max_a: plate.bridge.over_current_a,
        bus_v: 0.0,
        bus_max_v: board.guards().bus_max_v,
        end_force_n: 0.0,
        end_force_max_n: end_force_max_n(&plate, point.velocity),
        seconds: 0.0,
        state: run.drive.state(),
        points: Vec::new(),
    };
    let (mut off, mut since, mut regular) = (0.0f64, 0.0f64, 0.0);
    let (mut reacted, mut still, mut peaks) = (None::<f64>, 0.0, [0.0f64; 2]);
    loop {
        if scenario == Scenario::NutSeized {
            let omega = run.drive.board.machine.motor(Axis::Nut).omega;
            let (torque, at) = SEIZED;
            let held = -torque * (omega / at).clamp(-1.0, 1.0);
            let machine = &mut run.drive.board.machine;
            machine.set_disturbance_torque(Axis::Nut, held);
        }
        if scenario == Scenario::LoadStep {
            let velocity = run.drive.board.machine.table_velocity();
            let against = (velocity / CUTS_M_S).clamp(-1.0, 1.0);
            run.bench.load_n = load_n + 2.0 * rated_n * against;
        }
        if scenario == Scenario::MainsDip && told.seconds >= DIP_S {
            run.drive.board.set_supply(bus_v);
        }
        run.period();
        told.seconds += run.period_s;
        let x = run.bench.position - origin;
        for axis in Axis::ALL {
            let amps = run.drive.board.machine.phase_currents(axis);
            let peak = amps.iter().fold(0.0f64, |peak, amps| peak.max(amps.abs()));
            peaks[axis.index()] = peaks[axis.index()].max(peak);
            told.peak_a = told.peak_a.max(peak);
        }
        told.bus_v = told.bus_v.max(run.drive.board.bus_voltage());
        let stops = run.reacts() || run.drive.state() == State::Stopping;
        match reacted {
            None if stops => {
                reacted = Some(x);
                if run.drive.state() == State::Stopping {
                    regular = stop_m(&plate, run.drive.board.machine.table_velocity());
                }
            }
            // A table that falls behind does no harm; one that goes ahead, or back, does.
            // In a start all of it counts.
            None if matches!(scenario, Scenario::DeadEncoder(_)) => off = off.max(x.abs()),
            None => off = off.max(x - point.velocity * told.seconds).max(-x),
            Some(from) => since = since.max((x - from).abs()),
        }
        let due = told.points.len() as f64 * POINT_S;
        if told.seconds >= due {
            let rpm = Axis::ALL.map(|axis| run.drive.board.machine.motor(axis).omega / RPM);
            told.points.push(Point {
                seconds: told.seconds,
                travel_m: x,
                rpm,
                peak_a: std::mem::take(&mut peaks),
                bus_v: run.drive.board.bus_voltage(),
            });
        }
        still = if run.at_rest() {
            still + run.period_s
        } else {
            0.0
        };
        let runs_on = reacted.is_none() && told.seconds > RUNS_ON_S;
        let rests = still > 0.05 && !run.drive.state().is_driven();
        if rests || runs_on || told.seconds > AFTER_S {
            break;
        }
    }
    told.travel_m = off + (since - regular).max(0.0);
    told.state = run.drive.state();
    told.end_force_n = run.bench.seen.end_force_n;
    Ok(told)
}

/// What the larger torque limit makes of axial force, and the energy of table and rotors against each other, all of it in the buffer's
/// spring.
fn end_force_max_n(plate: &DrivePlate, velocity: f64) -> f64 {
    let radians = TAU / plate.feed.lead_m;
    let [screw, nut] = &plate.motors;
    let torque = screw.torque_max_nm.max(nut.torque_max_nm);
    let rotors = 1.0 / (1.0 / screw.inertia_kg_m2 + 1.0 / nut.inertia_kg_m2);
    torque * radians + velocity * (STOP_N_PER_M * rotors * radians * radians).sqrt()
}
