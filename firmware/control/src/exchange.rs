//! The words that pass between the interrupts of different priority: one word each, so no lock.
//!
//! The speed task writes [`MotorExchange`]'s reference, the current loop reads it; the current loop writes its
//! estimate, the speed task reads it. Each word is whole by itself, and none means anything only together with
//! another, so relaxed ordering on a single core is enough.

use crate::current_loop::{Calibration, CurrentLoopConfig, CurrentReference, Mode, Rested};
use crate::format::ScaledCurrent;
use crate::modulation::BusScale;
use core::sync::atomic::{AtomicI32, AtomicU8, AtomicU16, AtomicU32, Ordering::Relaxed};

/// Words between one motor's current loop and the speed task.
#[derive(Debug)]
pub struct MotorExchange {
    /// Periods of the current loop, modulo 2^32.
    periods: AtomicU32,
    /// The period with which the reference to drive ends; over when there is none.
    drive_until: AtomicU32,
    i_q: AtomicI32,
    /// How voltages become compare values near the bus.
    bus_scale: [AtomicI32; 2],
    /// The bus, ADC counts.
    bus: AtomicU16,
    /// Mechanical angle a sample, 2^-32 turn.
    theta_step: AtomicI32,
    /// The last period in which the voltage circle cut the voltage.
    limited_period: AtomicU32,
    /// What stands in the way of driving. Written while the bridge is off; while it is driven, nothing does.
    flags: AtomicU8,
    mode: AtomicU8,
    /// The period with which any reference ends.
    until: AtomicU32,
    valid_periods: u32,
}

/// What a current loop is asked that shall not drive its bridge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AskedToRest {
    /// What it shall do.
    pub mode: Mode,
    /// What was asked is too old to follow: the speed task is late.
    pub stale: bool,
}

/// What the speed task sees of a motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorStatus {
    /// Mechanical angle a period of its current loop, 2^-32 turn.
    pub theta_step: i32,
    /// The voltage circle cut the last step.
    pub voltage_limited: bool,
    /// The bridge is stopped by its break input.
    pub broken: bool,
    /// The encoder's count stands while the shaft turns, or too many of its readings are wrong.
    pub encoder_stuck: bool,
    /// The speed task was late with its reference: the current loop has stopped its bridge by itself.
    pub reference_stale: bool,
    /// How far the offset calibration is.
    pub calibration: Calibration,
}

const BROKEN: u8 = 2;
const CALIBRATED: u8 = 4;
const ZERO_OUT_OF_RANGE: u8 = 8;
const ENCODER_STUCK: u8 = 16;
const STALE: u8 = 32;

impl MotorExchange {
    /// No mode, no current, no speed: how every drive starts. A reference holds for two steps of a speed task that
    /// runs every `speed_divider` periods; past that the current loop switches its bridge off.
    #[must_use]
    pub const fn new(speed_divider: u32) -> Self {
        let valid_periods = speed_divider.saturating_mul(2);
        Self {
            periods: AtomicU32::new(0),
            drive_until: AtomicU32::new(0),
            i_q: AtomicI32::new(0),
            bus_scale: [AtomicI32::new(0), AtomicI32::new(0)],
            bus: AtomicU16::new(0),
            theta_step: AtomicI32::new(0),
            limited_period: AtomicU32::new(u32::MAX),
            flags: AtomicU8::new(0),
            mode: AtomicU8::new(Mode::Off as u8),
            until: AtomicU32::new(valid_periods),
            valid_periods,
        }
    }

    /// Speed task: what the current loop of `config` shall do from its next period on.
    ///
    /// The current loop may come between any two of the stores. It drives only by `drive_until`, which comes last, and
    /// calls a reference stale only by `until`.
    #[inline(always)]
    pub fn ask(&self, reference: CurrentReference, config: &CurrentLoopConfig) {
        let periods = self.periods.load(Relaxed);
        let until = periods.wrapping_add(self.valid_periods);
        let drive_until = if reference.mode == Mode::Drive {
            until
        } else {
            periods
        };
        self.until.store(until, Relaxed);
        let BusScale { at_zero, slope } = config.modulation.bus_scale(self.bus.load(Relaxed));
        for (word, value) in self.bus_scale.iter().zip([at_zero, slope]) {
            word.store(value, Relaxed);
        }
        self.i_q
            .store(config.sense.scale.scaled(reference.i_q).0, Relaxed);
        self.mode.store(reference.mode as u8, Relaxed);
        self.drive_until.store(drive_until, Relaxed);
    }

