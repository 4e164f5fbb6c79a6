//! The words that pass between the interrupts of different priority: one word each, so no lock.
//!
//! The speed task writes [`MotorExchange`]'s reference, the current loop reads it; the current loop writes what it
//! measures, the tasks below read it. Each word is whole by itself, and none means anything only together with another
//! but where it is said, so relaxed ordering on a single core is enough.

use crate::base::format::{Angle, Current, ScaledCurrent, Voltage};
use crate::current::current_loop::config::CurrentLoopConfig;
use crate::current::current_loop::words::{
    Calibration, CurrentReference, Frame, Measured, Mode, Rested,
};
use crate::current::modulation::BusScale;
use crate::current::observer::EncoderAlignment;
use crate::current::sense::{Codes, Shunts};
use crate::current::transform::DirectQuadrature;
use core::hint::cold_path;
use core::sync::atomic::{
    AtomicBool, AtomicI32, AtomicU8, AtomicU16, AtomicU32, Ordering::Relaxed,
};

/// Words between one motor's current loop and the tasks below it.
#[derive(Debug)]
pub struct MotorExchange {
    /// Periods of the current loop, modulo 2^32.
    periods: AtomicU32,
    /// The period with which the reference to go on driving in the rotor's frame ends; over when there is none.
    drive_until: AtomicU32,
    /// Current references.
    i_q: AtomicI32,
    i_d: AtomicI32,
    /// How voltages become compare values near the bus.
    bus_scale: [AtomicI32; 2],
    /// The bus, ADC counts.
    bus: AtomicU16,
    /// What stands in the way of driving. Written while the rotor's frame is not driven; while it is, nothing does.
    flags: AtomicU8,
    /// One of the `ASKED_` codes.
    mode: AtomicU8,
    /// Mechanical angle a sample, 2^-32 turn.
    theta_step: AtomicI32,
    /// Measured currents d and q.
    current: [AtomicI32; 2],
    /// Codes of the phases.
    codes: [AtomicI32; 3],
    /// The encoder's count within the turn.
    encoder: AtomicU32,
    /// Voltages d and q of the last four periods: a period's are at its number modulo 4.
    voltages: [[AtomicI32; 2]; 4],
    /// The last period in which the voltage circle cut the voltage.
    limited_period: AtomicU32,
    /// The period with which any reference ends.
    until: AtomicU32,
    /// Electrical angle of a commanded frame.
    commanded: AtomicU32,
    /// Electrical angle at the encoder's count zero.
    theta_e_at_zero: AtomicU32,
    /// One of the `ALIGNED_` codes.
    alignment: AtomicU8,
    /// The current loop has yet to take the alignment: the next reference is given so that it does.
    aligned_anew: AtomicBool,
    /// Periods whose compare values came too late.
    missed: AtomicU32,
    /// Readings of the encoder that were wrong.
    wrong_readings: AtomicU32,
    /// Each period is kept by somebody.
    watched: AtomicBool,
    valid_periods: u32,
}

/// What a current loop is asked that shall not drive its bridge in the rotor's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Asked {
    /// What it shall do.
    pub mode: Mode,
    /// In which frame.
    pub frame: Frame,
    /// What was asked is too old to follow: the speed task is late.
    pub stale: bool,
}

/// What the speed task sees of a motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MotorStatus {
    /// Mechanical angle a period of its current loop, 2^-32 turn, in the rotor's sense.
    pub theta_step: i32,
    /// The voltage circle cut the last step.
    pub voltage_limited: bool,
    /// The bridge is stopped by its break input.
    pub broken: bool,
    /// A measured current was beyond its limit: the current loop has stopped its bridge by itself.
    pub over_current: bool,
    /// The encoder's count stands while the shaft turns, or too many of its readings are wrong.
    pub encoder_stuck: bool,
    /// The speed task was late with its reference: the current loop has stopped its bridge by itself.
    pub reference_stale: bool,
    /// The current loop knows the rotor's angle.
    pub angle_known: bool,
    /// How far the offset calibration is.
    pub calibration: Calibration,
}

const CLOSED: u8 = 1;
const BROKEN: u8 = 1 << 1;
const CALIBRATED: u8 = 1 << 2;
const ZERO_OUT_OF_RANGE: u8 = 1 << 3;
const ENCODER_STUCK: u8 = 1 << 4;
const STALE: u8 = 1 << 5;
const OVER_CURRENT: u8 = 1 << 6;
const ANGLE_KNOWN: u8 = 1 << 7;

