//! What the firmware's supervision looks at once a millisecond, and its analog watchdogs at each conversion, on the
//! simulated board: see `firmware/src/supervision.rs` and `hw/analog.rs`. No task is ever late here, and no encoder's channels
//! change together: those are the emulated chip's tests.

use control::current_loop::MotorSample;
use control::fault::Fault;
use control::format::Misfit;
use control::guard::{Guard, GuardConfig, GuardPlate, Look};
use control::plate::BoardPlate;
use control::sense::Shunts;
use plant::Axis;

/// The supervision and what it has found.
#[derive(Clone, Debug)]
pub struct Supervision {
    guard: Guard,
    config: GuardConfig,
    periods: u32,
    every: u32,
    bus: [u16; 2],
    /// A conversion of the bus was above its limit since this was last asked.
    bus_past: bool,
    /// The same of a current of screw or nut.
    currents_past: [bool; 2],
    /// Least and most counts of a current.
    currents: [u16; 2],
    /// Channels of a motor.
    channels: usize,
    found: Option<Fault>,
    /// What it last looked at.
    look: Look,
}

impl Supervision {
    /// Of a board that bears what `guards` says.
    ///
    /// # Errors
    /// [`Misfit`] naming the limit that the ADC cannot see.
    pub fn new(guards: &GuardPlate, board: &BoardPlate) -> Result<Self, Misfit> {
        let counts = |amps: f64| board.zero_counts + amps / board.amps_per_count;
        let ends = [-board.over_current_a, board.over_current_a].map(counts);
        Ok(Self {
            guard: Guard::new(),
            config: guards.config()?,
            periods: 0,
            every: (1e-3 / board.sample_time()).round().max(1.0) as u32,
            bus: [0; 2],
            bus_past: false,
            currents_past: [false; 2],
            currents: [ends[0].min(ends[1]) as u16, ends[0].max(ends[1]) as u16],
            channels: match board.shunts {
                Shunts::Two => 2,
                Shunts::Three => 3,
            },
            found: None,
            look: Look::default(),
        })
    }

    /// What was converted for `axis`.
    pub fn converted(&mut self, axis: Axis, sample: &MotorSample) {
        self.bus[axis.index()] = sample.bus;
        self.bus_past |= sample.bus > self.config.bus_most;
        let [least, most] = self.currents;
        let past = |counts: &u16| *counts < least || *counts > most;
        self.currents_past[axis.index()] |= sample.current[..self.channels].iter().any(past);
    }

    /// A period has passed; a look each millisecond at what `look` says, whose bus is taken from the conversions.
    pub fn period(&mut self, look: impl FnOnce() -> Look) {
        self.periods += 1;
        if self.periods == self.every {
            self.periods = 0;
            let look = Look {
                bus: self.bus,
                ..look()
            };
            self.found = self.guard.step(&self.config, &look);
            self.look = look;
        }
    }

    /// What is known of a fault: its value and its limit. The bus is the last that was converted, which may have ended the drive
    /// before the next look.
    #[must_use]
    pub fn values(&self, fault: Fault) -> [i32; 2] {
        let look = Look {
            bus: self.bus,
            ..self.look
        };
        self.guard.values(&self.config, &look, fault)
    }

    /// What the table moves in a period by its scale, as a turn of screw against nut, 2^-32 turn.
    #[must_use]
    pub fn table_step(&self) -> Option<i32> {
        self.guard.table_step(self.every)
    }

    /// What the speed task hears of it.
    pub fn take(&mut self) -> Option<Fault> {
        let [screw, nut] = std::mem::take(&mut self.currents_past);
        if std::mem::take(&mut self.bus_past) {
            Some(Fault::OverVoltage)
        } else if screw {
            Some(Fault::ScrewOverCurrent)
        } else if nut {
            Some(Fault::NutOverCurrent)
        } else {
            self.found
        }
    }
}
