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
    let mut happening = Happening::before(board, scenario)?;
    happening.begin();
    loop {
        happening.act();
        happening.period();
        if happening.is_over() {
            return Ok(happening.story());
        }
    }
}

/// A scenario on its way.
struct Happening {
    scenario: Scenario,
    plate: DrivePlate,
    run: Run,
    point: OperatingPoint,
    bus_v: f64,
    /// Where the table was at the event, m, and its load then, N.
    origin: f64,
    load_n: f64,
    told: Story,
    /// How far it went wrong until the drive reacted, m, and where that was.
    off: f64,
    reacted: Option<f64>,
    /// How far it went from there, and how far the stop takes it, m.
    since: f64,
    regular: f64,
    /// How long it has been at rest, s.
    still: f64,
    /// Largest currents since the last point of the plot, A.
    peaks: [f64; 2],
}

impl Happening {
    /// A drive at the scenario's speed, or at rest where it begins with a start.
    fn before(board: BoardKind, scenario: Scenario) -> Result<Self, ExperimentError> {
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
        let told = Story {
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
        Ok(Self {
            scenario,
            point,
            bus_v,
            origin: run.bench.position,
            load_n: run.bench.load_n,
            told,
            off: 0.0,
            reacted: None,
            since: 0.0,
            regular: 0.0,
            still: 0.0,
            peaks: [0.0; 2],
            plate,
            run,
        })
    }

    /// The event.
    fn begin(&mut self) {
        let run = &mut self.run;
        match self.scenario {
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
    }

    /// What goes on after the event.
    fn act(&mut self) {
        let run = &mut self.run;
        let machine = &mut run.drive.board.machine;
        match self.scenario {
            Scenario::NutSeized => {
                let omega = machine.motor(Axis::Nut).omega;
                let (torque, at) = SEIZED;
                let held = -torque * (omega / at).clamp(-1.0, 1.0);
                machine.set_disturbance_torque(Axis::Nut, held);
            }
            Scenario::LoadStep => {
                let against = (machine.table_velocity() / CUTS_M_S).clamp(-1.0, 1.0);
                run.bench.load_n = self.load_n + 2.0 * rated_n(&self.plate) * against;
            }
            Scenario::MainsDip if self.told.seconds >= DIP_S => {
                run.drive.board.set_supply(self.bus_v);
            }
            _ => {}
        }
    }

    fn period(&mut self) {
        self.run.period();
        let (run, told) = (&self.run, &mut self.told);
        told.seconds += run.period_s;
        for axis in Axis::ALL {
            let amps = run.drive.board.machine.phase_currents(axis);
            let peak = amps.iter().fold(0.0f64, |peak, amps| peak.max(amps.abs()));
            self.peaks[axis.index()] = self.peaks[axis.index()].max(peak);
            told.peak_a = told.peak_a.max(peak);
        }
        told.bus_v = told.bus_v.max(run.drive.board.bus_voltage());
        let x = run.bench.position - self.origin;
        self.look_at_travel(x);
        self.plot(x);
        self.still = if self.run.at_rest() {
            self.still + self.run.period_s
        } else {
            0.0
        };
    }

    fn look_at_travel(&mut self, x: f64) {
        let run = &self.run;
        let stops = run.reacts() || run.drive.state() == State::Stopping;
        match self.reacted {
            None if stops => {
                self.reacted = Some(x);
                if run.drive.state() == State::Stopping {
                    self.regular = stop_m(&self.plate, run.drive.board.machine.table_velocity());
                }
            }
            // A table that falls behind does no harm; one that goes ahead, or back, does.
            // In a start all of it counts.
            None if matches!(self.scenario, Scenario::DeadEncoder(_)) => {
                self.off = self.off.max(x.abs());
            }
            None => {
                let ahead = x - self.point.velocity * self.told.seconds;
                self.off = self.off.max(ahead).max(-x);
            }
            Some(from) => self.since = self.since.max((x - from).abs()),
        }
    }

    fn plot(&mut self, x: f64) {
        let board = &self.run.drive.board;
        let due = self.told.points.len() as f64 * POINT_S;
        if self.told.seconds >= due {
            let rpm = Axis::ALL.map(|axis| board.machine.motor(axis).omega / RPM);
            self.told.points.push(Point {
                seconds: self.told.seconds,
                travel_m: x,
                rpm,
                peak_a: std::mem::take(&mut self.peaks),
                bus_v: board.bus_voltage(),
            });
        }
    }

    fn is_over(&self) -> bool {
        let seconds = self.told.seconds;
        let runs_on = self.reacted.is_none() && seconds > RUNS_ON_S;
        let rests = self.still > 0.05 && !self.run.drive.state().is_driven();
        rests || runs_on || seconds > AFTER_S
    }

    fn story(self) -> Story {
        Story {
            travel_m: self.off + (self.since - self.regular).max(0.0),
            state: self.run.drive.state(),
            end_force_n: self.run.bench.seen.end_force_n,
            ..self.told
        }
    }
}

/// Force of the screw's rated torque, N.
fn rated_n(plate: &DrivePlate) -> f64 {
    let motor = &plate.motors[0];
    let torque =
        f64::from(motor.pole_pairs) * motor.flux_wb * 3f64.sqrt() * motor.thermal.rated_rms_a;
    torque.min(motor.torque_max_nm) * TAU / plate.feed.lead_m
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