const ASKED_OFF: u8 = 0;
const ASKED_CALIBRATE: u8 = 1;
const ASKED_DRIVE: u8 = 2;
const ASKED_DRIVE_COMMANDED: u8 = 3;
const ASKED_RESET: u8 = 4;
const ASKED_SHORT: u8 = 5;

const ALIGNED_NOT: u8 = 0;
const ALIGNED: u8 = 1;
const ALIGNED_REVERSED: u8 = 2;
const ALIGNED_BEFORE_INDEX: u8 = 3;
const ALIGNED_REVERSED_BEFORE_INDEX: u8 = 4;

impl MotorExchange {
    /// No mode, no current, no speed: how every drive starts, with what `config` knows of its encoder. A reference holds for
    /// two steps of a speed task that runs every `speed_divider` periods; past that the current loop opens its bridge.
    #[must_use]
    pub const fn new(config: &CurrentLoopConfig, speed_divider: u32) -> Self {
        let valid_periods = speed_divider.saturating_mul(2);
        let (theta_e_at_zero, alignment) = alignment_words(config.alignment);
        Self {
            periods: AtomicU32::new(0),
            drive_until: AtomicU32::new(0),
            i_q: AtomicI32::new(0),
            i_d: AtomicI32::new(0),
            bus_scale: [const { AtomicI32::new(0) }; 2],
            bus: AtomicU16::new(0),
            flags: AtomicU8::new(0),
            mode: AtomicU8::new(ASKED_OFF),
            theta_step: AtomicI32::new(0),
            current: [const { AtomicI32::new(0) }; 2],
            codes: [const { AtomicI32::new(0) }; 3],
            encoder: AtomicU32::new(0),
            voltages: [const { [const { AtomicI32::new(0) }; 2] }; 4],
            limited_period: AtomicU32::new(u32::MAX),
            until: AtomicU32::new(valid_periods),
            commanded: AtomicU32::new(0),
            theta_e_at_zero: AtomicU32::new(theta_e_at_zero),
            alignment: AtomicU8::new(alignment),
            aligned_anew: AtomicBool::new(false),
            missed: AtomicU32::new(0),
            wrong_readings: AtomicU32::new(0),
            watched: AtomicBool::new(false),
            valid_periods,
        }
    }

    /// Before the current loop's first period: what `config` knows of its encoder, where that was not known when this was made.
    pub fn start(&self, config: &CurrentLoopConfig) {
        let (theta_e_at_zero, alignment) = alignment_words(config.alignment);
        self.theta_e_at_zero.store(theta_e_at_zero, Relaxed);
        self.alignment.store(alignment, Relaxed);
    }

    /// Speed task: what the current loop of `config` shall do from its next period on.
    #[inline(always)]
    pub fn ask(&self, reference: CurrentReference, config: &CurrentLoopConfig) {
        self.ask_between(reference, config, || ());
    }

    /// Speed task: [`MotorExchange::ask`] of a drive in the rotor's frame that goes on, with the `i_d` that it has: no
    /// alignment has come since, or the bridge is open and its loop looks at it before it closes it.
    #[inline(always)]
    pub fn ask_on(&self, i_q: Current, config: &CurrentLoopConfig) {
        let periods = self.periods.load(Relaxed);
        let until = periods.wrapping_add(self.valid_periods);
        self.ask_words(
            i_q,
            config,
            ASKED_DRIVE,
            [until, self.drive_until(periods, until)],
            &mut || (),
        );
    }

    /// A task below the speed task, while that asks by [`MotorExchange::ask_on`]: the current along d, A, within half of its
    /// word. It holds until the drive comes to rest: [`MotorExchange::ask`] takes it back.
    pub fn ask_d(&self, i_d: Current, config: &CurrentLoopConfig) {
        self.i_d.store(config.sense.scale.scaled(i_d).0, Relaxed);
    }

    /// How long a drive in the rotor's frame may go on: not at all before the loop has closed the bridge.
    #[inline(always)]
    fn drive_until(&self, periods: u32, until: u32) -> u32 {
        if self.flags.load(Relaxed) & CLOSED != 0 {
            until
        } else {
            periods
        }
    }

