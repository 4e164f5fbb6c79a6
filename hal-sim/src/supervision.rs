//! What the firmware's supervision looks at once a millisecond, and its analog watchdogs at each conversion, on the
//! simulated board: see `firmware/src/supervision.rs` and `hw/analog.rs`. No task is ever late here, and no encoder's channels
//! change together: those are the emulated chip's tests.

use control::current_loop::MotorSample;
use control::fault::Fault;
use control::format::Misfit;
use control::guard::{Guard, GuardConfig, GuardPlate, Look};
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
    found: Option<Fault>,
}

impl Supervision {
    /// Of a board that bears what `plate` says, whose PWM period is so long.
    ///
    /// # Errors
    /// [`Misfit`] naming the limit that the ADC cannot see.
    pub fn new(plate: &GuardPlate, period_s: f64) -> Result<Self, Misfit> {
        Ok(Self {
            guard: Guard::new(),
            config: plate.config()?,
            periods: 0,
            every: (1e-3 / period_s).round().max(1.0) as u32,
            bus: [0; 2],
            bus_past: false,
            found: None,
        })
    }

    /// What was converted for `axis`.
    pub fn converted(&mut self, axis: Axis, sample: &MotorSample) {
        self.bus[axis.index()] = sample.bus;
        self.bus_past |= sample.bus > self.config.bus_most;
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
        }
    }

    /// What the speed task hears of it.
    pub fn take(&mut self) -> Option<Fault> {
        if std::mem::take(&mut self.bus_past) {
            Some(Fault::OverVoltage)
        } else {
            self.found
        }
    }
}
