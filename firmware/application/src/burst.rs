//! The burst: the last PWM periods of a motor, kept by its current loop's interrupt, frozen around a trigger.
//!
//! While no burst is armed the interrupt pays for one look at [`MotorExchange::is_watched`]. While one is, it keeps four words a
//! period and looks at one signal. The lines write what is asked before the motor is watched, and read the samples after.

use crate::exchange::state;
use control::current_loop::CurrentLoopConfig;
use control::exchange::MotorExchange;
use control::format::{Current, ScaledCurrent};
use control::supervisor::State;
use core::sync::atomic::{AtomicBool, AtomicI32, AtomicU32, Ordering::Relaxed};
use link::burst::{
    BurstRequest, BurstSample, BurstState, BurstStatus, SAMPLES, SAMPLES_A_FRAME, Signal, Trigger,
};
use link::message::Refusal;
use link::scale::{SAMPLE_CURRENT_DROPS, SAMPLE_VOLTAGE_DROPS};
use link::telemetry::rounded;
use link::view::DriveView;

/// Words of a kept sample: both phases, both voltages, torque current and its reference, encoder.
const WORDS: usize = 4;
/// What a kept voltage leaves out, bits: it is in 2^-6 V, within 512 V.
const VOLTAGE_DROPS: u32 = 12;
/// What a level may lose in the loop's own unit, 2^-20 A: 2 mA.
const MOST_CUT: u32 = 2048;
/// 2^32 / (2 pi): of an angle in rad, 2^-32 turn.
const TURN_RAD: i64 = 683_565_276;

/// What the interrupt looks at: half of a kept word, by its place, or one of these.
const SPEED: u32 = 6;
const FAULT: u32 = 7;
const STATE: u32 = 8;
const NOW: u32 = 9;

/// What turns a request into the words of a motor's current loop.
#[derive(Clone, Copy, Debug)]
pub struct Motor<'a> {
    /// Its configuration.
    pub config: &'a CurrentLoopConfig,
    /// Its PWM periods a second.
    pub pwm_hz: u32,
}

/// One burst. The samples are last: what is before them is near to one address.
#[derive(Debug)]
#[repr(C)]
pub struct Burst {
    /// Periods until the next sample.
    skip: AtomicU32,
    /// Where the next sample goes.
    next: AtomicU32,
    /// Samples before the trigger that are kept.
    before: AtomicU32,
    /// Samples that are to come; 0 until the trigger has come.
    left: AtomicU32,
    /// Period of the trigger.
    period: AtomicU32,
    /// What is looked at, by its place or one of the codes above, and its level in the loop's own unit.
    source: AtomicU32,
    level: AtomicI32,
    /// -1 turns a signal that is to fall into one that is to rise.
    flip: AtomicI32,
    /// All samples are kept.
    complete: AtomicBool,
    /// The signal was below the level.
    below: AtomicBool,
    /// What was asked last, as the link has it: motor, trigger, signal, level, samples before, divider.
    request: [AtomicU32; 6],
    samples: [[AtomicU32; WORDS]; SAMPLES],
}

impl Burst {
    /// Nothing is kept.
    #[must_use]
    #[allow(clippy::new_without_default)]
    pub const fn new() -> Self {
        Self {
            skip: AtomicU32::new(0),
            next: AtomicU32::new(0),
            before: AtomicU32::new(0),
            left: AtomicU32::new(0),
            period: AtomicU32::new(0),
            // All zero, so that the flash holds none of it.
            source: AtomicU32::new(0),
            level: AtomicI32::new(0),
            flip: AtomicI32::new(0),
            complete: AtomicBool::new(false),
            below: AtomicBool::new(false),
            request: [const { AtomicU32::new(0) }; 6],
            samples: [const { [const { AtomicU32::new(0) }; WORDS] }; SAMPLES],
        }
    }

    /// A current loop's interrupt, after its period.
    #[inline(always)]
    pub fn after_period(&self, exchange: &MotorExchange, view: &DriveView) {
        if exchange.is_watched() {
            self.keep(exchange, view);
        }
    }