    /// [`MotorExchange::ask`], with `between` called after each store but the last.
    ///
    /// The current loop may come between any two of them. It drives by `mode` or by `drive_until`, which come last, and calls
    /// a reference stale only by `until`. Where the drive is ended, or the frame changes, the old frame may see the new
    /// currents for a period.
    #[inline(always)]
    fn ask_between(
        &self,
        reference: CurrentReference,
        config: &CurrentLoopConfig,
        mut between: impl FnMut(),
    ) {
        let periods = self.periods.load(Relaxed);
        let until = periods.wrapping_add(self.valid_periods);
        let (mode, drive_until) = match (reference.mode, reference.frame) {
            (Mode::Drive, Frame::Rotor) if self.aligned_anew.load(Relaxed) => {
                // The loop's long way, on which it looks at the alignment.
                cold_path();
                self.aligned_anew.store(false, Relaxed);
                (ASKED_DRIVE, periods)
            }
            (Mode::Drive, Frame::Rotor) => (ASKED_DRIVE, self.drive_until(periods, until)),
            (Mode::Drive, Frame::Commanded(angle)) => {
                cold_path();
                self.commanded.store(angle.0, Relaxed);
                (ASKED_DRIVE_COMMANDED, periods)
            }
            (Mode::Off, _) => (ASKED_OFF, periods),
            (Mode::Calibrate, _) => (ASKED_CALIBRATE, periods),
            (Mode::Reset, _) => (ASKED_RESET, periods),
            (Mode::Short, _) => (ASKED_SHORT, periods),
        };
        self.ask_d(reference.i_d, config);
        between();
        let deadlines = [until, drive_until];
        self.ask_words(reference.i_q, config, mode, deadlines, &mut between);
    }

    #[inline(always)]
    fn ask_words(
        &self,
        i_q: Current,
        config: &CurrentLoopConfig,
        mode: u8,
        [until, drive_until]: [u32; 2],
        between: &mut impl FnMut(),
    ) {
        self.until.store(until, Relaxed);
        between();
        self.i_q.store(config.sense.scale.scaled(i_q).0, Relaxed);
        between();
        self.mode.store(mode, Relaxed);
        between();
        self.drive_until.store(drive_until, Relaxed);
    }

    /// Speed task: how voltages become compare values near the bus that was last measured.
    #[inline(always)]
    pub fn expect_bus(&self, config: &CurrentLoopConfig) {
        let BusScale { at_zero, slope } = config.modulation.bus_scale(self.bus.load(Relaxed));
        for (word, value) in self.bus_scale.iter().zip([at_zero, slope]) {
            word.store(value, Relaxed);
        }
    }

    /// Speed task: how the encoder lies to its rotor; `None`: that is not known any more. The current loop takes it
    /// with the next reference.
    ///
    /// Where the encoder counts as it did, the loop may have passed the index since the task read `from`, and knows better:
    /// then nothing changes.
    pub fn align(&self, from: Option<EncoderAlignment>, alignment: Option<EncoderAlignment>) {
        let (theta_e_at_zero, code) = alignment_words(alignment);
        if let (Some(from), Some(to)) = (from, alignment)
            && from.reversed == to.reversed
        {
            let (known, angle) = (from.theta_e_at_zero.0, &self.theta_e_at_zero);
            let moved = angle.compare_exchange(known, theta_e_at_zero, Relaxed, Relaxed);
            if moved.is_ok() && !to.index_awaited {
                self.alignment.store(code, Relaxed);
            }
            self.aligned_anew.store(true, Relaxed);
            return;
        }
        // The loop may come between the two: by the first alone nothing changes.
        self.alignment.store(ALIGNED_NOT, Relaxed);
        self.theta_e_at_zero.store(theta_e_at_zero, Relaxed);
        self.alignment.store(code, Relaxed);
        self.aligned_anew.store(true, Relaxed);
    }

    /// How the encoder lies to its rotor, as far as it is known.
    #[must_use]
    pub fn alignment(&self) -> Option<EncoderAlignment> {
        let (reversed, index_awaited) = match self.alignment.load(Relaxed) {
            ALIGNED => (false, false),
            ALIGNED_REVERSED => (true, false),
            ALIGNED_BEFORE_INDEX => (false, true),
            ALIGNED_REVERSED_BEFORE_INDEX => (true, true),
            _ => return None,
        };
        Some(EncoderAlignment {
            reversed,
            theta_e_at_zero: Angle(self.theta_e_at_zero.load(Relaxed)),
            index_awaited,
        })
    }

