//! What a current-loop interrupt does: read, step, write.

use crate::CONFIG;
use crate::debug_view::{DRIVE_COMMAND, DRIVE_VIEW, count, keep_max};
use crate::hw::cycles;
use crate::hw::encoder::Encoder;
use crate::hw::motor_io::MotorIo;
use crate::speed::{EXCHANGE, codes};
use control::current_loop::CurrentLoop;
use control::exchange::Asked;
use control::supervisor::{Fault, State};
use core::ops::Deref;
use core::sync::atomic::Ordering::Relaxed;
use stm32g4xx_hal::stm32::{adc1, tim1};

/// One motor's loop, and its registers. `MOTOR` is its place in the configuration and among the shared words.
pub(crate) struct MotorLoop<const MOTOR: usize, T, X, Y, E> {
    io: MotorIo<T, X, Y, E>,
    control: CurrentLoop,
}

impl<const MOTOR: usize, T, X, Y, E> MotorLoop<MOTOR, T, X, Y, E>
where
    T: Deref<Target = tim1::RegisterBlock>,
    X: Deref<Target = adc1::RegisterBlock>,
    Y: Deref<Target = adc1::RegisterBlock>,
    E: Encoder,
{
    pub(crate) fn new(io: MotorIo<T, X, Y, E>) -> Self {
        Self {
            io,
            control: CurrentLoop::new(&CONFIG.current_loops[MOTOR]),
        }
    }

    /// One PWM period.
    #[inline(always)]
    pub(crate) fn step(&mut self) {
        let start = cycles::now();
        let config = const { &CONFIG.current_loops[MOTOR] };
        let sample = self.io.sample(DRIVE_COMMAND.asks_reset());
        let measured = self.control.measure(config, &sample);
        // Passed on before the second half, which needs the registers that they are in.
        let (view, exchange) = (&DRIVE_VIEW.motors[MOTOR], &EXCHANGE[MOTOR]);
        view.current[0].store(measured.current.d.to_bits(), Relaxed);
        view.current[1].store(measured.current.q.to_bits(), Relaxed);
        view.omega_e
            .store(measured.motion.omega_e.to_bits(), Relaxed);
        view.theta.store(measured.motion.theta.0, Relaxed);

        let Asked { reference, stale } = exchange.asked();
        if stale {
            // The speed task, which says what the drive is doing, cannot.
            let (state, fault) = const { codes(State::Fault(Fault::SpeedTaskLate)) };
            DRIVE_VIEW.state.store(state, Relaxed);
            DRIVE_VIEW.fault.store(fault, Relaxed);
        }
        let (command, estimate) = self.control.act(config, &sample, &measured, reference);
        if !self.io.apply(&command) {
            count(&view.missed);
        }
        if estimate.encoder_wrong {
            count(&DRIVE_VIEW.encoder_wrong[MOTOR]);
        }
        exchange.publish(&estimate, stale);
        count(&view.steps);
        let spent = cycles::now().wrapping_sub(start);
        view.cycles.store(spent, Relaxed);
        keep_max(&view.cycles_max, spent);
    }
}
