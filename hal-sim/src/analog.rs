//! The ADCs' analog watchdogs on the simulated board: see `firmware/src/hw/analog.rs`.

use control::current_loop::MotorSample;
use control::fault::Fault;
use control::plate::DrivePlate;
use control::sense::Shunts;
use plant::Axis;

/// Limits of conversions, and those that were past one.
#[derive(Clone, Debug)]
pub struct AnalogWatches {
    /// Counts of the bus voltage at each bridge, as last converted.
    bus: [u16; 2],
    /// Most counts of the bus.
    bus_most: u16,
    /// The bus was above its limit since this was last asked.
    bus_past: bool,
    /// The same of a current of screw or nut.
    currents_past: [bool; 2],
    /// Minimum and maximum counts of a current.
    currents: [u16; 2],
    /// Channels of a motor.
    channels: usize,
}

impl AnalogWatches {
    /// Of a drive of `plate` whose bus may have `bus_most` counts.
    #[must_use]
    pub fn new(plate: &DrivePlate, bus_most: u16) -> Self {
        let (board, most) = (&plate.board, plate.bridge.over_current_a);
        let counts = |amps: f64| board.zero_counts + amps / board.amps_per_count;
        let ends = [-most, most].map(counts);
        Self {
            bus: [0; 2],
            bus_most,
            bus_past: false,
            currents_past: [false; 2],
            currents: [ends[0].min(ends[1]) as u16, ends[0].max(ends[1]) as u16],
            channels: match board.shunts {
                Shunts::Two => 2,
                Shunts::Three => 3,
            },
        }
    }

    /// What was converted for `axis`.
    pub fn converted(&mut self, axis: Axis, sample: &MotorSample) {
        self.bus[axis.index()] = sample.bus;
        self.bus_past |= sample.bus > self.bus_most;
        let [least, most] = self.currents;
        let past = |counts: &u16| *counts < least || *counts > most;
        self.currents_past[axis.index()] |= sample.current[..self.channels].iter().any(past);
    }

    /// Counts of the bus voltage at each bridge.
    #[must_use]
    pub fn bus(&self) -> [u16; 2] {
        self.bus
    }

    /// What was past its limit since this was last asked.
    pub fn take(&mut self) -> Option<Fault> {
        let [screw, nut] = std::mem::take(&mut self.currents_past);
        if std::mem::take(&mut self.bus_past) {
            Some(Fault::OverVoltage)
        } else if screw {
            Some(Fault::ScrewOverCurrent)
        } else if nut {
            Some(Fault::NutOverCurrent)
        } else {
            None
        }
    }
}