    /// Current loop: the index was passed, and the encoder lies like this from now on.
    #[cold]
    pub(crate) fn publish_index(&self, alignment: EncoderAlignment) {
        let (theta_e_at_zero, code) = alignment_words(Some(alignment));
        self.theta_e_at_zero.store(theta_e_at_zero, Relaxed);
        self.alignment.store(code, Relaxed);
    }

    /// Current loop, once a period, first of all: `true` if it has closed its bridge for currents in the rotor's frame and
    /// shall go on, and the reference is fresh.
    ///
    /// A speed task that has not run for 2^31 periods, more than half a day, would be taken for one that has; the
    /// watchdog ends that within milliseconds.
    #[must_use]
    #[inline(always)]
    pub fn begin_period(&self) -> bool {
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

    /// Current loop, where it shall drive: the current references, within half of their word.
    #[must_use]
    #[inline(always)]
    pub fn reference(&self) -> DirectQuadrature<ScaledCurrent> {
        DirectQuadrature {
            d: ScaledCurrent(self.i_d.load(Relaxed)),
            q: ScaledCurrent(self.i_q.load(Relaxed)),
        }
    }

    /// Current loop, where it shall drive: how voltages become compare values near the bus of one of the last two speed
    /// steps. Should the speed task be between its words, they are two steps' of a bus that hardly changes.
    #[must_use]
    #[inline(always)]
    pub fn bus_scale(&self) -> BusScale {
        let [at_zero, slope] = &self.bus_scale;
        BusScale {
            at_zero: at_zero.load(Relaxed),
            slope: slope.load(Relaxed),
        }
    }

    /// Current loop, where it shall not or cannot drive in the rotor's frame: what else.
    #[must_use]
    pub fn asked(&self) -> Asked {
        let stale = over(self.until.load(Relaxed), self.periods.load(Relaxed));
        let (mode, frame) = match self.mode.load(Relaxed) {
            _ if stale => (Mode::Off, Frame::Rotor),
            ASKED_DRIVE => (Mode::Drive, Frame::Rotor),
            ASKED_DRIVE_COMMANDED => {
                let angle = Angle(self.commanded.load(Relaxed));
                (Mode::Drive, Frame::Commanded(angle))
            }
            ASKED_CALIBRATE => (Mode::Calibrate, Frame::Rotor),
            ASKED_RESET => (Mode::Reset, Frame::Rotor),
            ASKED_SHORT => (Mode::Short, Frame::Rotor),
            _ => (Mode::Off, Frame::Rotor),
        };
        Asked { mode, frame, stale }
    }

    /// Current loop: the encoder's count, if its reading arrived whole, and how far the shaft turns in a period, 2^-32 turn.
    #[inline(always)]
    pub fn publish_shaft(&self, counts: Option<u32>, theta_step: i32) {
        if let Some(counts) = counts {
            self.encoder.store(counts, Relaxed);
        }
        self.theta_step.store(theta_step, Relaxed);
    }

    /// Current loop: the measured currents; of phase c only where it is measured.
    #[inline(always)]
    pub fn publish_currents(&self, measured: &Measured, shunts: Shunts) {
        let [a, b, c] = measured.codes;
        let [word_a, word_b, word_c] = &self.codes;
        word_a.store(a, Relaxed);
        word_b.store(b, Relaxed);
        if shunts == Shunts::Three {
            word_c.store(c, Relaxed);
        }
        let [d, q] = &self.current;
        d.store(measured.current.d.0, Relaxed);
        q.store(measured.current.q.0, Relaxed);
    }

    /// Current loop: the bus, ADC counts.
    #[inline(always)]
    pub fn publish_bus(&self, counts: u16) {
        self.bus.store(counts, Relaxed);
    }

    /// Current loop: the voltage that it asks of the bridge.
    #[inline(always)]
    pub fn publish_voltage(&self, voltage: DirectQuadrature<Voltage>) {
        let [d, q] = self.voltage_words(self.periods.load(Relaxed));
        d.store(voltage.d.to_bits(), Relaxed);
        q.store(voltage.q.to_bits(), Relaxed);
    }

    /// Current loop, in a period in which the voltage circle cuts its voltage.
    #[inline(always)]
    pub fn publish_limited(&self) {
        self.limited_period
            .store(self.periods.load(Relaxed), Relaxed);
    }

    /// Current loop, in a period that is not driven in the rotor's frame: how far the calibration is, what stops the bridge,
    /// and whether what was asked was stale.
    pub fn publish_rest(&self, rested: Rested, stale: bool) {
        let calibration = match rested.calibration {
            Calibration::Pending => 0,
            Calibration::Done => CALIBRATED,
            Calibration::OutOfRange => ZERO_OUT_OF_RANGE,
        };
        let flag = |set: bool, bit: u8| if set { bit } else { 0 };
        let flags = flag(rested.broken, BROKEN)
            | flag(rested.closed, CLOSED)
            | flag(rested.over_current, OVER_CURRENT)
            | flag(rested.encoder_stuck, ENCODER_STUCK)
            | flag(rested.angle_known, ANGLE_KNOWN)
            | flag(stale, STALE)
            | calibration;
        self.flags.store(flags, Relaxed);
    }

    /// Current loop, in a period whose compare values came too late.
    #[cold]
    #[inline(never)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    pub fn publish_missed(&self) {
        count(&self.missed);
    }