    #[cold]
    #[inline(never)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    fn keep(&self, exchange: &MotorExchange, view: &DriveView) {
        if let Some(skip) = self.skip.load(Relaxed).checked_sub(1) {
            self.skip.store(skip, Relaxed);
            return;
        }
        let skip = self.divider().wrapping_sub(1);
        self.skip.store(skip, Relaxed);
        let next = self.next.load(Relaxed);
        let words = words(exchange);
        if let Some(sample) = self.samples.get(next as usize) {
            for (place, word) in sample.iter().zip(words) {
                place.store(word, Relaxed);
            }
        }
        let next = next.wrapping_add(1);
        let next = if next < SAMPLES as u32 { next } else { 0 };
        self.next.store(next, Relaxed);
        let left = self.left.load(Relaxed);
        let left = if left != 0 {
            left.wrapping_sub(1)
        } else {
            let kept = self.before.load(Relaxed);
            if !self.fires(words, exchange, view) {
                let kept = kept.wrapping_add(1).min(self.asked_before());
                self.before.store(kept, Relaxed);
                return;
            }
            self.period.store(exchange.periods(), Relaxed);
            (SAMPLES as u32 - 1).wrapping_sub(kept)
        };
        self.left.store(left, Relaxed);
        if left == 0 {
            exchange.watch(false);
            self.complete.store(true, Relaxed);
        }
    }

    /// The trigger comes in this period.
    #[inline(always)]
    fn fires(&self, words: [u32; WORDS], exchange: &MotorExchange, view: &DriveView) -> bool {
        let shown = || view.state.load(Relaxed);
        let value = match self.source.load(Relaxed) {
            NOW => return true,
            STATE => return shown() != self.level.load(Relaxed).cast_unsigned(),
            FAULT => i32::from(shown() == State::FAULT_WORD),
            SPEED => exchange.theta_step(),
            half => {
                let word = words.get(half as usize >> 1).copied().unwrap_or_default();
                halves(word)[half as usize & 1]
            }
        };
        let flip = self.flip.load(Relaxed);
        // The complement of each turns their order.
        let below = (value ^ flip) < (self.level.load(Relaxed) ^ flip);
        let was_below = self.below.load(Relaxed);
        self.below.store(below, Relaxed);
        was_below && !below
    }

    /// Arms a burst of a motor.
    ///
    /// # Errors
    /// [`Refusal::BurstWaits`] or [`Refusal::Burst`]; the burst that is there stays.
    pub fn arm(
        &self,
        request: BurstRequest,
        motors: [&MotorExchange; 2],
        motor: Motor<'_>,
        view: &DriveView,
    ) -> Result<(), Refusal> {
        if motors.iter().any(|motor| motor.is_watched()) {
            return Err(Refusal::BurstWaits);
        }
        let exchange = motors
            .get(usize::from(request.motor))
            .ok_or(Refusal::Burst)?;
        if request.divider == 0 || usize::from(request.before) >= SAMPLES {
            return Err(Refusal::Burst);
        }
        let seen = state(view);
        let looked = source(&request, motor, seen).ok_or(Refusal::Burst)?;
        self.source.store(looked.source, Relaxed);
        self.level.store(looked.level, Relaxed);
        self.flip.store(-i32::from(looked.falls), Relaxed);
        // A fault may come before the first sample; a signal is to be seen below its level first.
        let below = looked.source == FAULT && seen.fault().is_none();
        self.below.store(below, Relaxed);
        let asked = [
            request.motor.into(),
            request.trigger,
            request.signal,
            request.level.cast_unsigned(),
            request.before.into(),
            request.divider.into(),
        ];
        for (word, value) in self.request.iter().zip(asked) {
            word.store(value, Relaxed);
        }
        for word in [&self.skip, &self.next, &self.before, &self.left] {
            word.store(0, Relaxed);
        }
        self.complete.store(false, Relaxed);
        exchange.watch(true);
        Ok(())
    }

    /// Forgets the burst.
    pub fn end(&self, motors: [&MotorExchange; 2]) {
        for motor in motors {
            motor.watch(false);
        }
        self.complete.store(false, Relaxed);
    }

    /// How it is going.
    #[must_use]
    pub fn status(&self, motors: [&MotorExchange; 2]) -> BurstStatus {
        let watched = motors.iter().any(|motor| motor.is_watched());
        let state = if self.complete.load(Relaxed) {
            BurstState::Complete
        } else if !watched {
            BurstState::None
        } else if self.left.load(Relaxed) == 0 {
            BurstState::Waiting
        } else {
            BurstState::Filling
        };
        let [motor, trigger, signal, level, before, divider] =
            self.request.each_ref().map(|word| word.load(Relaxed));
        let alignment = motors
            .get(motor as usize)
            .and_then(|motor| motor.alignment());
        BurstStatus {
            state: state.word(),
            request: BurstRequest {
                motor: motor as u8,
                trigger,
                signal,
                level: level.cast_signed(),
                before: before as u16,
                divider: divider as u8,
            },
            before: self.before.load(Relaxed) as u16,
            period: self.period.load(Relaxed),
            reversed: alignment.is_some_and(|held| held.reversed),
        }
    }

    /// Samples of a complete burst from this one on, of the motors with these configurations.
    ///
    /// # Errors
    /// [`Refusal::NoBurst`].
    pub fn samples(
        &self,
        from: u16,
        loops: &[CurrentLoopConfig; 2],
    ) -> Result<heapless::Vec<BurstSample, SAMPLES_A_FRAME>, Refusal> {
        if !self.complete.load(Relaxed) {
            return Err(Refusal::NoBurst);
        }
        let [screw, nut] = loops;
        let config = if self.request[0].load(Relaxed) == 0 {
            screw
        } else {
            nut
        };
        // The oldest lies where the next would go.
        let (newer, older) = self
            .samples
            .split_at_checked(self.next.load(Relaxed) as usize)
            .unwrap_or_default();
        let samples = older.iter().chain(newer).skip(from.into());
        Ok(samples
            .take(SAMPLES_A_FRAME)
            .map(|words| sample(config, words.each_ref().map(|word| word.load(Relaxed))))
            .collect())
    }

    #[inline(always)]
    fn divider(&self) -> u32 {
        self.request[5].load(Relaxed)
    }

    #[inline(always)]
    fn asked_before(&self) -> u32 {
        self.request[4].load(Relaxed)
    }
}

