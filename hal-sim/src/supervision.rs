//! What the firmware's supervision looks at once a millisecond, and its analog watchdogs at each conversion, on the
//! simulated board, for a drive without an application. No task is ever late here, and no encoder's channels
//! change together: those are the emulated chip's tests.

use crate::analog::AnalogWatches;
use control::current_loop::MotorSample;
use control::fault::Fault;
use control::format::Misfit;
use control::guard::{Guard, GuardConfig, GuardPlate, Look};
use control::plate::{BoardPlate, DrivePlate};
use plant::Axis;

/// The supervision and what it has found.
#[derive(Clone, Debug)]
pub struct Supervision {
    guard: Guard,
    config: GuardConfig,
    watches: AnalogWatches,
    periods: u32,
    every: u32,
    found: Option<Fault>,
    /// What it last looked at.
    look: Look,
}

impl Supervision {
    /// Of a drive of `plate` on a board that bears what `guards` says.
    ///
    /// # Errors
    /// [`Misfit`] naming the limit that the ADC cannot see.
    pub fn new(guards: &GuardPlate, plate: &DrivePlate) -> Result<Self, Misfit> {
        let config = guards.config()?;
        Ok(Self {
            guard: Guard::new(),
            config,
            watches: AnalogWatches::new(plate, config.bus_most),
            periods: 0,
            every: periods_per_ms(&plate.board),
            found: None,
            look: Look::default(),
        })
    }

    /// What was converted for `axis`.
    pub fn converted(&mut self, axis: Axis, sample: &MotorSample) {
        self.watches.converted(axis, sample);
    }

    /// A period has passed; a look each millisecond at what `look` says, whose bus is taken from the conversions.
    pub fn period(&mut self, look: impl FnOnce() -> Look) {
        self.periods += 1;
        if self.periods == self.every {
            self.periods = 0;
            let look = Look {
                bus: self.watches.bus(),
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
            bus: self.watches.bus(),
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
        self.watches.take().or(self.found)
    }
}

/// PWM periods in a millisecond.
#[must_use]
pub fn periods_per_ms(board: &BoardPlate) -> u32 {
    (1e-3 / board.sample_time()).round().max(1.0) as u32
}