    /// Current loop, in a period in which the encoder's reading was wrong.
    #[cold]
    #[inline(never)]
    pub fn publish_wrong_reading(&self) {
        count(&self.wrong_readings);
    }

    /// Whether each period is to be kept by who looks at these words after it: see [`MotorExchange::is_watched`].
    pub fn watch(&self, watched: bool) {
        self.watched.store(watched, Relaxed);
    }

    /// After a period of the current loop: it is to be kept.
    #[must_use]
    #[inline(always)]
    pub fn is_watched(&self) -> bool {
        self.watched.load(Relaxed)
    }

    /// Periods of the current loop, modulo 2^32.
    #[must_use]
    pub fn periods(&self) -> u32 {
        self.periods.load(Relaxed)
    }

    /// Periods whose compare values came too late, modulo 2^32.
    #[must_use]
    pub fn missed(&self) -> u32 {
        self.missed.load(Relaxed)
    }

    /// Readings of the encoder that were wrong, modulo 2^32.
    #[must_use]
    pub fn wrong_readings(&self) -> u32 {
        self.wrong_readings.load(Relaxed)
    }

    /// The encoder's count within the turn.
    #[must_use]
    #[inline(always)]
    pub fn encoder(&self) -> u32 {
        self.encoder.load(Relaxed)
    }

    /// The bus voltage, ADC counts.
    #[must_use]
    #[inline(always)]
    pub fn bus(&self) -> u16 {
        self.bus.load(Relaxed)
    }

    /// Codes of the phases.
    #[must_use]
    #[inline(always)]
    pub fn codes(&self) -> Codes {
        self.codes.each_ref().map(|word| word.load(Relaxed))
    }

    /// Codes of the phases, all of one period: for a task that the current loop interrupts.
    #[must_use]
    pub fn codes_of_one_period(&self) -> Codes {
        let mut codes = self.codes();
        // A loop comes once in a period, so the second reading is whole.
        for _ in 0..2 {
            let before = self.periods();
            codes = self.codes();
            if self.periods() == before {
                break;
            }
        }
        codes
    }

    /// The measured current, in the frame that was controlled.
    #[must_use]
    #[inline(always)]
    pub fn current(&self) -> DirectQuadrature<ScaledCurrent> {
        let [d, q] = &self.current;
        DirectQuadrature {
            d: ScaledCurrent(d.load(Relaxed)),
            q: ScaledCurrent(q.load(Relaxed)),
        }
    }

    /// The voltage that was asked of the bridge in period `period`, one of the last four. It acts from the next period on:
    /// what acted in the period that ended with the last sample is the one of two periods before it.
    #[must_use]
    #[inline(always)]
    pub fn voltage(&self, period: u32) -> DirectQuadrature<Voltage> {
        let [d, q] = self.voltage_words(period);
        DirectQuadrature {
            d: Voltage::from_bits(d.load(Relaxed)),
            q: Voltage::from_bits(q.load(Relaxed)),
        }
    }

    #[inline(always)]
    #[allow(clippy::indexing_slicing)]
    fn voltage_words(&self, period: u32) -> &[AtomicI32; 2] {
        // Two bits are within the four.
        &self.voltages[(period & 3) as usize]
    }

