//! ADC counts -> codes, currents and bus voltage.
//!
//! A code is a count above its zero, shifted up until the ADC's range fills a word: one subtraction. What a code is worth
//! in amperes, and with which sign, is part of the factors that the Clarke transform multiplies with.

use crate::base::format::{
    Current, CurrentScale, ScaledCurrent, TableVelocity, Voltage, multiply_upper, narrow_bits,
};
use crate::current::transform::AlphaBeta;

/// Which phases have a current sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shunts {
    /// Phases a and b; c is minus their sum.
    Two,
    /// All three; what is common to them is sensor error and drops out.
    Three,
}

/// How far from its place by design a healthy sensor's zero may be, counts: 1/16 of a 12-bit range.
pub const ZERO_TOLERANCE_COUNTS: u32 = 256;

/// Codes of the channels of phases a, b, c.
pub type Codes = [i32; 3];

/// Current channels of one motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentSense {
    /// Which of the channels are there; with [`Shunts::Two`] nothing of c is used.
    pub shunts: Shunts,
    /// Counts are shifted up by this: 31 less the ADC's bits, 15 to 21.
    pub code_shift: u32,
    /// Codes of the counts at zero current by design.
    pub zeros: Codes,
    /// What a code of each channel adds to the vector, in 2^-32 of the vector's unit, which is half of a
    /// [`ScaledCurrent`]'s: power-invariant Clarke times amperes per code.
    pub clarke: AlphaBeta<[i32; 3]>,
    /// Amperes per code, in 2^-32 of a [`ScaledCurrent`]'s unit.
    pub amperes: [i32; 3],
    /// Unit of the currents in the rotor's frame.
    pub scale: CurrentScale,
}

impl CurrentSense {
    /// The codes of `counts` over `zeros`. A count beyond the ADC's range is taken modulo the range.
    #[must_use]
    #[inline(always)]
    pub fn codes(&self, counts: [u16; 3], zeros: Codes) -> Codes {
        Self::codes_at(self.code_shift, counts, zeros)
    }

    /// The same with the shift as a board says it, as a constant where it is one.
    #[inline(always)]
    pub(crate) fn codes_at(code_shift: u32, counts: [u16; 3], zeros: Codes) -> Codes {
        let ([na, nb, nc], [za, zb, zc]) = (counts, zeros);
        // What the ADC gives and zeros are 31 bits, so that their differences fit.
        let code = |n: u16, zero: i32| {
            let code = u32::from(n).wrapping_shl(code_shift).cast_signed();
            code.wrapping_sub(zero)
        };
        [code(na, za), code(nb, zb), code(nc, zc)]
    }

    /// The phases as a vector in the stator's frame, in half of a [`ScaledCurrent`]'s unit.
    ///
    /// Cannot overflow: the scale leaves the largest factor below 2^31, which is that of b in beta; the others of a row
    /// are at most as large together. The vector is at most 1.74 * 2^30 long.
    #[must_use]
    #[inline(always)]
    #[allow(clippy::arithmetic_side_effects)]
    pub fn vector(&self, codes: Codes) -> AlphaBeta<i32> {
        self.vector_of(self.shunts, codes)
    }

    /// The same with the sensors as a board says them, as a constant where they are one.
    #[inline(always)]
    #[allow(clippy::arithmetic_side_effects)]
    pub(crate) fn vector_of(&self, shunts: Shunts, [a, b, c]: Codes) -> AlphaBeta<i32> {
        let AlphaBeta {
            alpha: [ka, kb, kc],
            beta: [la, lb, lc],
        } = &self.clarke;
        let (ka, kb, kc, la, lb, lc) = (*ka, *kb, *kc, *la, *lb, *lc);
        match shunts {
            Shunts::Two => AlphaBeta {
                alpha: multiply_upper(a, ka),
                beta: multiply_upper(a, la) + multiply_upper(b, lb),
            },
            Shunts::Three => AlphaBeta {
                alpha: multiply_upper(a, ka) + multiply_upper(b, kb) + multiply_upper(c, kc),
                beta: multiply_upper(b, lb) + multiply_upper(c, lc),
            },
        }
    }

