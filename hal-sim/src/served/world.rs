//! The simulated machine around the application: contacts, brake, load, and the faults that are injected.

use crate::analog::AnalogWatches;
use crate::boards::BoardKind;
use crate::experiment::Setup;
use crate::seam::{Seam, SpeedCall};
use application::burst::Burst;
use application::exchange::{DriveExchange, TelemetryExchange};
use application::speed::{SpeedBoard, SpeedParts, SpeedStep};
use control::current_loop::MotorSample;
use control::encoder::Interface;
use control::exchange::MotorExchange;
use control::fault::Fault;
use control::format::Misfit;
use control::guard::{GuardConfig, GuardPlate};
use control::interlock::Inputs;
use control::plate::{BrakePlate, DrivePlate};
use control::speed_task::SpeedTaskOutput;
use link::view::DriveView;
use plant::Axis;
use plant::machine::Machine;
use plant::model::{Brake, InstallationModel};

/// Heat sinks are at so many degrees Celsius.
const WARM: f64 = 40.0;
/// Bus voltages between which the drive runs, of the supply's.
const BUS: [f64; 2] = [0.2, 1.26];

/// A brake, as it moves.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MovingBrake {
    released: bool,
    /// Time since its command last changed, s.
    seconds: f64,
}

impl MovingBrake {
    /// Some time in which it is commanded to open, or to hold.
    pub(super) fn step(&mut self, release: bool, seconds: f64) {
        self.seconds = if release == self.released {
            self.seconds + seconds
        } else {
            0.0
        };
        self.released = release;
    }

    /// It carries the load: not before it has closed, and until it has opened.
    pub(super) fn holds(&self, brake: &BrakePlate) -> bool {
        if self.released {
            self.seconds < brake.opening_s
        } else {
            self.seconds >= brake.closing_s
        }
    }
}

/// What is around a served drive.
#[derive(Clone, Debug)]
pub(super) struct World {
    pub(super) watches: AnalogWatches,
    /// What is injected of the contacts.
    pub(super) inputs: Inputs,
    /// The table's place, m, by the machine, and where it was switched on.
    position: f64,
    begun: Option<f64>,
    pub(super) brake: MovingBrake,
    /// The drive tells the brake to let go.
    pub(super) releases: bool,
    /// The brake carries the load.
    pub(super) braked: bool,
    /// Against positive travel, N.
    pub(super) load_n: f64,
    installation: InstallationModel,
    /// Indices that were passed since the supervision's last look.
    pub(super) index: [bool; 2],
    /// The words that frozen encoders go on reading.
    pub(super) frozen: [Option<u32>; 2],
    /// What the current channels a read too much, A.
    pub(super) offset_a: [f64; 2],
    pub(super) temperatures: [u16; 2],
}

/// What the guard of a drive of `board` bears with a supply of `bus_v`.
pub(super) fn guards(plate: &DrivePlate, bus_v: f64) -> GuardPlate {
    let board = &plate.board;
    let [least, most] = BUS.map(|part| part * bus_v);
    GuardPlate {
        bus_min_v: least,
        bus_max_v: most,
        bus_volts_per_count: board.bus_volts_per_count,
        adc_counts: board.adc_counts,
        index: plate
            .motors
            .map(|motor| motor.encoder.interface == Interface::IncrementalWithIndex),
        // Its lead and its encoders may not be known yet.
        scale: None,
        ..BoardKind::Mains.guards()
    }
}

impl World {
    /// Around a drive of `plate` on the machine of `setup`.
    pub(super) fn new(plate: &DrivePlate, setup: &Setup) -> Result<Self, Misfit> {
        let guards = guards(plate, setup.board.bus_v);
        let GuardConfig { bus_most, .. } = guards.config()?;
        Ok(Self {
            watches: AnalogWatches::new(plate, bus_most),
            inputs: Inputs::CLEAR,
            position: 0.0,
            begun: None,
            brake: MovingBrake {
                released: false,
                seconds: f64::MAX,
            },
            releases: false,
            braked: true,
            load_n: setup.model.feed.load_n,
            installation: setup.model.installation,
            index: [false; 2],
            frozen: [None; 2],
            offset_a: [0.0; 2],
            temperatures: guards
                .temperatures
                .map(|plate| plate.counts(WARM, guards.adc_counts) as u16),
        })
    }

