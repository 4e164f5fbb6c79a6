//! What a current-loop interrupt does: [`CurrentLoop::period`] on the motor's registers, timed.

use crate::config::{BOARD, config};
use crate::debug_view::{DRIVE_VIEW, keep_max};
use crate::hw::cycles;
use crate::hw::encoder::Encoder;
use crate::hw::motor_io::Registers;
use application::burst::Burst;
use application::exchange::show;
use control::current_loop::{CurrentLoop, CurrentLoopConfig};
use control::exchange::MotorExchange;
use control::fault::Fault;
use control::supervisor::State;
use core::cell::UnsafeCell;
use core::ops::Deref;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use stm32g4xx_hal::stm32::{adc1, tim1};

/// All that a current loop reads and writes in memory, in one place, so that one address in a register serves. A loop whose task has its
/// own in a `#[local]` takes 12 cycles more.
pub(crate) struct Motor {
    /// With the speed task.
    pub(crate) exchange: MotorExchange,
    /// Cycles of the last period.
    pub(crate) cycles: AtomicU32,
    /// Cycles of the longest.
    pub(crate) cycles_max: AtomicU32,
    /// The loop's own: its configuration and its state.
    own: UnsafeCell<(CurrentLoopConfig, CurrentLoop)>,
}

// SAFETY: what is in the cell is its `MotorLoop`'s alone, of which there is one.
unsafe impl Sync for Motor {}

impl Motor {
    const fn new(motor: usize) -> Self {
        let config = &BOARD.drive.current_loops[motor];
        Self {
            exchange: MotorExchange::new(config, BOARD.drive.speed_divider),
            cycles: AtomicU32::new(0),
            cycles_max: AtomicU32::new(0),
            own: UnsafeCell::new((*config, CurrentLoop::new(config))),
        }
    }
}

/// Screw, nut.
///
/// A static, for its address is a constant to the loops: by a reference that RTIC holds both take 12 cycles more. As `Shared` by value it
/// would be copied with the timers running, which takes longer than half a period of 40 kHz.
pub(crate) static MOTORS: [Motor; 2] = [Motor::new(0), Motor::new(1)];

/// The words of both with the speed task.
#[inline(always)]
pub(crate) fn exchanges() -> [&'static MotorExchange; 2] {
    MOTORS.each_ref().map(|motor| &motor.exchange)
}

/// One motor's loop, and its registers. `MOTOR` is its place in the configuration and among the [`MOTORS`].
pub(crate) struct MotorLoop<const MOTOR: usize, T, X, Y, E> {
    registers: Registers<T, X, Y, E>,
    burst: &'static Burst,
}

impl<const MOTOR: usize, T, X, Y, E> MotorLoop<MOTOR, T, X, Y, E>
where
    T: Deref<Target = tim1::RegisterBlock>,
    X: Deref<Target = adc1::RegisterBlock>,
    Y: Deref<Target = adc1::RegisterBlock>,
    E: Encoder,
{
    /// A loop at rest, as it is configured. The registers are of one motor, and so there is one loop for it.
    /// `burst` keeps its periods where one is armed.
    pub(crate) fn new(registers: Registers<T, X, Y, E>, burst: &'static Burst) -> Self {
        let config = &config().current_loops[MOTOR];
        let motor = &MOTORS[MOTOR];
        motor.exchange.start(config);
        // SAFETY: nobody reads it but the loop that this makes.
        unsafe { motor.own.get().write((*config, CurrentLoop::new(config))) };
        Self { registers, burst }
    }

    /// One PWM period.
    #[inline(always)]
    pub(crate) fn step(&mut self) {
        let start = cycles::now();
        let motor = &MOTORS[MOTOR];
        // SAFETY: it is this loop's alone, which is borrowed for as long.
        let (config, control) = unsafe { &mut *motor.own.get() };
        control.period(config, &mut self.registers, &motor.exchange, say_stale);
        self.burst.after_period(&motor.exchange, &DRIVE_VIEW);
        let spent = cycles::now().wrapping_sub(start);
        motor.cycles.store(spent, Relaxed);
        keep_max(&motor.cycles_max, spent);
    }
}

/// The speed task, which says what the drive is doing, cannot.
fn say_stale() {
    show(&DRIVE_VIEW, State::Fault(Fault::SpeedTaskLate));
}
