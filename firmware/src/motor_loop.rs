//! What a current-loop interrupt does: read, step, write.

use crate::CONFIG;
use crate::debug_view::{DRIVE_COMMAND, DRIVE_VIEW, codes, count, keep_max};
use crate::hw::cycles;
use crate::hw::encoder::Encoder;
use crate::hw::motor_io::MotorIo;
use control::current_loop::{CurrentLoop, Measured, Mode, MotorSample};
use control::exchange::MotorExchange;
use control::observer::Motion;
use control::sense::{Codes, Shunts};
use control::supervisor::{Fault, State};
use core::ops::Deref;
use core::sync::atomic::{AtomicBool, AtomicI32, AtomicU32, Ordering::Relaxed};
use link::codes::Run;
use stm32g4xx_hal::stm32::{adc1, tim1};

/// What a current loop tells the tasks below it: all in one place, so that one address in a register serves.
pub(crate) struct MotorShared {
    /// With the speed task.
    pub(crate) exchange: MotorExchange,
    /// Codes of the phases.
    codes: [AtomicI32; 3],
    /// The encoder's count within the turn.
    pub(crate) encoder: AtomicU32,
    /// Voltages d and q of the last four periods: a period's are at its number modulo 4.
    voltages: [[AtomicI32; 2]; 4],
    /// The loop closed its bridge and has not opened it since; the break may have.
    closed: AtomicBool,
    /// Periods whose compare values came too late.
    pub(crate) missed: AtomicU32,
    /// Cycles of the last period.
    pub(crate) cycles: AtomicU32,
    /// Cycles of the longest.
    pub(crate) cycles_max: AtomicU32,
}

impl MotorShared {
    const fn new() -> Self {
        Self {
            exchange: MotorExchange::new(CONFIG.speed_divider),
            codes: [const { AtomicI32::new(0) }; 3],
            encoder: AtomicU32::new(0),
            voltages: [const { [const { AtomicI32::new(0) }; 2] }; 4],
            closed: AtomicBool::new(false),
            missed: AtomicU32::new(0),
            cycles: AtomicU32::new(0),
            cycles_max: AtomicU32::new(0),
        }
    }
}

impl MotorShared {
    /// Codes of the phases.
    pub(crate) fn codes(&self) -> Codes {
        self.codes.each_ref().map(|word| word.load(Relaxed))
    }

    /// The voltages of period `period`, one of the last four.
    #[inline(always)]
    pub(crate) fn voltage(&self, period: u32) -> &[AtomicI32; 2] {
        &self.voltages[(period & 3) as usize]
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
        let (config, shared) = (const { &CONFIG.current_loops[MOTOR] }, &MOTORS[MOTOR]);
        let broken = self.io.acknowledge();
        let asked = shared.exchange.asked_to_drive();
        if !broken && asked {
            let (counts, motion, measured) = self.measure();
            if self.watch(counts, &motion, true) {
                self.rest(broken);
            } else {
                let (i_q, bus) = (shared.exchange.i_q(), self.io.bus());
                shared.exchange.publish_bus(bus as u16);
                let output = self.control.regulate(config, i_q, &measured, &motion, bus);
                if output.limited {
                    shared.exchange.publish_limited();
                }
                let [d, q] = shared.voltage(shared.exchange.periods());
                d.store(output.voltage.d.to_bits(), Relaxed);
                q.store(output.voltage.q.to_bits(), Relaxed);
                let scale = shared.exchange.bus_scale();
                let compare =
                    CurrentLoop::modulate(config, output.voltage, &measured, &motion, scale, bus);
                self.io.write(compare);
                if !shared.closed.load(Relaxed) {
                    self.begin();
                }
            }
        } else {
            self.measure_and_rest(broken);
        }
        if !self.io.in_time() {
            too_late(&shared.missed);
        }
        let spent = cycles::now().wrapping_sub(start);
        shared.cycles.store(spent, Relaxed);
        keep_max(&shared.cycles_max, spent);
    }

    /// Reads encoder and currents and passes on what they say, before the rest of the period needs the registers that it is
    /// in.
    #[inline(always)]
    fn measure(&mut self) -> (Option<u32>, Motion, Measured) {
        let (config, shared) = (const { &CONFIG.current_loops[MOTOR] }, &MOTORS[MOTOR]);
        let (counts, motion) = self.control.observe(config, self.io.encoder());
        if let Some(counts) = counts {
            shared.encoder.store(counts, Relaxed);
        }
        shared.exchange.publish_speed(motion.theta_step);
        let current = self.io.current(config.sense.shunts);
        let measured = self.control.measure(config, current, &motion);
        let [a, b, c] = measured.codes;
        shared.codes[0].store(a, Relaxed);
        shared.codes[1].store(b, Relaxed);
        if config.sense.shunts == Shunts::Three {
            shared.codes[2].store(c, Relaxed);
        }
        (counts, motion, measured)
    }

    /// Watches the encoder; `true` if it is found to have failed.
    #[inline(always)]
    fn watch(&mut self, counts: Option<u32>, motion: &Motion, drive: bool) -> bool {
        let config = const { &CONFIG.current_loops[MOTOR] };
        let seen = self.control.watch(config, counts, motion, drive);
        if seen.wrong {
            count(&DRIVE_VIEW.encoder_wrong[MOTOR]);
        }
        seen.failed
    }

    /// Closes the bridge for the first period with it on, unless it was opened for an encoder that has failed: then it waits
    /// for the speed task to see that.
    #[cold]
    #[inline(never)]
    fn begin(&mut self) {
        if self.control.may_drive() {
            self.io.close();
            MOTORS[MOTOR].closed.store(true, Relaxed);
        }
    }

    #[cold]
    #[inline(never)]
    fn measure_and_rest(&mut self, broken: bool) {
        let (counts, motion, _) = self.measure();
        let asked = MOTORS[MOTOR].exchange.asked_to_rest();
        self.watch(counts, &motion, asked.mode == Mode::Drive);
        self.rest(broken);
    }

    /// The rest of a period with the bridge off. The sample is still in its registers.
    #[cold]
    #[inline(never)]
    fn rest(&mut self, broken: bool) {
        let config = const { &CONFIG.current_loops[MOTOR] };
        let exchange = &MOTORS[MOTOR].exchange;
        let asked = exchange.asked_to_rest();
        if DRIVE_COMMAND.asks(Run::Reset) {
            self.io.clear_break();
        }
        if asked.stale {
            // The speed task, which says what the drive is doing, cannot.
            let (state, fault) = const { codes(State::Fault(Fault::SpeedTaskLate)) };
            DRIVE_VIEW.state.store(state, Relaxed);
            DRIVE_VIEW.fault.store(fault, Relaxed);
        }
        let sample = MotorSample {
            current: self.io.current(config.sense.shunts),
            bus: self.io.bus() as u16,
            encoder: self.io.encoder(),
            broken,
        };
        exchange.publish_bus(sample.bus);
        for word in MOTORS[MOTOR].voltage(exchange.periods()) {
            word.store(0, Relaxed);
        }
        let counts = config.encoder.counts(sample.encoder);
        let rested = self.control.rest(config, &sample, counts, asked.mode);
        exchange.publish_rest(rested, asked.stale);
        if MOTORS[MOTOR].closed.load(Relaxed) {
            self.io.open();
            MOTORS[MOTOR].closed.store(false, Relaxed);
        }
        self.io.write([0; 3]);
    }
}

#[cold]
#[inline(never)]
fn too_late(missed: &AtomicU32) {
    count(missed);
}