    /// Speed task: how far the shaft turns in a period, 2^-32 turn.
    #[must_use]
    #[inline(always)]
    pub fn theta_step(&self) -> i32 {
        self.theta_step.load(Relaxed)
    }

    /// Speed task: the voltage circle cut the last period's voltage.
    #[must_use]
    #[inline(always)]
    pub fn voltage_limited(&self) -> bool {
        self.limited_period.load(Relaxed) == self.periods.load(Relaxed)
    }

    /// Speed task: the current loop has found what is a fault of the drive; [`MotorExchange::status`] says what.
    #[must_use]
    #[inline(always)]
    pub fn says_fault(&self) -> bool {
        self.faults() != 0
    }

    /// The same as a word that is 0 if it has found none.
    #[must_use]
    #[inline(always)]
    pub(crate) fn faults(&self) -> u32 {
        const FAULTS: u8 = BROKEN | OVER_CURRENT | ENCODER_STUCK | STALE | ZERO_OUT_OF_RANGE;
        u32::from(self.flags.load(Relaxed) & FAULTS)
    }

    /// Speed task: the current loop has closed its bridge, and its current is what is asked.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.flags.load(Relaxed) & CLOSED != 0
    }

    /// Speed task: what the current loop found.
    #[must_use]
    #[inline(always)]
    pub fn status(&self) -> MotorStatus {
        let flags = self.flags.load(Relaxed);
        MotorStatus {
            theta_step: self.theta_step(),
            voltage_limited: self.voltage_limited(),
            broken: flags & BROKEN != 0,
            over_current: flags & OVER_CURRENT != 0,
            encoder_stuck: flags & ENCODER_STUCK != 0,
            reference_stale: flags & STALE != 0,
            angle_known: flags & ANGLE_KNOWN != 0,
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

/// Counts a word up. Only the word's one writer may call it.
fn count(word: &AtomicU32) {
    word.store(word.load(Relaxed).wrapping_add(1), Relaxed);
}

/// An alignment in its two words.
const fn alignment_words(alignment: Option<EncoderAlignment>) -> (u32, u8) {
    match alignment {
        None => (0, ALIGNED_NOT),
        Some(EncoderAlignment {
            reversed,
            theta_e_at_zero,
            index_awaited,
        }) => {
            let code = match (reversed, index_awaited) {
                (false, false) => ALIGNED,
                (true, false) => ALIGNED_REVERSED,
                (false, true) => ALIGNED_BEFORE_INDEX,
                (true, true) => ALIGNED_REVERSED_BEFORE_INDEX,
            };
            (theta_e_at_zero.0, code)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::format::Current;
    use crate::plate::test_plate;

    fn config() -> CurrentLoopConfig {
        let plate = test_plate();
        plate.motors[0].current_loop(&plate).unwrap()
    }

    const ONE_AMPERE: CurrentReference = CurrentReference {
        mode: Mode::Drive,
        frame: Frame::Rotor,
        i_d: Current::ONE,
        i_q: Current::NEG_ONE,
    };

    /// Words of a motor whose bridge is closed.
    fn closed() -> MotorExchange {
        let exchange = MotorExchange::new(&config(), 4);
        let rested = Rested {
            closed: true,
            ..Rested::default()
        };
        exchange.publish_rest(rested, false);
        exchange
    }

    #[test]
    fn a_bridge_is_closed_before_it_is_driven() {
        let exchange = MotorExchange::new(&config(), 4);
        exchange.ask(ONE_AMPERE, &config());
        assert!(!exchange.begin_period());
        assert_eq!(exchange.asked().mode, Mode::Drive);
    }

    #[test]
    fn a_direct_current_holds_until_the_drive_comes_to_rest() {
        let exchange = closed();
        let config = config();
        let i_d = || config.sense.scale.current(exchange.reference().d);
        exchange.ask(
            CurrentReference {
                i_d: Current::ZERO,
                ..ONE_AMPERE
            },
            &config,
        );
        exchange.ask_d(Current::ONE, &config);
        exchange.ask_on(Current::NEG_ONE, &config);
        assert_eq!(i_d(), Current::ONE);
        exchange.ask(CurrentReference::default(), &config);
        assert_eq!(i_d(), Current::ZERO);
    }

    #[test]
    fn what_one_side_writes_the_other_reads() {
        let exchange = closed();
        assert!(!exchange.begin_period());
        assert_eq!(exchange.asked(), Asked::default());
        for mode in [
            Mode::Off,
            Mode::Calibrate,
            Mode::Reset,
            Mode::Short,
            Mode::Drive,
        ] {
            exchange.ask(CurrentReference { mode, ..ONE_AMPERE }, &config());
            let drive = mode == Mode::Drive;
            assert_eq!(exchange.begin_period(), drive);
            let current = |i| config().sense.scale.current(i);
            let DirectQuadrature { d, q } = exchange.reference();
            assert_eq!((current(d), current(q)), (Current::ONE, Current::NEG_ONE));
            let asked = Asked {
                mode,
                ..Asked::default()
            };
            assert_eq!(exchange.asked(), asked);
        }
        for calibration in [
            Calibration::Pending,
            Calibration::Done,
            Calibration::OutOfRange,
        ] {
            for flag in 0..5 {
                let [broken, encoder_stuck, over_current, angle_known] =
                    [1, 2, 3, 4].map(|n| flag == n);
                let rested = Rested {
                    calibration,
                    broken,
                    over_current,
                    encoder_stuck,
                    angle_known,
                    closed: false,
                };
                exchange.publish_shaft(None, -471);
                exchange.publish_rest(rested, false);
                let status = MotorStatus {
                    theta_step: -471,
                    voltage_limited: false,
                    broken,
                    over_current,
                    encoder_stuck,
                    angle_known,
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
                let _ = exchange.begin_period();
                assert_eq!(exchange.status(), status, "only the last period counts");
            }
        }
    }

    #[test]
    fn a_reference_that_is_not_renewed_switches_off_and_says_so() {
        let exchange = closed();
        exchange.ask(ONE_AMPERE, &config());
        for _ in 0..8 {
            assert!(exchange.begin_period());
        }
        for _ in 0..20 {
            assert!(!exchange.begin_period());
            let asked = exchange.asked();
            assert_eq!((asked.mode, asked.stale), (Mode::Off, true));
            exchange.publish_rest(Rested::default(), asked.stale);
            assert!(exchange.status().reference_stale);
        }
        // The speed task sees it when it is back, and asks for nothing until the fault is reset.
        exchange.ask(CurrentReference::default(), &config());
        assert!(!exchange.begin_period());
        let asked = exchange.asked();
        assert!(!asked.stale);
        exchange.publish_rest(Rested::default(), asked.stale);
        assert!(!exchange.status().reference_stale);
        exchange.ask(ONE_AMPERE, &config());
        assert!(!exchange.begin_period(), "the bridge is open by now");
        assert_eq!(exchange.asked().mode, Mode::Drive);
    }

    /// A new deadline comes after all that it is the deadline of: wherever the current loop interrupts the speed task, it
    /// goes on driving only by a reference that is whole, and within its own age.
    #[test]
    fn an_old_reference_is_not_driven_on_by_a_new_deadline() {
        let new = CurrentReference {
            i_d: Current::NEG_ONE,
            i_q: Current::ONE,
            ..ONE_AMPERE
        };
        let mut interrupted = 0;
        for at in 0.. {
            let exchange = closed();
            exchange.ask(ONE_AMPERE, &config());
            for _ in 0..8 {
                assert!(exchange.begin_period());
            }
            // The old one is at its age.
            let (mut store, mut seen) = (0, None);
            exchange.ask_between(new, &config(), || {
                if store == at {
                    seen = Some((exchange.begin_period(), exchange.reference()));
                }
                store += 1;
            });
            let whole = exchange.reference();
            let Some((drives, read)) = seen else {
                assert_eq!(at, store, "one interruption after each store but the last");
                break;
            };
            interrupted += 1;
            assert!(
                !drives || read == whole,
                "after store {at} of {store} the loop drives on by {read:?}, which is past its age; asked is {whole:?}"
            );
        }
        assert!(interrupted >= 4, "interrupted after {interrupted} stores");
    }

    #[test]
    fn the_count_of_periods_may_wrap() {
        let exchange = closed();
        exchange.periods.store(u32::MAX - 3, Relaxed);
        exchange.ask(ONE_AMPERE, &config());
        for _ in 0..8 {
            assert!(exchange.begin_period());
        }
        assert!(!exchange.begin_period());
        assert!(exchange.asked().stale);
    }
}