    /// The phase currents, for records: the loop itself does not need them.
    #[must_use]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    pub fn phases(&self, codes: Codes) -> [Current; 3] {
        let ([a, b, c], [ga, gb, gc]) = (codes, self.amperes);
        let current = |code, gain| {
            self.scale
                .current(ScaledCurrent(multiply_upper(code, gain)))
        };
        let (a, b) = (current(a, ga), current(b, gb));
        let c = match self.shunts {
            Shunts::Two => a.saturating_add(b).saturating_neg(),
            Shunts::Three => current(c, gc),
        };
        [a, b, c]
    }

    /// The code of phase a (0) or b (1) at a current, and whether codes fall where the current rises; `None` beyond a code's word.
    #[must_use]
    pub fn code(&self, phase: usize, current: Current) -> Option<(i32, bool)> {
        let gain = *self.amperes.get(phase)?;
        let ScaledCurrent(scaled) = self.scale.scaled(current);
        let code = (i64::from(scaled) << 32).checked_div(gain.into())?;
        Some((i32::try_from(code).ok()?, gain < 0))
    }

    /// What three channels add up to, which is nothing while all current comes back; none with two.
    #[must_use]
    #[inline(always)]
    pub fn sum(&self, [a, b, c]: Codes) -> Option<ScaledCurrent> {
        let [ga, gb, gc] = self.amperes;
        match self.shunts {
            Shunts::Two => None,
            Shunts::Three => Some(ScaledCurrent(
                multiply_upper(a, ga)
                    .saturating_add(multiply_upper(b, gb))
                    .saturating_add(multiply_upper(c, gc)),
            )),
        }
    }

    /// The zeros are as near to those by design as a healthy sensor's: within [`ZERO_TOLERANCE_COUNTS`].
    #[must_use]
    pub fn healthy(&self, zeros: Codes) -> bool {
        let channels = match self.shunts {
            Shunts::Two => 2,
            Shunts::Three => 3,
        };
        let tolerance = ZERO_TOLERANCE_COUNTS.wrapping_shl(self.code_shift);
        let mut pairs = self.zeros.iter().zip(zeros).take(channels);
        pairs.all(|(nominal, zero)| nominal.abs_diff(zero) <= tolerance)
    }
}

/// The bus voltage channel: `V = counts * gain`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BusSense {
    /// V per count, ±8.
    pub gain: TableVelocity,
}

impl BusSense {
    /// The voltage that `counts` stand for.
    #[must_use]
    pub fn voltage(&self, counts: u16) -> Voltage {
        narrow_bits(
            i64::from(counts).wrapping_mul(i64::from(self.gain.to_bits())),
            10,
        )
    }
}

/// How many samples an offset calibration averages, as a power of two: 1024 samples are 51 ms at 20 kHz and
/// leave a thirtieth of the noise of one.
const CALIBRATION_SHIFT: u32 = 10;

/// Averages the current channels while no current flows, to find their zeros.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ZeroCalibration {
    sums: [u32; 3],
    samples: u32,
}