    /// A period of a drive with the settings `brake`, and drives with both bridges on or does not.
    pub(super) fn hold(&mut self, brake: &BrakePlate, driven: bool, seconds: f64) {
        self.braked = match self.installation.brake {
            Brake::None => false,
            Brake::Ideal if !brake.fitted => !driven,
            Brake::Ideal | Brake::Fitted => {
                self.brake.step(self.releases, seconds);
                self.brake.holds(brake)
            }
        };
    }

    /// The table's place from where it was switched on, m.
    pub(super) fn travel_from_start_m(&self) -> f64 {
        self.position - self.begun.unwrap_or(self.position)
    }

    /// Enable switch and end switches.
    pub(super) fn contacts(&self) -> Inputs {
        let from_middle = self.travel_from_start_m();
        let end = 0.5 * self.installation.travel_m;
        Inputs {
            end_forward: self.inputs.end_forward || from_middle > end,
            end_backward: self.inputs.end_backward || from_middle < -end,
            ..self.inputs
        }
    }
}

/// The world, with the application's step of the speed task.
pub(super) struct Around<'a> {
    pub(super) world: &'a mut World,
    pub(super) step: &'a mut SpeedStep,
    pub(super) words: &'a DriveExchange,
    pub(super) telemetry: &'a TelemetryExchange,
    pub(super) burst: &'a Burst,
    pub(super) view: &'a DriveView,
}

impl Seam for Around<'_> {
    fn machine(&mut self, machine: &mut Machine, _: u32) {
        let world = &mut *self.world;
        world.position = machine.table_position();
        world.begun.get_or_insert(world.position);
        machine.set_load_force(if world.braked { 0.0 } else { world.load_n });
    }

    fn currents(&mut self, axis: Axis, amps: &mut [f64; 3]) {
        amps[0] += self.world.offset_a[axis.index()];
    }

    fn sample(&mut self, axis: Axis, sample: &mut MotorSample) {
        if let Some(word) = self.world.frozen[axis.index()] {
            sample.encoder = word;
        }
        self.world.watches.converted(axis, sample);
    }

    fn looped(&mut self, _: Axis, exchange: &MotorExchange) {
        self.burst.after_period(exchange, self.view);
    }

    fn speed(&mut self, call: SpeedCall<'_>) -> Option<SpeedTaskOutput> {
        let SpeedCall {
            task,
            config,
            motors,
            board,
        } = call;
        let parts = SpeedParts {
            config,
            words: self.words,
            telemetry: self.telemetry,
            view: self.view,
            motors,
        };
        let mut board = SimulatedBoard {
            world: self.world,
            board,
        };
        let mut decided = None;
        self.step
            .step(parts, task, &mut board, |output| decided = Some(*output));
        decided
    }
}

/// What the speed task reads and switches.
struct SimulatedBoard<'a> {
    world: &'a mut World,
    board: &'a mut crate::board::Board,
}

impl SpeedBoard for SimulatedBoard<'_> {
    /// Counts wrap, as those of the chip's timer do.
    fn scale(&mut self) -> i32 {
        self.board.scale_counts() as i32
    }

    fn tripped(&mut self) -> Option<Fault> {
        self.world.watches.take()
    }

    fn loop_hung(&mut self, _: bool) -> bool {
        false
    }

    fn contacts(&mut self) -> Inputs {
        self.world.contacts()
    }

    fn fault_lines(&mut self) -> ([bool; 2], bool) {
        (self.board.fault_lines(), self.board.broken_by_system())
    }

    fn switch_brake(&mut self, release: bool) {
        self.world.releases = release;
    }
}
