//! What a current-loop interrupt does: [`CurrentLoop::period`] on the motor's registers, timed.

use crate::CONFIG;
use crate::debug_view::{self, keep_max};
use crate::hw::cycles;
use crate::hw::encoder::Encoder;
use crate::hw::motor_io::Registers;
use control::current_loop::CurrentLoop;
use control::exchange::MotorExchange;
use control::fault::Fault;
use control::supervisor::State;
use core::ops::Deref;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use stm32g4xx_hal::stm32::{adc1, tim1};

/// What a current loop tells the tasks below it: all in one place, so that one address in a register serves.
pub(crate) struct MotorShared {
    /// With the speed task.
    pub(crate) exchange: MotorExchange,
    /// Cycles of the last period.
    pub(crate) cycles: AtomicU32,
    /// Cycles of the longest.
    pub(crate) cycles_max: AtomicU32,
}

impl MotorShared {
    const fn new(motor: usize) -> Self {
        Self {
            exchange: MotorExchange::new(&CONFIG.current_loops[motor], CONFIG.speed_divider),
            cycles: AtomicU32::new(0),
            cycles_max: AtomicU32::new(0),
        }
    }
}

/// Screw, nut.
pub(crate) static MOTORS: [MotorShared; 2] = [MotorShared::new(0), MotorShared::new(1)];

/// One motor's loop, and its registers. `MOTOR` is its place in the configuration and among the shared words.
pub(crate) struct MotorLoop<const MOTOR: usize, T, X, Y, E> {
    registers: Registers<T, X, Y, E>,
    control: CurrentLoop,
}

impl<const MOTOR: usize, T, X, Y, E> MotorLoop<MOTOR, T, X, Y, E>
where
    T: Deref<Target = tim1::RegisterBlock>,
    X: Deref<Target = adc1::RegisterBlock>,
    Y: Deref<Target = adc1::RegisterBlock>,
    E: Encoder,
{
    pub(crate) fn new(registers: Registers<T, X, Y, E>) -> Self {
        Self {
            registers,
            control: CurrentLoop::new(&CONFIG.current_loops[MOTOR]),
        }
    }

    /// One PWM period.
    #[inline(always)]
    pub(crate) fn step(&mut self) {
        let start = cycles::now();
        let (config, shared) = (const { &CONFIG.current_loops[MOTOR] }, &MOTORS[MOTOR]);
        self.control
            .period(config, &mut self.registers, &shared.exchange, say_stale);
        let spent = cycles::now().wrapping_sub(start);
        shared.cycles.store(spent, Relaxed);
        keep_max(&shared.cycles_max, spent);
    }
}

/// The speed task, which says what the drive is doing, cannot.
fn say_stale() {
    debug_view::show(State::Fault(Fault::SpeedTaskLate));
}
