//! What is around a simulated drive: its inputs and supervision, a brake, and the faults that are put in.

use crate::boards::BoardKind;
use crate::seam::Seam;
use crate::supervision::Supervision;
use control::current_loop::MotorSample;
use control::fault::Fault;
use control::format::Misfit;
use control::guard::GuardPlate;
use control::interlock::Inputs;
use control::plate::{BoardPlate, BrakePlate};
use control::supervisor::Request;
use control::travel::TravelSeen;
use plant::Axis;
use plant::machine::Machine;

/// Heat sinks are at so many degrees Celsius.
const WARM: f64 = 40.0;
/// Where the end switches are, to either side of where the table is switched on, m.
const ENDS_M: f64 = 0.1;
/// Bus voltages between which the drive runs, of the supply's.
const BUS: [f64; 2] = [0.2, 1.26];

/// A brake, as it moves.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MovingBrake {
    released: bool,
    /// Since it was told what it is told, s.
    seconds: f64,
}

impl MovingBrake {
    /// Some time in which it is told to let go, or to hold.
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

/// The seam of a served drive.
#[derive(Clone, Debug)]
pub(super) struct World {
    pub(super) supervision: Supervision,
    /// What is put in of the contacts, and what the orders say of the table's way.
    pub(super) inputs: Inputs,
    /// The table's place, m, by the machine, and where it was switched on.
    position: f64,
    begun: Option<f64>,
    /// The table is past its soft limit.
    past: Option<Fault>,
    pub(super) brake: MovingBrake,
    /// The brake carries the load.
    pub(super) braked: bool,
    /// Against positive travel, N.
    pub(super) load_n: f64,
    /// The words that frozen encoders go on reading.
    pub(super) frozen: [Option<u32>; 2],
    /// What the current channels a read too much, A.
    pub(super) offset_a: [f64; 2],
    pub(super) temperatures: [u16; 2],
}

impl World {
    /// Around a drive of `board` with a supply of `bus_v` and a load of `load_n`.
    pub(super) fn new(board: &BoardPlate, bus_v: f64, load_n: f64) -> Result<Self, Misfit> {
        let mains = BoardKind::Mains.guards();
        let [least, most] = BUS.map(|part| part * bus_v);
        let guards = GuardPlate {
            bus_min_v: least,
            bus_max_v: most,
            bus_volts_per_count: board.bus_volts_per_count,
            adc_counts: board.adc_counts,
            index: [false; 2],
            // Its lead and its encoders may not be known yet.
            scale: None,
            ..mains
        };
        Ok(Self {
            supervision: Supervision::new(&guards, board)?,
            inputs: Inputs::CLEAR,
            position: 0.0,
            begun: None,
            past: None,
            brake: MovingBrake {
                released: false,
                seconds: f64::MAX,
            },
            braked: true,
            load_n,
            frozen: [None; 2],
            offset_a: [0.0; 2],
            temperatures: guards
                .temperatures
                .map(|plate| plate.counts(WARM, board.adc_counts) as u16),
        })
    }
}

impl World {
    /// The end switches are open: ahead of positive velocity, and of negative.
    pub(super) fn ends_open(&self) -> [bool; 2] {
        let from_middle = self.position - self.begun.unwrap_or(self.position);
        [
            self.inputs.end_forward || from_middle > ENDS_M,
            self.inputs.end_backward || from_middle < -ENDS_M,
        ]
    }

    /// What the orders say of the table's way.
    pub(super) fn travel(&mut self, seen: TravelSeen, homing: [bool; 2]) {
        self.inputs.blocked = seen.blocked;
        self.inputs.homing = homing;
        self.past = seen.fault;
    }
}

impl Seam for World {
    fn machine(&mut self, machine: &mut Machine, _: u32) {
        self.position = machine.table_position();
        self.begun.get_or_insert(self.position);
        machine.set_load_force(if self.braked { 0.0 } else { self.load_n });
    }

    fn currents(&mut self, axis: Axis, amps: &mut [f64; 3]) {
        amps[0] += self.offset_a[axis.index()];
    }

    fn sample(&mut self, axis: Axis, sample: &mut MotorSample) {
        if let Some(word) = self.frozen[axis.index()] {
            sample.encoder = word;
        }
        self.supervision.converted(axis, sample);
    }

    fn request(&mut self, request: &mut Request) {
        let [end_forward, end_backward] = self.ends_open();
        request.inputs = Inputs {
            end_forward,
            end_backward,
            table_step: self.supervision.table_step(),
            ..self.inputs
        };
    }

    fn found(&mut self) -> Option<Fault> {
        self.supervision.take().or(self.past)
    }
}