impl ZeroCalibration {
    /// No sample yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            sums: [0; 3],
            samples: 0,
        }
    }

    /// Takes one sample of the three channels; the zeros, as codes of `sense`, once there are enough.
    pub fn take(&mut self, sense: &CurrentSense, counts: [u16; 3]) -> Option<Codes> {
        // 2^10 samples of 16 bits fit 26 bits.
        let add = |sum: u32, count: u16| sum.saturating_add(u32::from(count));
        let ([a, b, c], [na, nb, nc]) = (self.sums, counts);
        self.sums = [add(a, na), add(b, nb), add(c, nc)];
        self.samples = self.samples.saturating_add(1);
        if self.samples < 1 << CALIBRATION_SHIFT {
            return None;
        }
        // The shift of a code is at least 15, so no bit of the sum is lost.
        let shift = sense.code_shift.saturating_sub(CALIBRATION_SHIFT);
        let zeros = self
            .sums
            .map(|sum| sum.wrapping_shl(shift).cast_signed() & i32::MAX);
        *self = Self::default();
        Some(zeros)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plate::{DrivePlate, test_plate};
    use core::f64::consts::{FRAC_1_SQRT_2, SQRT_2};
    use proptest::prelude::*;

    fn plate(adc_bits: u32, range: f64, shunts: Shunts) -> DrivePlate {
        let mut plate = test_plate();
        let counts = 1 << adc_bits;
        plate.board.shunts = shunts;
        plate.board.adc_counts = counts;
        plate.board.amps_per_count = range / f64::from(counts);
        plate.board.zero_counts = f64::from(counts) / 2.0;
        plate.board.bus_volts_per_count = 450.0 / f64::from(counts);
        // The gains of the loop must fit any range.
        plate.motors[0].torque_max_nm = 0.1;
        plate
    }

    fn sense(plate: &DrivePlate) -> CurrentSense {
        plate.motors[0].current_loop(plate).unwrap().sense
    }

    proptest! {
        #[test]
        fn counts_become_amperes_and_the_vector_is_their_clarke(
            adc_bits in 12u32..=16, range in 1.0..2000.0f64, at in prop::array::uniform3(0.0..1.0f64),
            sign in prop_oneof![Just(1.0), Just(-1.0)],
        ) {
            for shunts in [Shunts::Two, Shunts::Three] {
                let plate = plate(adc_bits, sign * range, shunts);
                let sense = sense(&plate);
                let counts = at.map(|at| (at * f64::from(1 << adc_bits)) as u16);
                let codes = sense.codes(counts, sense.zeros);
                let exact = counts.map(|n| (f64::from(n) - plate.board.zero_counts) * plate.board.amps_per_count);
                let got = sense.phases(codes).map(|i| i.to_num::<f64>());
                let [a, b, c] = match shunts {
                    Shunts::Two => [exact[0], exact[1], -exact[0] - exact[1]],
                    Shunts::Three => exact,
                };
                for (got, exact) in got.into_iter().zip([a, b, c]) {
                    prop_assert!((got - exact).abs() < 4e-6 + 1e-8 * range, "{got} A for {exact} A");
                }
                let unit = 2f64.powi(-(sense.scale.fraction as i32) - 1);
                let vector = sense.vector(codes);
                let alpha = (2f64 / 3.0).sqrt() * (a - (b + c) / 2.0);
                let beta = (b - c) * FRAC_1_SQRT_2;
                prop_assert!((f64::from(vector.alpha) * unit - alpha).abs() < 1e-8 * range);
                prop_assert!((f64::from(vector.beta) * unit - beta).abs() < 1e-8 * range);
                let sum = sense.sum(codes).map(|sum| sense.scale.current(sum).to_num::<f64>());
                let expected = exact.iter().sum::<f64>();
                prop_assert_eq!(sum.is_some(), shunts == Shunts::Three);
                if let Some(sum) = sum.filter(|_| expected.abs() < range) {
                    prop_assert!((sum - expected).abs() < 12e-6 + 3e-8 * range, "{sum} A for {expected} A");
                }
                // The scale is not wasteful: it leaves no more than two bits of the word.
                prop_assert!(range * SQRT_2 / unit > 2f64.powi(29));
            }
        }

        /// Debug builds panic where a sum would leave its format.
        #[test]
        fn extremes_do_not_wrap(
            counts in prop::array::uniform3(prop_oneof![any::<u16>(), Just(0), Just(4095)]),
            gains in prop::array::uniform3(0.51..1.99f64),
        ) {
            for (shunts, range) in [(Shunts::Two, 10.0), (Shunts::Three, 10.0), (Shunts::Two, -10.0), (Shunts::Three, -10.0)] {
                let mut plate = plate(12, range, shunts);
                let motor = &mut plate.motors[0];
                [
                    motor.current_gain_a,
                    motor.current_gain_b,
                    motor.current_gain_c,
                ] = gains;
                let sense = sense(&plate);
                for zeros in [[0; 3], sense.zeros, [i32::MAX; 3]] {
                    let vector = sense.vector(sense.codes(counts, zeros));
                    let length = f64::from(vector.alpha).hypot(f64::from(vector.beta));
                    prop_assert!(length < 1.74 * 2f64.powi(30));
                }
            }
        }
    }

    /// A low-side shunt's counts fall with the current into the motor: mirrored at the zero they are the same current.
    #[test]
    fn either_orientation_of_the_sensor_reads_the_same_current() {
        for shunts in [Shunts::Two, Shunts::Three] {
            let [inline, low_side] = [10.0, -10.0].map(|range| sense(&plate(12, range, shunts)));
            for counts in [[2048, 2048, 2048], [3000, 1500, 1644], [5, 4090, 2049]] {
                let codes = inline.codes(counts, inline.zeros);
                let mirrored = counts.map(|n| 4096 - n);
                let other = low_side.codes(mirrored, low_side.zeros);
                let (v, w) = (inline.vector(codes), low_side.vector(other));
                // A product is rounded down: two of them, of either sign, are apart by two of 2^30.
                assert!(
                    v.alpha.abs_diff(w.alpha) <= 3 && v.beta.abs_diff(w.beta) <= 3,
                    "{v:?} {w:?}"
                );
                let (i, k) = (inline.phases(codes), low_side.phases(other));
                for (i, k) in i.into_iter().zip(k) {
                    assert!(i.abs_diff(k) <= 4 * Current::DELTA, "{i} A and {k} A");
                }
            }
        }
    }

    #[test]
    fn zeros_are_the_mean_to_a_thousandth_of_a_count() {
        let sense = sense(&plate(16, 10.0, Shunts::Two));
        let mut calibration = ZeroCalibration::default();
        let mut found = None;
        for n in 0..1024u16 {
            assert!(found.is_none());
            found = calibration.take(&sense, [2048 + n % 2, 2040, 65535]);
        }
        let code = |counts: f64| (counts * 32768.0) as i32;
        assert_eq!(found, Some([2048.5, 2040.0, 65535.0].map(code)));
        assert_eq!(calibration, ZeroCalibration::default());
    }
}
