//! What the speed task does: read what the current loops found, step, tell them.

use crate::config::{self, config};
use crate::debug_view::{self, DRIVE_VIEW, count, keep_max};
use crate::hw::analog::Watches;
use crate::hw::cycles;
use crate::hw::deadman;
use crate::hw::encoder::Scale;
use crate::hw::inputs::{FaultLine, Inputs};
use crate::hw::outputs::Output;
use crate::hw::pwm;
use crate::motor_loop::MOTORS;
use crate::orders::{self, ARRIVED, COMMANDED, PLANNED};
use crate::telemetry::Sampler;
use control::compensation::LINES;
use control::coordinator::Command;
use control::fault::Fault;
use control::format::{MechanicalSpeed, TableVelocity};
use control::interlock;
use control::speed_task::SpeedTask;
use control::supervisor::{Demand, Request, State};
use core::sync::atomic::{AtomicBool, AtomicI32, AtomicU32, Ordering::Relaxed};
use cortex_m::peripheral::NVIC;
use stm32g4xx_hal::stm32::Interrupt;

/// Word of the fault that the supervision has found, or 0.
pub(crate) static FOUND: AtomicU32 = AtomicU32::new(0);

/// What each line of the compensation has learned, re and im: see [`control::compensation::Compensation::coefficient`].
pub(crate) static LEARNED: [[AtomicI32; 2]; LINES] =
    [const { [const { AtomicI32::new(0) }; 2] }; LINES];

/// All of them have been shown since the start.
pub(crate) static ALL_LEARNED: AtomicBool = AtomicBool::new(false);

/// The pins of the speed task.
pub(crate) struct Wired {
    pub(crate) inputs: Inputs,
    /// The gate drivers': screw, nut.
    pub(crate) fault_lines: [FaultLine; 2],
    /// Releases the brake.
    pub(crate) brake: Option<Output>,
}

/// What the speed task owns beside its state, which [`config::task`] holds.
pub(crate) struct Speed {
    scale: Scale,
    watches: Watches,
    sampler: Sampler,
    inputs: Inputs,
    fault_lines: [FaultLine; 2],
    brake: Option<Output>,
    taken: u32,
    /// What the view last was told.
    shown: State,
    /// The line that is shown next among the [`LEARNED`].
    line: usize,
}

impl Speed {
    /// The task at rest. Its scale is one, and so there is one speed task.
    pub(crate) fn new(scale: Scale, watches: Watches, sampler: Sampler, pins: &Wired) -> Self {
        // SAFETY: the task does not run yet.
        unsafe { config::task() }.write(SpeedTask::new(config()));
        Self {
            scale,
            watches,
            sampler,
            inputs: pins.inputs,
            fault_lines: pins.fault_lines,
            brake: pins.brake,
            taken: 0,
            shown: State::Boot,
            line: 0,
        }
    }

    /// One step, every `speed_divider`th PWM period.
    #[inline(always)]
    pub(crate) fn step(&mut self) {
        let start = cycles::now();
        let view = &DRIVE_VIEW;
        // SAFETY: written before there was a `Speed`, of which there is one, borrowed for as long.
        let control = unsafe { config::task().assume_init_mut() };
        self.take_command(control);
        let demand = Demand::of_word(COMMANDED.demand.load(Relaxed));
        let scale = self.scale.position();
        let exchanges = MOTORS.each_ref().map(|motor| &motor.exchange);
        let found = match self.watches.take() {
            _ if deadman::has_run_out(demand == Demand::Reset) => Some(Fault::LoopHung),
            None => Fault::of_word(FOUND.load(Relaxed)),
            tripped => tripped,
        };
        // Just before the step, which branches by the same.
        let looks = control.looks_at_inputs();
        let request = Request {
            demand,
            heartbeat: COMMANDED.heartbeat.load(Relaxed),
            inputs: if looks {
                orders::with_way(self.inputs.read())
            } else {
                interlock::Inputs::default()
            },
            scale: config()
                .compensation
                .scale
                .is_some()
                .then_some(scale.cast_unsigned()),
        };
        let mut output = control.step(config(), request, exchanges, found);
        // What need not be before the currents are asked: at 40 kHz the nut's loop takes them in less than half a period.
        if looks {
            self.publish(control);
        }

        // Two looks at one word each, as most steps need no more; whether two states are the same takes longer.
        let runs_on = output.state == State::Running && self.shown == State::Running;
        // In a fault each time: a current loop and the dead-man's interrupt write their own there.
        if !runs_on && (output.state != self.shown || matches!(output.state, State::Fault(_))) {
            let begins = !matches!(self.shown, State::Fault(_));
            if begins && matches!(output.state, State::Fault(_)) {
                let pulled = self.fault_lines.map(FaultLine::is_pulled);
                output.state = control.tell_lines(pulled, pwm::controller_broke());
            }
            self.shown = output.state;
            debug_view::show(output.state);
            let latched = control.latched().words();
            for (word, latched) in view.latched.iter().zip(latched) {
                word.store(latched, Relaxed);
            }
            if let Some(misalignment) = control.misalignment() {
                view.misalignment.store(misalignment.reason.word(), Relaxed);
            }
        }
        if config().compensation.active {
            view.tables
                .store(control.compensation().tables().0, Relaxed);
        }
        view.scale.store(scale, Relaxed);
        if count(&view.speed_steps) & 63 == 0 {
            let limits = control.limits(config(), exchanges);
            view.limits.store(limits.word(), Relaxed);
            self.show_learned(control);
        }
        self.sampler.step(&output, scale);
        if NVIC::is_pending(Interrupt::FMAC) {
            count(&view.speed_missed);
        }
        let spent = cycles::now().wrapping_sub(start);
        view.speed_cycles.store(spent, Relaxed);
        keep_max(&view.speed_cycles_max, spent);
    }

    /// One line of what is learned, the next one each time: all of them every 0.3 s.
    #[inline(never)]
    #[unsafe(link_section = ".ccm.learned")]
    fn show_learned(&mut self, control: &SpeedTask) {
        let Some([re, im]) = LEARNED.get(self.line) else {
            self.line = 0;
            ALL_LEARNED.store(true, Relaxed);
            return;
        };
        let learned = control.compensation().coefficient(self.line);
        re.store(learned.re, Relaxed);
        im.store(learned.im, Relaxed);
        self.line = self.line.wrapping_add(1);
    }

    /// What the supervision sees of the references, and the brake.
    #[inline(always)]
    fn publish(&self, control: &SpeedTask) {
        ARRIVED.store(control.arrived(), Relaxed);
        let (speed, change) = control.planned();
        for (word, value) in PLANNED.iter().zip([speed.to_bits(), change.to_bits()]) {
            word.store(value, Relaxed);
        }
        if let Some(brake) = self.brake {
            brake.switch(control.releases_brake());
        }
    }

    fn take_command(&mut self, control: &mut SpeedTask) {
        let sequence = COMMANDED.sequence.load(Relaxed);
        if sequence == self.taken {
            return;
        }
        self.taken = sequence;
        let command = Command {
            velocity: TableVelocity::from_bits(COMMANDED.velocity.load(Relaxed)),
            base: MechanicalSpeed::from_bits(COMMANDED.base.load(Relaxed)),
        };
        match control.command(config(), command) {
            Ok(()) => count(&DRIVE_VIEW.taken),
            Err(_) => count(&DRIVE_VIEW.refused),
        };
    }
}
