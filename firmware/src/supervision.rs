//! Once a millisecond: the application looks at what the board has read; the watchdog is fed; the log hears of faults.

use crate::board;
use crate::config::{configured, words};
use crate::debug_view::DRIVE_VIEW;
use crate::hw::analog;
use crate::hw::gate_drivers::GateDrivers;
use crate::hw::inputs::Inputs;
use crate::hw::watchdog::Watchdog;
use crate::motor_loop::{MOTORS, exchanges};
use application::exchange::state;
use application::orders::Orders;
use application::supervise::{MillisecondIn, Supervise, SuperviseParts};
use control::fault::Fault;
use control::interlock;
use control::journal::Journal;
use core::sync::atomic::Ordering::Relaxed;

/// The tasks whose progress feeds the watchdog.
const TASKS: [&str; 3] = ["screw current loop", "nut current loop", "speed task"];

/// The supervision and what it owns.
pub(crate) struct Supervision {
    watchdog: Watchdog<3>,
    inputs: Inputs,
    gate_drivers: GateDrivers,
    supervise: Supervise,
    /// What the log was last told of.
    logged: Option<Fault>,
}

impl Supervision {
    pub(crate) fn new(watchdog: Watchdog<3>, inputs: Inputs, gate_drivers: GateDrivers) -> Self {
        Self {
            watchdog,
            inputs,
            gate_drivers,
            supervise: Supervise::new(configured()),
            logged: None,
        }
    }

    /// What the contacts say.
    pub(crate) fn inputs(&self) -> interlock::Inputs {
        self.inputs.read()
    }

    /// What the orders find at these contacts.
    pub(crate) fn order(orders: &mut Orders, contacts: interlock::Inputs) -> Option<Fault> {
        orders.step(configured(), words(), &DRIVE_VIEW, contacts)
    }

    /// One millisecond; `late` if it comes a millisecond late or more, what the contacts say, and what the orders have found.
    pub(crate) fn step(
        &mut self,
        late: bool,
        contacts: interlock::Inputs,
        past: Option<Fault>,
        journal: &mut Journal,
    ) {
        let view = &DRIVE_VIEW;
        for (shown, motor) in view.motors.iter().zip(&MOTORS) {
            shown.cycles.store(motor.cycles.load(Relaxed), Relaxed);
            let longest = motor.cycles_max.load(Relaxed);
            shown.cycles_max.store(longest, Relaxed);
        }
        let flags = board::take_encoder_flags();
        let fault = state(view).fault().is_some();
        let asleep = self.gate_drivers.step(fault, words().is_reset());
        let input = MillisecondIn {
            late,
            contacts,
            bus: analog::bus(),
            supply: analog::supply(),
            temperatures: analog::temperatures(),
            index: flags.map(|flags| flags.index),
            transition_error: flags.map(|flags| flags.transition_error),
            stages: analog::stages(),
            asleep,
        };
        let parts = SuperviseParts {
            configured: configured(),
            words: words(),
            view,
            motors: exchanges(),
        };
        let found = self.supervise.step(parts, &input, past, journal);
        let [screw, nut] = &view.motors;
        let progress =
            [&screw.steps, &nut.steps, &view.speed_steps].map(|steps| steps.load(Relaxed));
        // One line at most, which takes half of the longest way; what makes no progress reports it again.
        let fed = self.watchdog.feed(progress);
        if found != self.logged {
            self.logged = found;
            if let Some(fault) = found {
                defmt::error!("{=str}", fault.sentence());
            }
        } else if let Err(task) = fed {
            defmt::error!("no progress in a millisecond: {=str}", TASKS[task]);
        }
    }
}
