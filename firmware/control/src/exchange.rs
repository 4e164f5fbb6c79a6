//! The words that pass between the interrupts of different priority: one word each, so no lock.
//!
//! The speed task writes [`MotorExchange`]'s reference, the current loop reads it; the current loop writes its
//! estimate, the speed task reads it. Each word is whole by itself, and none means anything only together with
//! another, so relaxed ordering on a single core is enough.

use crate::current_loop::{Calibration, CurrentReference, Mode, MotorEstimate};
use crate::format::{Current, Speed};
use core::sync::atomic::{AtomicI32, AtomicU8, AtomicU32, Ordering::Relaxed};

/// Words between one motor's current loop and the speed task.
#[derive(Debug)]
pub struct MotorExchange {
    mode: AtomicU8,
    /// Periods since the reference was given; the speed task puts it to 0, the current loop counts it up.
    age: AtomicU32,
    age_max: u32,
    i_q: AtomicI32,
    omega_e: AtomicI32,
    flags: AtomicU8,
}

/// What a current loop is asked.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Asked {
    /// What it shall do.
    pub reference: CurrentReference,
    /// What was asked is too old to follow: the speed task is late.
    pub stale: bool,
}

/// What the speed task sees of a motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorStatus {
    /// Electrical speed, rad/s.
    pub omega_e: Speed,
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

const LIMITED: u8 = 1;
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
        Self {
            age: AtomicU32::new(0),
            age_max: speed_divider.saturating_mul(2),
            mode: AtomicU8::new(Mode::Off as u8),
            i_q: AtomicI32::new(0),
            omega_e: AtomicI32::new(0),
            flags: AtomicU8::new(0),
        }
    }

    /// Speed task: what the current loop shall do from its next period on.
    pub fn ask(&self, reference: CurrentReference) {
        self.i_q.store(reference.i_q.to_bits(), Relaxed);
        self.mode.store(reference.mode as u8, Relaxed);
        self.age.store(0, Relaxed);
    }

    /// Current loop, once a period: what it shall do; nothing, if that was asked too long ago.
    ///
    /// The count of the reference's age is read and written in two steps, which is sound: the speed task, the other
    /// writer, is below and cannot come between them.
    #[must_use]
    #[inline(always)]
    pub fn asked(&self) -> Asked {
        let age = self.age.load(Relaxed).saturating_add(1);
        self.age.store(age, Relaxed);
        let stale = age > self.age_max;
        let mode = match self.mode.load(Relaxed) {
            _ if stale => Mode::Off,
            m if m == Mode::Drive as u8 => Mode::Drive,
            m if m == Mode::Calibrate as u8 => Mode::Calibrate,
            _ => Mode::Off,
        };
        let reference = CurrentReference {
            mode,
            i_q: Current::from_bits(self.i_q.load(Relaxed)),
        };
        Asked { reference, stale }
    }

    /// Current loop: what it found, and whether what it was asked was stale.
    #[inline(always)]
    pub fn publish(&self, estimate: &MotorEstimate, stale: bool) {
        let calibration = match estimate.calibration {
            Calibration::Pending => 0,
            Calibration::Done => CALIBRATED,
            Calibration::OutOfRange => ZERO_OUT_OF_RANGE,
        };
        let flag = |set: bool, bit: u8| if set { bit } else { 0 };
        let flags = flag(estimate.voltage_limited, LIMITED)
            | flag(estimate.broken, BROKEN)
            | flag(estimate.encoder_stuck, ENCODER_STUCK)
            | flag(stale, STALE)
            | calibration;
        self.omega_e
            .store(estimate.motion.omega_e.to_bits(), Relaxed);
        self.flags.store(flags, Relaxed);
    }

    /// Speed task: what the current loop found.
    #[must_use]
    pub fn status(&self) -> MotorStatus {
        let flags = self.flags.load(Relaxed);
        MotorStatus {
            omega_e: Speed::from_bits(self.omega_e.load(Relaxed)),
            voltage_limited: flags & LIMITED != 0,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_one_side_writes_the_other_reads() {
        let exchange = MotorExchange::new(4);
        assert_eq!(exchange.asked(), Asked::default());
        for mode in [Mode::Off, Mode::Calibrate, Mode::Drive] {
            let reference = CurrentReference {
                mode,
                i_q: Current::from_num(-1.25),
            };
            exchange.ask(reference);
            assert_eq!(exchange.asked().reference, reference);
        }
        for calibration in [
            Calibration::Pending,
            Calibration::Done,
            Calibration::OutOfRange,
        ] {
            for (voltage_limited, broken, encoder_stuck) in [
                (false, true, false),
                (true, false, false),
                (false, false, true),
            ] {
                let mut estimate = MotorEstimate {
                    calibration,
                    voltage_limited,
                    broken,
                    encoder_stuck,
                    ..Default::default()
                };
                estimate.motion.omega_e = Speed::from_num(-471.5);
                exchange.publish(&estimate, false);
                let status = MotorStatus {
                    omega_e: Speed::from_num(-471.5),
                    voltage_limited,
                    broken,
                    encoder_stuck,
                    reference_stale: false,
                    calibration,
                };
                assert_eq!(exchange.status(), status);
            }
        }
    }

    #[test]
    fn a_reference_that_is_not_renewed_switches_off_and_says_so() {
        let exchange = MotorExchange::new(4);
        let reference = CurrentReference {
            mode: Mode::Drive,
            i_q: Current::ONE,
        };
        exchange.ask(reference);
        for _ in 0..8 {
            let stale = false;
            assert_eq!(exchange.asked(), Asked { reference, stale });
        }
        let asked = exchange.asked();
        assert_eq!((asked.reference.mode, asked.stale), (Mode::Off, true));
        exchange.publish(&MotorEstimate::default(), asked.stale);
        assert!(exchange.status().reference_stale);
        exchange.ask(reference);
        let asked = exchange.asked();
        assert_eq!(asked.reference, reference);
        exchange.publish(&MotorEstimate::default(), asked.stale);
        assert!(!exchange.status().reference_stale);
    }
}
