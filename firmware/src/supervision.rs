//! Once a millisecond: show what the current loops see, watch the tasks, the bus, the heat sinks and the encoders, feed
//! the watchdog, report.

use crate::board;
use crate::config::{PLATE, configured};
use crate::debug_view::{DRIVE_VIEW, count};
use crate::hw::analog;
use crate::hw::gate_drivers::GateDrivers;
use crate::hw::inputs::Inputs;
use crate::hw::watchdog::Watchdog;
use crate::motor_view;
use crate::orders::{self, COMMANDED};
use crate::speed::FOUND;
use control::fault::{self, Fault, FaultSet};
use control::guard::{Guard, Look};
use control::interlock;
use control::journal::{Journal, Recorder};
use control::power_stage;
use control::supervisor::{Demand, State};
use core::sync::atomic::AtomicU32;
use core::sync::atomic::Ordering::Relaxed;

/// The tasks whose progress feeds the watchdog.
const TASKS: [&str; 3] = ["screw current loop", "nut current loop", "speed task"];

/// The supervision and what it owns.
pub(crate) struct Supervision {
    watchdog: Watchdog<3>,
    guard: Guard,
    inputs: Inputs,
    gate_drivers: GateDrivers,
    /// Looks in a row with a stage that is unpowered.
    unpowered: u32,
    /// What the log was last told of.
    logged: Option<Fault>,
    recorder: Recorder,
}

impl Supervision {
    pub(crate) fn new(watchdog: Watchdog<3>, inputs: Inputs, gate_drivers: GateDrivers) -> Self {
        Self {
            watchdog,
            inputs,
            gate_drivers,
            unpowered: 0,
            guard: Guard::new(),
            logged: None,
            recorder: Recorder::new(),
        }
    }

    /// What the contacts say.
    pub(crate) fn inputs(&self) -> interlock::Inputs {
        self.inputs.read()
    }

    /// One millisecond; `late` if it comes a millisecond late or more, what the contacts say, and what the orders have found.
    pub(crate) fn step(
        &mut self,
        late: bool,
        inputs: interlock::Inputs,
        found: Option<Fault>,
        journal: &mut Journal,
    ) {
        let view = &DRIVE_VIEW;
        count(&view.uptime_ms);
        if late {
            count(&view.supervision_missed);
        }
        motor_view::refresh();
        let found = self.look(inputs, found, journal);
        let [screw, nut] = &view.motors;
        let progress =
            [&screw.steps, &nut.steps, &view.speed_steps].map(|steps| steps.load(Relaxed));
        // One line at most, which takes half of the longest way; what makes no progress says so again.
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

    /// A stage that sleeps or has no supply in two looks, unless the drive itself has put it to sleep.
    fn unpowered(&mut self, asleep: [bool; 2]) -> Option<Fault> {
        /// Least bus of a stage that works, ADC counts.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        const BUS_LEAST: u16 = (PLATE.board.bus_min_v / PLATE.board.bus_volts_per_count) as u16;
        let mut stages = analog::stages();
        for (stage, asleep) in stages.iter_mut().zip(asleep) {
            if asleep {
                stage.current = [u16::MAX; 3];
            }
        }
        let found = power_stage::unpowered(&stages, BUS_LEAST);
        self.unpowered = if found.is_some() {
            self.unpowered.saturating_add(1)
        } else {
            0
        };
        found.filter(|_| self.unpowered > 1)
    }

    /// What was found, in this look or by the orders.
    fn look(
        &mut self,
        inputs: interlock::Inputs,
        found: Option<Fault>,
        journal: &mut Journal,
    ) -> Option<Fault> {
        let view = &DRIVE_VIEW;
        let [screw, nut] = &view.motors;
        let flags = board::take_encoder_flags();
        let words = [&view.state, &view.fault].map(|word| word.load(Relaxed));
        // The speed task may come between the two; a fault of no word is one all the same.
        let state = State::of_words(words[0], words[1]).unwrap_or_default();
        let reset = COMMANDED.demand.load(Relaxed) == Demand::Reset.word();
        let asleep = self.gate_drivers.step(state.fault().is_some(), reset);
        let unpowered = self.unpowered(asleep);
        let look = Look {
            running: motor_view::closed().map(|closed| closed || state.has_bridges_on()),
            driven: state.is_driven(),
            stopped_by: state.fault(),
            missed: [
                &screw.missed,
                &nut.missed,
                &view.speed_missed,
                &view.supervision_missed,
            ]
            .map(|missed| missed.load(Relaxed)),
            bus: analog::bus(),
            supply: analog::supply(),
            temperatures: analog::temperatures(),
            theta: motor_view::angles(),
            enabled: inputs.enabled,
            ends_open: [inputs.end_forward, inputs.end_backward],
            scale: view.scale.load(Relaxed).cast_unsigned(),
            current_sum: motor_view::current_sums(),
            index: flags.map(|flags| flags.index),
            transition_error: flags.map(|flags| flags.transition_error),
        };
        let found = self.guard.step(&configured().guard, &look).or(found);
        let found = unpowered.or(found);
        // A reset waits until the drivers are awake.
        let held = state.fault().filter(|_| asleep.contains(&true));
        FOUND.store(fault::word(found.or(held)), Relaxed);
        // Periods of the supervision's millisecond.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        const PERIODS: u32 = (PLATE.board.pwm_hz * 1e-3 + 0.5) as u32;
        orders::tell_table(self.guard.table_step(PERIODS));
        let latched = view.latched.each_ref().map(|word| word.load(Relaxed));
        self.recorder.look(
            journal,
            view.uptime_ms.load(Relaxed),
            state,
            FaultSet::of_words(latched),
            |fault| self.guard.values(&configured().guard, &look, fault),
        );
        view.supply.store(look.supply.millivolts().into(), Relaxed);
        store(&view.temperatures, look.temperatures.map(u32::from));
        store(&view.bus, look.bus.map(u32::from));
        store(&view.encoder_errors, self.guard.encoder_errors());
        found
    }
}

fn store(words: &[AtomicU32; 2], values: [u32; 2]) {
    for (word, value) in words.iter().zip(values) {
        word.store(value, Relaxed);
    }
}
