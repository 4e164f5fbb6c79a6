//! Once a millisecond: what the guard sees of tasks, bus, heat sinks and encoders, and what the journal keeps.

use crate::configured::Configured;
use crate::exchange::{DriveExchange, count, state};
use crate::motors;
use control::controller_supply::SupplyReading;
use control::exchange::MotorExchange;
use control::fault::{self, Fault, FaultSet};
use control::guard::{Guard, Look};
use control::interlock;
use control::journal::{Journal, Recorder};
use control::power_stage::{self, StageLook};
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use link::view::DriveView;

/// What the board has read in a millisecond.
#[derive(Clone, Copy, Debug)]
pub struct MillisecondIn {
    /// It comes a millisecond late or more.
    pub late: bool,
    /// Enable switch and end switches.
    pub contacts: interlock::Inputs,
    /// ADC counts of the bus: screw, nut.
    pub bus: [u16; 2],
    /// The controller's own supply.
    pub supply: SupplyReading,
    /// ADC counts of the heat sinks: screw, nut.
    pub temperatures: [u16; 2],
    /// An encoder's index was seen: screw, nut.
    pub index: [bool; 2],
    /// An encoder's two channels changed together: screw, nut.
    pub transition_error: [bool; 2],
    /// The power stages: screw, nut.
    pub stages: [StageLook; 2],
    /// The drive itself holds that stage's driver asleep: screw, nut.
    pub asleep: [bool; 2],
}

/// What the supervision works on beside its own state.
#[derive(Clone, Copy, Debug)]
pub struct SuperviseParts<'a> {
    /// What the drive runs on.
    pub configured: &'a Configured,
    /// The words between the parts.
    pub words: &'a DriveExchange,
    /// The debug view.
    pub view: &'a DriveView,
    /// Screw, nut.
    pub motors: [&'a MotorExchange; 2],
}

/// The supervision's own state.
#[derive(Clone, Debug)]
pub struct Supervise {
    guard: Guard,
    recorder: Recorder,
    /// Looks in a row with a stage that is unpowered.
    unpowered: u32,
    /// Smallest bus of a stage that works, ADC counts.
    bus_least: u16,
    /// PWM periods in a millisecond.
    periods: u32,
}

impl Supervise {
    /// Of a drive on that board.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub fn new(configured: &Configured) -> Self {
        let (board, bridge) = (&configured.plate.board, &configured.plate.bridge);
        Self {
            guard: Guard::new(),
            recorder: Recorder::new(),
            unpowered: 0,
            bus_least: (bridge.bus_min_v / board.bus_volts_per_count) as u16,
            periods: (board.pwm_hz * 1e-3 + 0.5) as u32,
        }
    }

    /// One millisecond; `past` is what the orders have found. Gives the fault that is there.
    pub fn step(
        &mut self,
        parts: SuperviseParts<'_>,
        input: &MillisecondIn,
        past: Option<Fault>,
        journal: &mut Journal,
    ) -> Option<Fault> {
        let SuperviseParts {
            configured,
            words,
            view,
            motors,
        } = parts;
        let uptime_ms = count(&view.uptime_ms);
        if input.late {
            count(&view.supervision_missed);
        }
        motors::refresh(view, motors, &configured.drive);
        let state = state(view);
        let [screw, nut] = &view.motors;
        let look = Look {
            running: motors.map(|motor| motor.is_closed() || state.has_bridges_on()),
            driven: state.is_driven(),
            stopped_by: state.fault(),
            missed: [
                &screw.missed,
                &nut.missed,
                &view.speed_missed,
                &view.supervision_missed,
            ]
            .map(|missed| missed.load(Relaxed)),
            bus: input.bus,
            supply: input.supply,
            temperatures: input.temperatures,
            theta: motors::angles(motors, &configured.drive),
            torque: motors::asked_torques(motors, &configured.drive),
            enabled: input.contacts.enabled,
            ends_open: [input.contacts.end_forward, input.contacts.end_backward],
            scale: view.scale.load(Relaxed).cast_unsigned(),
            current_sum: motors::current_sums(motors, &configured.drive),
            index: input.index,
            transition_error: input.transition_error,
        };
        let found = self.guard.step(&configured.guard, &look).or(past);
        let found = self.unpowered(input).or(found);
        // A reset waits until the drivers are awake.
        let held = state.fault().filter(|_| input.asleep.contains(&true));
        words.found.store(fault::word(found.or(held)), Relaxed);
        words.tell_table(self.guard.table_step(self.periods));
        let latched = view.latched.each_ref().map(|word| word.load(Relaxed));
        self.recorder.look(
            journal,
            uptime_ms,
            state,
            FaultSet::of_words(latched),
            |fault| self.guard.values(&configured.guard, &look, fault),
        );
        view.supply.store(look.supply.millivolts().into(), Relaxed);
        store(&view.temperatures, look.temperatures.map(u32::from));
        store(&view.bus, look.bus.map(u32::from));
        store(&view.encoder_errors, self.guard.encoder_errors());
        found
    }

    /// A stage that sleeps or has no supply in two looks, unless the drive itself has put it to sleep.
    fn unpowered(&mut self, input: &MillisecondIn) -> Option<Fault> {
        let mut stages = input.stages;
        for (stage, asleep) in stages.iter_mut().zip(input.asleep) {
            if asleep {
                stage.current = [u16::MAX; 3];
            }
        }
        let found = power_stage::unpowered(&stages, self.bus_least);
        self.unpowered = if found.is_some() {
            self.unpowered.saturating_add(1)
        } else {
            0
        };
        found.filter(|_| self.unpowered > 1)
    }
}

fn store(words: &[AtomicU32; 2], values: [u32; 2]) {
    for (word, value) in words.iter().zip(values) {
        word.store(value, Relaxed);
    }
}