    /// Current loop, once a period: it shall drive its bridge, and was not asked to too long ago.
    ///
    /// A speed task that has not run for 2^31 periods, more than half a day, would be taken for one that has; the
    /// watchdog ends that within milliseconds.
    #[must_use]
    #[inline(always)]
    pub fn asked_to_drive(&self) -> bool {
        let periods = self.periods.load(Relaxed).wrapping_add(1);
        self.periods.store(periods, Relaxed);
        !over(self.drive_until.load(Relaxed), periods)
    }

    /// Current loop: the speed task is due, once in `speed_divider` periods and with the first. Where the divider is not a
    /// power of two, a step comes early when the count of periods wraps, once in 59 hours at 20 kHz.
    #[must_use]
    #[inline(always)]
    pub fn speed_is_due(&self, speed_divider: u32) -> bool {
        let after = |periods: u32| periods.checked_rem(speed_divider);
        after(self.periods.load(Relaxed)) == after(1)
    }

    /// Current loop, where it shall drive: the reference, within half of its word.
    #[must_use]
    #[inline(always)]
    pub fn i_q(&self) -> ScaledCurrent {
        ScaledCurrent(self.i_q.load(Relaxed))
    }

    /// Current loop, where it shall drive: how voltages become compare values near the bus of the last speed step. Should the
    /// speed task be between its words, they are two steps' of a bus that hardly changes.
    #[must_use]
    #[inline(always)]
    pub fn bus_scale(&self) -> BusScale {
        let [at_zero, slope] = &self.bus_scale;
        BusScale {
            at_zero: at_zero.load(Relaxed),
            slope: slope.load(Relaxed),
        }
    }

    /// Current loop, where it shall not or cannot drive: what else.
    #[must_use]
    pub fn asked_to_rest(&self) -> AskedToRest {
        let stale = over(self.until.load(Relaxed), self.periods.load(Relaxed));
        let mode = match self.mode.load(Relaxed) {
            _ if stale => Mode::Off,
            m if m == Mode::Drive as u8 => Mode::Drive,
            m if m == Mode::Calibrate as u8 => Mode::Calibrate,
            _ => Mode::Off,
        };
        AskedToRest { mode, stale }
    }

    /// Current loop: how far the shaft turns in a period, 2^-32 turn.
    #[inline(always)]
    pub fn publish_speed(&self, theta_step: i32) {
        self.theta_step.store(theta_step, Relaxed);
    }

    /// Current loop: the bus, ADC counts.
    #[inline(always)]
    pub fn publish_bus(&self, counts: u16) {
        self.bus.store(counts, Relaxed);
    }

    /// Current loop, in a period in which the voltage circle cuts its voltage.
    pub fn publish_limited(&self) {
        self.limited_period
            .store(self.periods.load(Relaxed), Relaxed);
    }

    /// Current loop, after a period with the bridge off: how far the calibration is, what stops the bridge, and whether what
    /// was asked was stale.
    pub fn publish_rest(&self, rested: Rested, stale: bool) {
        let calibration = match rested.calibration {
            Calibration::Pending => 0,
            Calibration::Done => CALIBRATED,
            Calibration::OutOfRange => ZERO_OUT_OF_RANGE,
        };
        let flag = |set: bool, bit: u8| if set { bit } else { 0 };
        let flags = flag(rested.broken, BROKEN)
            | flag(rested.encoder_stuck, ENCODER_STUCK)
            | flag(stale, STALE)
            | calibration;
        self.flags.store(flags, Relaxed);
    }

    /// Periods of the current loop, modulo 2^32.
    #[must_use]
    pub fn periods(&self) -> u32 {
        self.periods.load(Relaxed)
    }

