//! What a current-loop interrupt does: read, step, write.

use crate::CONFIG;
use crate::debug_view::{DRIVE_COMMAND, DRIVE_VIEW, codes, count, keep_max};
use crate::hw::cycles;
use crate::hw::motor_io::MotorIo;
use crate::speed::EXCHANGE;
use control::current_loop::CurrentLoop;
use control::exchange::Asked;
use control::supervisor::{Fault, State};
use core::ops::Deref;
use core::sync::atomic::Ordering::Relaxed;
use link::codes::Run;
use stm32g4xx_hal::stm32::{adc1, tim1, tim2};

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
    E: Deref<Target = tim2::RegisterBlock>,
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
        let sample = self.io.sample(DRIVE_COMMAND.asks(Run::Reset));
        let measured = self.control.measure(config, &sample);
        // Passed on before the second half, which needs the registers that they are in.
        let (view, exchange) = (&DRIVE_VIEW.motors[MOTOR], &EXCHANGE[MOTOR]);
        view.phases[0].store(measured.phases[0].to_bits(), Relaxed);
        view.phases[1].store(measured.phases[1].to_bits(), Relaxed);
        view.encoder.store(sample.encoder, Relaxed);

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
        exchange.publish(&estimate, stale);
        let steps = view.steps.load(Relaxed);
        let [d, q] = &view.voltages[(steps & 3) as usize];
        d.store(estimate.voltage.d.to_bits(), Relaxed);
        q.store(estimate.voltage.q.to_bits(), Relaxed);
        view.steps.store(steps.wrapping_add(1), Relaxed);
        let spent = cycles::now().wrapping_sub(start);
        view.cycles.store(spent, Relaxed);
        keep_max(&view.cycles_max, spent);
    }
}
