//! What the speed task does: read what the current loops found, step, tell them.

use crate::CONFIG;
use crate::debug_view::{DRIVE_COMMAND, DRIVE_VIEW, count, keep_max};
use crate::hw::cycles;
use crate::hw::encoder::Scale;
use crate::motor_loop::MOTORS;
use control::coordinator::Command;
use control::format::{MechanicalSpeed, TableVelocity};
use control::speed_task::SpeedTask;
use control::supervisor::{Fault, Request, State};
use core::sync::atomic::Ordering::Relaxed;

/// The speed task and what it owns.
pub(crate) struct Speed {
    control: SpeedTask,
    scale: Scale,
    taken: u32,
}

impl Speed {
    pub(crate) fn new(scale: Scale) -> Self {
        Self {
            control: SpeedTask::new(),
            scale,
            taken: 0,
        }
    }

    /// One step, every `speed_divider`th PWM period.
    #[inline(always)]
    pub(crate) fn step(&mut self) {
        let start = cycles::now();
        let view = &DRIVE_VIEW;
        self.take_command();
        let request = Request {
            run: DRIVE_COMMAND.asks_run(),
            reset: DRIVE_COMMAND.asks_reset(),
        };
        let [screw, nut] = MOTORS.each_ref().map(|motor| &motor.exchange);
        let output = self
            .control
            .step(&CONFIG, request, [screw.status(), nut.status()]);
        let [to_screw, to_nut] = output.current;
        let [screw_loop, nut_loop] = const { &CONFIG.current_loops };
        screw.ask(to_screw, screw_loop);
        nut.ask(to_nut, nut_loop);

        let (state, fault) = codes(output.state);
        view.state.store(state, Relaxed);
        view.fault.store(fault, Relaxed);
        view.scale.store(self.scale.position(), Relaxed);
        count(&view.speed_steps);
        let spent = cycles::now().wrapping_sub(start);
        view.speed_cycles.store(spent, Relaxed);
        keep_max(&view.speed_cycles_max, spent);
    }

    fn take_command(&mut self) {
        let sequence = DRIVE_COMMAND.sequence.load(Relaxed);
        if sequence == self.taken {
            return;
        }
        self.taken = sequence;
        let command = Command {
            velocity: TableVelocity::from_bits(DRIVE_COMMAND.velocity.load(Relaxed)),
            base: MechanicalSpeed::from_bits(DRIVE_COMMAND.base.load(Relaxed)),
        };
        if self.control.command(&CONFIG, command).is_err() {
            count(&DRIVE_VIEW.refused);
        }
    }
}

/// The state's and the fault's numbers in the debug view.
pub(crate) const fn codes(state: State) -> (u32, u32) {
    match state {
        State::Off => (0, 0),
        State::Calibrating => (1, 0),
        State::Ready => (2, 0),
        State::Running => (3, 0),
        State::Stopping => (4, 0),
        State::Fault(fault) => (5, fault_code(fault)),
    }
}

/// The number of a fault in the debug view.
const fn fault_code(fault: Fault) -> u32 {
    match fault {
        Fault::ScrewBreak => 1,
        Fault::NutBreak => 2,
        Fault::ScrewCurrentZero => 3,
        Fault::NutCurrentZero => 4,
        Fault::ScrewEncoder => 5,
        Fault::NutEncoder => 6,
        Fault::SpeedTaskLate => 7,
    }
}