    /// Speed task: what the current loop found.
    #[must_use]
    #[inline(always)]
    pub fn status(&self) -> MotorStatus {
        let flags = self.flags.load(Relaxed);
        MotorStatus {
            theta_step: self.theta_step.load(Relaxed),
            voltage_limited: self.limited_period.load(Relaxed) == self.periods.load(Relaxed),
            broken: flags & BROKEN != 0,
            encoder_stuck: flags & ENCODER_STUCK != 0,
            reference_stale: flags & STALE != 0,
            calibration: match flags & (CALIBRATED | ZERO_OUT_OF_RANGE) {
                0 => Calibration::Pending,
                CALIBRATED => Calibration::Done,
                _ => Calibration::OutOfRange,
            },
        }
    }
}

/// The period `until` has passed.
#[inline(always)]
fn over(until: u32, periods: u32) -> bool {
    until.wrapping_sub(periods).cast_signed() < 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::Current;
    use crate::plate::test_plate;

    fn config() -> CurrentLoopConfig {
        let plate = test_plate();
        plate.motors[0].current_loop(&plate).unwrap()
    }

    const ONE_AMPERE: CurrentReference = CurrentReference {
        mode: Mode::Drive,
        i_q: Current::ONE,
    };

    #[test]
    fn what_one_side_writes_the_other_reads() {
        let exchange = MotorExchange::new(4);
        assert!(!exchange.asked_to_drive());
        assert_eq!(exchange.asked_to_rest(), AskedToRest::default());
        for mode in [Mode::Off, Mode::Calibrate, Mode::Drive] {
            exchange.ask(CurrentReference { mode, ..ONE_AMPERE }, &config());
            let drive = mode == Mode::Drive;
            assert_eq!(exchange.asked_to_drive(), drive);
            assert_eq!(config().sense.scale.current(exchange.i_q()), Current::ONE);
            assert_eq!(exchange.asked_to_rest(), AskedToRest { mode, stale: false });
        }
        for calibration in [
            Calibration::Pending,
            Calibration::Done,
            Calibration::OutOfRange,
        ] {
            for (broken, encoder_stuck) in [(true, false), (false, true), (false, false)] {
                let rested = Rested {
                    calibration,
                    broken,
                    encoder_stuck,
                };
                exchange.publish_speed(-471);
                exchange.publish_rest(rested, false);
                let status = MotorStatus {
                    theta_step: -471,
                    voltage_limited: false,
                    broken,
                    encoder_stuck,
                    reference_stale: false,
                    calibration,
                };
                assert_eq!(exchange.status(), status);
                exchange.publish_limited();
                let limited = MotorStatus {
                    voltage_limited: true,
                    ..status
                };
                assert_eq!(exchange.status(), limited);
                let _ = exchange.asked_to_drive();
                assert_eq!(exchange.status(), status, "only the last period counts");
            }
        }
    }

    #[test]
    fn a_reference_that_is_not_renewed_switches_off_and_says_so() {
        let exchange = MotorExchange::new(4);
        exchange.ask(ONE_AMPERE, &config());
        for _ in 0..8 {
            assert!(exchange.asked_to_drive());
        }
        for _ in 0..20 {
            assert!(!exchange.asked_to_drive());
            let asked = exchange.asked_to_rest();
            assert_eq!((asked.mode, asked.stale), (Mode::Off, true));
            exchange.publish_rest(Rested::default(), asked.stale);
            assert!(exchange.status().reference_stale);
        }
        // The speed task sees it when it is back, and asks for nothing until the fault is reset.
        exchange.ask(CurrentReference::default(), &config());
        assert!(!exchange.asked_to_drive());
        let asked = exchange.asked_to_rest();
        assert!(!asked.stale);
        exchange.publish_rest(Rested::default(), asked.stale);
        assert!(!exchange.status().reference_stale);
        exchange.ask(ONE_AMPERE, &config());
        assert!(exchange.asked_to_drive());
    }

    #[test]
    fn the_count_of_periods_may_wrap() {
        let exchange = MotorExchange::new(4);
        exchange.periods.store(u32::MAX - 3, Relaxed);
        exchange.ask(ONE_AMPERE, &config());
        for _ in 0..8 {
            assert!(exchange.asked_to_drive());
        }
        assert!(!exchange.asked_to_drive());
        assert!(exchange.asked_to_rest().stale);
    }
}
