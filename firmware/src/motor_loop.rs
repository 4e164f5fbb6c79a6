//! What a current-loop interrupt does: read, step, write.

use crate::CONFIG;
use crate::debug_view::{DRIVE_COMMAND, DRIVE_VIEW, codes, count, keep_max};
use crate::hw::cycles;
use crate::hw::encoder::Encoder;
use crate::hw::motor_io::MotorIo;
use crate::speed::EXCHANGE;
use control::current_loop::CurrentLoop;
use control::exchange::Asked;
use control::supervisor::{Fault, State};
use core::ops::Deref;
use core::sync::atomic::{AtomicI32, AtomicU32, Ordering::Relaxed};
use link::codes::Run;
use stm32g4xx_hal::stm32::{adc1, tim1};

/// What a current loop leaves for the tasks below it, in its own formats: all in one place, so that one address in a
/// register serves.
pub(crate) struct MotorShared {
    /// Currents of phases a and b, with the measured zeros taken off.
    pub(crate) phases: [AtomicI32; 2],
    /// The encoder's count within the turn.
    pub(crate) encoder: AtomicU32,
    /// Commanded voltages d and q of the last four steps: a step's are at its number modulo 4.
    pub(crate) voltages: [[AtomicI32; 2]; 4],
    /// Steps so far.
    pub(crate) steps: AtomicU32,
    /// Steps that ended after their period had begun.
    pub(crate) missed: AtomicU32,
    /// Cycles of the last step.
    pub(crate) cycles: AtomicU32,
    /// Cycles of the longest step.
    pub(crate) cycles_max: AtomicU32,
}

impl MotorShared {
    const fn new() -> Self {
        Self {
            phases: [const { AtomicI32::new(0) }; 2],
            encoder: AtomicU32::new(0),
            voltages: [const { [const { AtomicI32::new(0) }; 2] }; 4],
            steps: AtomicU32::new(0),
            missed: AtomicU32::new(0),
            cycles: AtomicU32::new(0),
            cycles_max: AtomicU32::new(0),
        }
    }
}

/// Screw, nut.
pub(crate) static MOTORS: [MotorShared; 2] = [MotorShared::new(), MotorShared::new()];

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
        let sample = self.io.sample(DRIVE_COMMAND.asks(Run::Reset));
        let measured = self.control.measure(config, &sample);
        // Passed on before the second half, which needs the registers that they are in.
        let (shared, exchange) = (&MOTORS[MOTOR], &EXCHANGE[MOTOR]);
        shared.phases[0].store(measured.phases[0].to_bits(), Relaxed);
        shared.phases[1].store(measured.phases[1].to_bits(), Relaxed);
        if let Some(counts) = measured.counts {
            shared.encoder.store(counts, Relaxed);
        }

        let Asked { reference, stale } = exchange.asked();
        if stale {
            // The speed task, which says what the drive is doing, cannot.
            let (state, fault) = const { codes(State::Fault(Fault::SpeedTaskLate)) };
            DRIVE_VIEW.state.store(state, Relaxed);
            DRIVE_VIEW.fault.store(fault, Relaxed);
        }
        let (command, estimate) = self.control.act(config, &sample, &measured, reference);
        if !self.io.apply(&command) {
            count(&shared.missed);
        }
        if estimate.encoder_wrong {
            count(&DRIVE_VIEW.encoder_wrong[MOTOR]);
        }
        exchange.publish(&estimate, stale);
        let steps = shared.steps.load(Relaxed);
        let [d, q] = &shared.voltages[(steps & 3) as usize];
        d.store(estimate.voltage.d.to_bits(), Relaxed);
        q.store(estimate.voltage.q.to_bits(), Relaxed);
        shared.steps.store(steps.wrapping_add(1), Relaxed);
        let spent = cycles::now().wrapping_sub(start);
        shared.cycles.store(spent, Relaxed);
        keep_max(&shared.cycles_max, spent);
    }
}
