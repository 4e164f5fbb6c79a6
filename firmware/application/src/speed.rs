//! A step of the speed task: commands in, the control's step, state and telemetry out.

use crate::exchange::{DriveExchange, TelemetryExchange, count, show};
use crate::telemetry::Sampler;
use control::coordinator::Command;
use control::exchange::MotorExchange;
use control::fault::Fault;
use control::format::{MechanicalSpeed, TableVelocity};
use control::interlock;
use control::plate::DriveConfig;
use control::speed_task::{SpeedTask, SpeedTaskOutput};
use control::supervisor::{Demand, Request, State};
use core::sync::atomic::Ordering::Relaxed;
use link::view::DriveView;

/// The board, as the speed task needs it.
pub trait SpeedBoard {
    /// The table's scale, counts, which wrap.
    fn scale(&mut self) -> i32;
    /// A fault that the analog watchdogs have found since the last step.
    fn tripped(&mut self) -> Option<Fault>;
    /// A current loop has hung; a reset forgives it.
    fn loop_hung(&mut self, reset: bool) -> bool;
    /// Enable switch and end switches.
    fn contacts(&mut self) -> interlock::Inputs;
    /// The gate drivers say that they have a fault: screw, nut; the controller itself broke the timers.
    fn fault_lines(&mut self) -> ([bool; 2], bool);
    /// Releases or closes the brake.
    fn switch_brake(&mut self, release: bool);
}

/// What the step works on beside its own state.
#[derive(Clone, Copy, Debug)]
pub struct SpeedParts<'a> {
    /// The control's configuration.
    pub config: &'a DriveConfig,
    /// The words between the parts.
    pub words: &'a DriveExchange,
    /// What the lines hear.
    pub telemetry: &'a TelemetryExchange,
    /// The debug view.
    pub view: &'a DriveView,
    /// Screw, nut.
    pub motors: [&'a MotorExchange; 2],
}

/// The step's own state.
#[derive(Clone, Debug)]
pub struct SpeedStep {
    sampler: Sampler,
    taken: u32,
    /// What the view last was told.
    shown: State,
    /// The line that is shown next among those that are learned.
    line: usize,
}

impl SpeedStep {
    /// Of a drive that has not begun.
    #[must_use]
    #[allow(clippy::new_without_default)]
    pub const fn new() -> Self {
        Self {
            sampler: Sampler::new(),
            taken: 0,
            shown: State::Boot,
            line: 0,
        }
    }

    /// One step; `look` sees what the control has decided.
    #[inline(always)]
    pub fn step(
        &mut self,
        parts: SpeedParts<'_>,
        control: &mut SpeedTask,
        board: &mut impl SpeedBoard,
        look: impl FnOnce(&SpeedTaskOutput),
    ) {
        let SpeedParts {
            config,
            words,
            telemetry,
            view,
            motors,
        } = parts;
        let sequence = words.sequence.load(Relaxed);
        if sequence != self.taken {
            self.take_command(parts, control, sequence);
        }
        let demand = Demand::of_word(words.demand.load(Relaxed));
        let scale = board.scale();
        let found = match board.tripped() {
            _ if board.loop_hung(demand == Demand::Reset) => Some(Fault::LoopHung),
            None => words.found(),
            tripped => tripped,
        };
        // Just before the step, which branches by the same.
        let looks = control.looks_at_inputs();
        let request = Request {
            demand,
            heartbeat: words.heartbeat.load(Relaxed),
            inputs: if looks {
                words.with_way(board.contacts())
            } else {
                interlock::Inputs::default()
            },
            scale: (config.alignment.scale != 0).then_some(scale.cast_unsigned()),
        };
        let mut output = control.step(config, request, motors, found);
        // What need not be before the currents are asked: at 40 kHz the nut's loop takes them in less than half a period.
        if looks {
            words.arrived.store(control.arrived(), Relaxed);
            let (speed, change) = control.planned();
            for (word, value) in words
                .planned
                .iter()
                .zip([speed.to_bits(), change.to_bits()])
            {
                word.store(value, Relaxed);
            }
            board.switch_brake(control.releases_brake());
        }

        // Two looks at one word each, as most steps need no more; whether two states are the same takes longer.
        let runs_on = output.state == State::Running && self.shown == State::Running;
        // In a fault each time: a current loop and the dead-man's interrupt write their own there.
        if !runs_on && (output.state != self.shown || matches!(output.state, State::Fault(_))) {
            output.state = self.show_state(view, control, board, output.state);
        }
        if config.compensation.active {
            view.tables
                .store(control.compensation().tables().0, Relaxed);
        }
        view.scale.store(scale, Relaxed);
        if count(&view.speed_steps) & 63 == 0 {
            let limits = control.limits(config, motors);
            view.limits.store(limits.word(), Relaxed);
            self.show_learned(telemetry, control);
        }
        self.sampler
            .step(telemetry, motors, &view.telemetry_dropped, &output, scale);
        look(&output);
    }

    /// Shows a state, and where a fault begins asks the board's lines about it.
    #[inline(always)]
    fn show_state(
        &mut self,
        view: &DriveView,
        control: &mut SpeedTask,
        board: &mut impl SpeedBoard,
        mut state: State,
    ) -> State {
        let begins = !matches!(self.shown, State::Fault(_));
        if begins && matches!(state, State::Fault(_)) {
            let (pulled, broke) = board.fault_lines();
            state = control.tell_lines(pulled, broke);
        }
        self.shown = state;
        show(view, state);
        let latched = control.latched().words();
        for (word, latched) in view.latched.iter().zip(latched) {
            word.store(latched, Relaxed);
        }
        if let Some(misalignment) = control.misalignment() {
            view.misalignment.store(misalignment.reason.word(), Relaxed);
        }
        state
    }

    /// One line of what is learned, the next one each time: all of them every 0.3 s.
    #[inline(never)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    fn show_learned(&mut self, telemetry: &TelemetryExchange, control: &SpeedTask) {
        let Some([re, im]) = telemetry.learned.get(self.line) else {
            self.line = 0;
            telemetry.all_learned.store(true, Relaxed);
            return;
        };
        let learned = control.compensation().coefficient(self.line);
        re.store(learned.re, Relaxed);
        im.store(learned.im, Relaxed);
        if let Some([re, im]) = telemetry.slopes.get(self.line) {
            let per_load = control.compensation().per_load(self.line);
            re.store(per_load.re, Relaxed);
            im.store(per_load.im, Relaxed);
        }
        self.line = self.line.wrapping_add(1);
    }

    /// Takes the new speeds, or the new torque.
    #[inline(always)]
    fn take_command(&mut self, parts: SpeedParts<'_>, control: &mut SpeedTask, sequence: u32) {
        let words = parts.words;
        self.taken = sequence;
        let command = Command {
            velocity: TableVelocity::from_bits(words.velocity.load(Relaxed)),
            base: MechanicalSpeed::from_bits(words.base.load(Relaxed)),
        };
        let config = parts.config;
        let taken = match words.torque() {
            None => control.command(config, command).is_ok(),
            Some(torque) => control.command_torque(config, torque, command.base).is_ok(),
        };
        count(if taken {
            &parts.view.taken
        } else {
            &parts.view.refused
        });
    }
}