/// What a period leaves, of words that the loop has just written: the upper halves of codes and currents.
#[inline(always)]
fn words(exchange: &MotorExchange) -> [u32; WORDS] {
    let both =
        |low: i32, high: i32| (low.cast_unsigned() >> 16) | (high.cast_unsigned() & 0xFFFF_0000);
    // See the telemetry: what acted in the period that ended with the sample.
    let voltage = exchange.voltage(exchange.periods().wrapping_sub(2));
    let upper = |volts: i32| {
        let short = (volts >> VOLTAGE_DROPS).clamp(i16::MIN.into(), i16::MAX.into());
        short.wrapping_shl(16)
    };
    let [a, b, _] = exchange.codes();
    [
        both(a, b),
        both(upper(voltage.d.to_bits()), upper(voltage.q.to_bits())),
        both(exchange.current().q.0, exchange.reference().q.0),
        exchange.encoder(),
    ]
}

/// The lower and the upper half of a kept word, as upper halves.
#[inline(always)]
fn halves(word: u32) -> [i32; 2] {
    [word.wrapping_shl(16), word & 0xFFFF_0000].map(u32::cast_signed)
}

/// The words of a sample as the link has them.
fn sample(config: &CurrentLoopConfig, words: [u32; WORDS]) -> BurstSample {
    let [phases, voltages, currents, encoder] = words;
    let current = |current: Current| rounded(current.to_bits(), SAMPLE_CURRENT_DROPS);
    let [a, b] = halves(phases);
    let [a, b, _] = config.sense.phases([a, b, 0]);
    let [i_q, i_q_ref] = halves(currents).map(|i| config.sense.scale.current(ScaledCurrent(i)));
    BurstSample {
        encoder,
        phases: [a, b].map(current),
        i_q: current(i_q),
        i_q_ref: current(i_q_ref),
        voltage: halves(voltages).map(|word| word >> (16 - VOLTAGE_DROPS + SAMPLE_VOLTAGE_DROPS)),
    }
}

