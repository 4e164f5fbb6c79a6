//! The speed task's interrupt: the application's step on this board, timed.

use crate::board::Pins;
use crate::config::{self, config};
use crate::debug_view::{DRIVE_VIEW, count, keep_max};
use crate::hw::analog::Watches;
use crate::hw::cycles;
use crate::hw::deadman::Deadman;
use crate::hw::encoder::Scale;
use crate::hw::inputs::{FaultLine, Inputs};
use crate::hw::outputs::Output;
use crate::hw::pwm;
use crate::lines::TELEMETRY;
use crate::motor_loop::exchanges;
use application::speed::{SpeedBoard, SpeedParts, SpeedStep};
use control::fault::Fault;
use control::interlock;
use control::speed_task::SpeedTask;
use core::sync::atomic::Ordering::Relaxed;
use cortex_m::peripheral::NVIC;
use stm32g4xx_hal::stm32::Interrupt;

/// The pins of the speed task.
pub(crate) struct Wired {
    inputs: Inputs,
    /// The gate drivers': screw, nut.
    fault_lines: [FaultLine; 2],
    /// Releases the brake.
    brake: Option<Output>,
}

/// What the speed task owns of the board.
struct Own {
    scale: Scale,
    watches: Watches,
    wired: Wired,
}

/// What the speed task reads and switches.
struct Board<'a> {
    own: &'a mut Own,
    deadman: &'a Deadman,
}

impl Wired {
    /// Of the board's pins.
    pub(crate) fn of(pins: &Pins) -> Self {
        Self {
            inputs: pins.inputs,
            fault_lines: pins.fault_lines,
            brake: pins.outputs.brake,
        }
    }
}

impl SpeedBoard for Board<'_> {
    #[inline(always)]
    fn scale(&mut self) -> i32 {
        self.own.scale.position()
    }

    #[inline(always)]
    fn tripped(&mut self) -> Option<Fault> {
        self.own.watches.take()
    }

    #[inline(always)]
    fn loop_hung(&mut self, reset: bool) -> bool {
        self.deadman.has_run_out(reset)
    }

    #[inline(always)]
    fn contacts(&mut self) -> interlock::Inputs {
        self.own.wired.inputs.read()
    }

    #[inline(always)]
    fn fault_lines(&mut self) -> ([bool; 2], bool) {
        let pulled = self.own.wired.fault_lines.map(FaultLine::is_pulled);
        (pulled, pwm::controller_broke())
    }

    #[inline(always)]
    fn switch_brake(&mut self, release: bool) {
        if let Some(brake) = self.own.wired.brake {
            brake.switch(release);
        }
    }
}

/// What the speed task owns beside the control's state, which [`config::task`] holds.
pub(crate) struct Speed {
    own: Own,
    step: SpeedStep,
}

impl Speed {
    /// The task at rest. Its scale is one, and so there is one speed task.
    pub(crate) fn new(scale: Scale, watches: Watches, wired: Wired) -> Self {
        // SAFETY: the task does not run yet.
        unsafe { config::task() }.write(SpeedTask::new(config()));
        Self {
            own: Own {
                scale,
                watches,
                wired,
            },
            step: SpeedStep::new(),
        }
    }

    /// One step, every `speed_divider`th PWM period.
    #[inline(always)]
    pub(crate) fn step(&mut self, deadman: &Deadman) {
        let start = cycles::now();
        let view = &DRIVE_VIEW;
        // SAFETY: written before there was a `Speed`, of which there is one, borrowed for as long.
        let control = unsafe { config::task().assume_init_mut() };
        let parts = SpeedParts {
            config: config(),
            words: config::words(),
            telemetry: &TELEMETRY,
            view,
            motors: exchanges(),
        };
        let mut board = Board {
            own: &mut self.own,
            deadman,
        };
        self.step.step(parts, control, &mut board, |_| ());
        if NVIC::is_pending(Interrupt::FMAC) {
            count(&view.speed_missed);
        }
        let spent = cycles::now().wrapping_sub(start);
        view.speed_cycles.store(spent, Relaxed);
        keep_max(&view.speed_cycles_max, spent);
    }
}