/// What the interrupt is to look at.
struct Looked {
    source: u32,
    level: i32,
    falls: bool,
}

/// What a request asks for, in the loop's own words; `None` if there is no such trigger, signal or level.
fn source(request: &BurstRequest, motor: Motor<'_>, seen: State) -> Option<Looked> {
    let of_state = |source, level| {
        Some(Looked {
            source,
            level,
            falls: false,
        })
    };
    let falls = match Trigger::of_word(request.trigger)? {
        Trigger::Now => return of_state(NOW, 0),
        Trigger::Fault => return of_state(FAULT, 1),
        Trigger::State => return of_state(STATE, seen.word().cast_signed()),
        Trigger::Rises => false,
        Trigger::Falls => true,
    };
    let sense = &motor.config.sense;
    let level = Current::from_bits(request.level);
    let phase = |source, phase| {
        let (level, turned) = sense.code(phase, level)?;
        Some((source, level, turned))
    };
    let scaled = |source| {
        let scaled = sense.scale.scaled(level);
        // A current beyond its word is cut.
        let held = sense.scale.current(scaled).to_bits();
        (held.abs_diff(request.level) < MOST_CUT).then_some((source, scaled.0, false))
    };
    let voltage = |source| {
        let level = (request.level >> VOLTAGE_DROPS).checked_mul(1 << 16)?;
        Some((source, level, false))
    };
    let (source, level, turned) = match Signal::of_word(request.signal)? {
        Signal::PhaseA => phase(0, 0)?,
        Signal::PhaseB => phase(1, 1)?,
        Signal::VoltageD => voltage(2)?,
        Signal::VoltageQ => voltage(3)?,
        Signal::TorqueCurrent => scaled(4)?,
        Signal::TorqueReference => scaled(5)?,
        Signal::Speed => {
            let period = i64::from(motor.pwm_hz) << Signal::Speed.fraction();
            let step = i64::from(request.level)
                .saturating_mul(TURN_RAD)
                .checked_div(period)?;
            (SPEED, i32::try_from(step).ok()?, false)
        }
    };
    Some(Looked {
        source,
        level,
        falls: falls != turned,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use control::current_loop::Measured;
    use control::fault::Fault;
    use control::plate::{BoardPlate, DriveConfig};
    use control::sense::Shunts;
    use control::transform::DirectQuadrature;
    use link::scale;
    use link::settings::Settings;
    use proptest::prelude::*;

    const PWM_HZ: u32 = 20_000;

    fn config() -> DriveConfig {
        let board = BoardPlate {
            timer_hz: 170e6,
            pwm_hz: PWM_HZ.into(),
            speed_divider: 4,
            shunts: Shunts::Two,
            amps_per_count: -0.01,
            zero_counts: 2048.0,
            bus_volts_per_count: 0.1,
            adc_counts: 4096,
        };
        Settings::DEFAULT.plate(&board).config().unwrap()
    }

    const NOW_OF_SCREW: BurstRequest = BurstRequest {
        motor: 0,
        trigger: Trigger::Now.word(),
        signal: 0,
        level: 0,
        before: 0,
        divider: 1,
    };

    /// Both motors' words, their burst, and so many periods.
    struct Rig {
        config: DriveConfig,
        motors: [MotorExchange; 2],
        burst: Burst,
        view: DriveView,
        period: u32,
    }

    impl Rig {
        fn new() -> Self {
            let config = config();
            let motors = config
                .current_loops
                .each_ref()
                .map(|motor| MotorExchange::new(motor, 4));
            Self {
                config,
                motors,
                burst: Burst::new(),
                view: DriveView::new(),
                period: 0,
            }
        }

        fn motors(&self) -> [&MotorExchange; 2] {
            self.motors.each_ref()
        }

        fn arm(&self, request: BurstRequest) -> Result<(), Refusal> {
            let motor = Motor {
                config: &self.config.current_loops[usize::from(request.motor) & 1],
                pwm_hz: PWM_HZ,
            };
            self.burst.arm(request, self.motors(), motor, &self.view)
        }

        /// A period of both loops, with that code in phase a of each. The encoder counts periods.
        fn pass(&mut self, code: i32) {
            self.period += 1;
            for motor in &self.motors {
                let _ = motor.begin_period();
                motor.publish_shaft(Some(self.period), code);
                let measured = Measured {
                    codes: [code, 0, 0],
                    current: DirectQuadrature {
                        d: ScaledCurrent(0),
                        q: ScaledCurrent(code),
                    },
                };
                motor.publish_currents(&measured, Shunts::Two);
                self.burst.after_period(motor, &self.view);
            }
        }

        fn state(&self) -> BurstState {
            BurstState::of_word(self.burst.status(self.motors()).state).unwrap()
        }

        /// The encoder's counts of all samples: the periods that are kept.
        fn periods(&self) -> Result<Vec<u32>, Refusal> {
            let mut all = Vec::new();
            loop {
                let from = u16::try_from(all.len()).unwrap();
                let some = self.burst.samples(from, &self.config.current_loops)?;
                if some.is_empty() {
                    return Ok(all);
                }
                all.extend(some.iter().map(|sample| sample.encoder));
            }
        }

        /// So many periods at `code`, or until the burst is complete.
        fn pass_all(&mut self, code: i32, periods: usize) {
            for _ in 0..periods {
                if self.state() == BurstState::Complete {
                    break;
                }
                self.pass(code);
            }
        }
    }

    extern crate std;
    use std::vec::Vec;

    /// A current steps in a known period, long after the ring has wrapped: that period is the trigger's sample, those before and
    /// after it are the periods around it, and no other.
    #[test]
    fn the_trigger_is_the_period_in_which_the_level_is_passed() {
        // Currents of this board lower their codes.
        for (trigger, low, high) in [
            (Trigger::Rises, 1 << 24, -(1 << 24)),
            (Trigger::Falls, -(1 << 24), 1 << 24),
        ] {
            for (waits, before) in [(2000, 100), (513, 511), (1, 0)] {
                let mut rig = Rig::new();
                let request = BurstRequest {
                    trigger: trigger.word(),
                    signal: Signal::PhaseA.word(),
                    before,
                    ..NOW_OF_SCREW
                };
                assert_eq!(rig.periods(), Err(Refusal::NoBurst));
                rig.arm(request).unwrap();
                // Beyond the level from the start is no passing of it.
                rig.pass(high);
                rig.pass_all(low, waits);
                assert_eq!(rig.state(), BurstState::Waiting);
                assert_eq!(rig.periods(), Err(Refusal::NoBurst));
                let stepped = rig.period + 1;
                rig.pass(high);
                let left = SAMPLES - 1 - usize::from(before);
                for _ in 0..left {
                    assert_eq!(rig.state(), BurstState::Filling);
                    assert_eq!(rig.periods(), Err(Refusal::NoBurst));
                    rig.pass(high);
                }
                let status = rig.burst.status(rig.motors());
                assert_eq!((status.period, status.before), (stepped, before));
                assert_eq!(status.request, request);
                let first = stepped - u32::from(before);
                let expected: Vec<u32> = (first..first + SAMPLES as u32).collect();
                assert_eq!(rig.periods(), Ok(expected.clone()));
                // It is frozen.
                for _ in 0..700 {
                    rig.pass(low);
                }
                assert_eq!(rig.periods(), Ok(expected));
            }
        }
    }

    #[test]
    fn a_trigger_before_all_is_kept_that_was_asked_before_it_is_taken() {
        let mut rig = Rig::new();
        rig.arm(BurstRequest {
            before: 400,
            trigger: Trigger::Rises.word(),
            signal: Signal::Speed.word(),
            ..NOW_OF_SCREW
        })
        .unwrap();
        rig.pass_all(-1, 7);
        rig.pass_all(1, SAMPLES);
        assert_eq!(rig.burst.status(rig.motors()).before, 7);
        assert_eq!(rig.periods(), Ok((1..=SAMPLES as u32).collect()));
    }

    #[test]
    fn a_divider_keeps_each_so_manieth_period() {
        let mut rig = Rig::new();
        let request = BurstRequest {
            motor: 1,
            divider: 7,
            ..NOW_OF_SCREW
        };
        rig.arm(request).unwrap();
        rig.pass_all(0, 7 * SAMPLES);
        let expected: Vec<u32> = (0..SAMPLES as u32).map(|k| 1 + 7 * k).collect();
        assert_eq!(rig.periods(), Ok(expected));
    }

    #[test]
    fn a_fault_and_another_state_begin_a_burst() {
        let fault = State::Fault(Fault::NutEncoder);
        for (trigger, from, through, to) in [
            (Trigger::Fault, State::Running, State::Holding, fault),
            // A fault that is there is none that comes.
            (Trigger::Fault, fault, State::Ready, fault),
            (Trigger::State, State::Ready, State::Ready, State::Running),
        ] {
            let mut rig = Rig::new();
            crate::exchange::show(&rig.view, from);
            rig.arm(BurstRequest {
                trigger: trigger.word(),
                before: 50,
                ..NOW_OF_SCREW
            })
            .unwrap();
            rig.pass_all(0, 600);
            crate::exchange::show(&rig.view, through);
            rig.pass_all(0, 600);
            assert_eq!(rig.state(), BurstState::Waiting, "{trigger:?} {from:?}");
            crate::exchange::show(&rig.view, to);
            rig.pass_all(0, SAMPLES);
            assert_eq!(rig.burst.status(rig.motors()).period, 1201);
            assert_eq!(rig.periods().unwrap()[50], 1201);
        }
    }

    #[test]
    fn a_fault_between_arming_and_the_first_sample_is_seen() {
        for trigger in [Trigger::Fault, Trigger::State] {
            let mut rig = Rig::new();
            rig.arm(BurstRequest {
                trigger: trigger.word(),
                ..NOW_OF_SCREW
            })
            .unwrap();
            crate::exchange::show(&rig.view, State::Fault(Fault::NutEncoder));
            rig.pass_all(0, SAMPLES);
            assert_eq!(rig.state(), BurstState::Complete, "{trigger:?}");
        }
    }

    #[test]
    fn a_second_one_is_refused_while_one_waits_and_taken_once_it_is_ended_or_complete() {
        let mut rig = Rig::new();
        let waits = BurstRequest {
            trigger: Trigger::Fault.word(),
            ..NOW_OF_SCREW
        };
        let nut = BurstRequest {
            motor: 1,
            ..NOW_OF_SCREW
        };
        assert_eq!(rig.state(), BurstState::None);
        rig.arm(waits).unwrap();
        rig.pass_all(0, 5);
        assert_eq!(rig.arm(nut), Err(Refusal::BurstWaits));
        assert_eq!(rig.burst.status(rig.motors()).request, waits);
        rig.burst.end(rig.motors());
        assert_eq!(rig.state(), BurstState::None);
        rig.pass_all(0, 5);
        rig.arm(nut).unwrap();
        rig.pass_all(0, SAMPLES);
        assert_eq!(rig.state(), BurstState::Complete);
        assert_eq!(rig.periods().unwrap()[0], 11);
        rig.arm(waits).unwrap();
        assert_eq!(rig.periods(), Err(Refusal::NoBurst));
    }

    #[test]
    fn what_is_no_burst_is_refused_and_the_one_that_is_there_stays() {
        let mut rig = Rig::new();
        rig.arm(NOW_OF_SCREW).unwrap();
        rig.pass_all(0, SAMPLES);
        let level = |signal: Signal, level| BurstRequest {
            trigger: Trigger::Rises.word(),
            signal: signal.word(),
            level,
            ..NOW_OF_SCREW
        };
        for request in [
            BurstRequest {
                motor: 2,
                ..NOW_OF_SCREW
            },
            BurstRequest {
                divider: 0,
                ..NOW_OF_SCREW
            },
            BurstRequest {
                before: SAMPLES as u16,
                ..NOW_OF_SCREW
            },
            BurstRequest {
                trigger: 5,
                ..NOW_OF_SCREW
            },
            BurstRequest {
                signal: 7,
                ..level(Signal::Speed, 0)
            },
            // 2000 A of 20, 600 V of 512.
            level(Signal::PhaseB, 2000 << scale::CURRENT),
            level(Signal::TorqueCurrent, 2000 << scale::CURRENT),
            level(Signal::VoltageQ, -600 << scale::VOLTAGE),
        ] {
            assert_eq!(rig.arm(request), Err(Refusal::Burst), "{request:?}");
            assert_eq!(rig.state(), BurstState::Complete);
        }
    }

    /// Level and sample are in one scale: the sample before the trigger's is below the level, and it is not.
    #[test]
    fn a_level_is_that_of_the_samples() {
        let levels = [
            (Signal::PhaseA, scale::word(3.0, scale::CURRENT)),
            (Signal::TorqueCurrent, scale::word(3.0, scale::CURRENT)),
        ];
        for (signal, level) in levels {
            let mut rig = Rig::new();
            rig.arm(BurstRequest {
                trigger: Trigger::Rises.word(),
                signal: signal.word(),
                level: level.unwrap(),
                before: 1,
                ..NOW_OF_SCREW
            })
            .unwrap();
            // A ramp of phase a rises as its code falls.
            let step = if signal == Signal::PhaseA { -1 } else { 1 };
            let mut code = 0i32;
            for _ in 0..4000 {
                rig.pass(code);
                code = code.saturating_add(step << 20);
            }
            assert_eq!(rig.state(), BurstState::Complete, "{signal:?}");
            let samples = rig.burst.samples(0, &rig.config.current_loops).unwrap();
            let amps = |k: usize| {
                let word = match signal {
                    Signal::PhaseA => samples[k].phases[0],
                    _ => samples[k].i_q,
                };
                scale::value(word, scale::CURRENT - SAMPLE_CURRENT_DROPS)
            };
            assert!(
                amps(0) < 3.0 && amps(1) > 2.99 && amps(1) - amps(0) < 0.2,
                "{signal:?}: {} A, then {} A",
                amps(0),
                amps(1)
            );
        }
    }

    proptest! {
        /// Any request is taken or refused, and what is taken completes with its trigger or waits.
        #[test]
        fn any_request_is_taken_or_refused(
            motor in 0u8..3, trigger in 0u32..6, signal in 0u32..9, level: i32, before in 0u16..600, divider in 0u8..3,
            codes in prop::collection::vec(any::<i32>(), 0..40),
        ) {
            let mut rig = Rig::new();
            let request = BurstRequest { motor, trigger, signal, level, before, divider };
            let armed = rig.arm(request).is_ok();
            prop_assert_eq!(rig.motors().iter().any(|motor| motor.is_watched()), armed);
            for code in codes {
                rig.pass(code);
            }
            let complete = rig.state() == BurstState::Complete;
            prop_assert_eq!(rig.periods().is_ok(), complete);
        }
    }
}
