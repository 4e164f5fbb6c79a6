//! ADC counts -> phase currents and bus voltage.

use crate::format::{
    Current, Ratio, StatorCurrent, TableVelocity, Voltage, multiply_upper, narrow_bits,
};
use crate::transform::{AlphaBeta, clarke_three, clarke_two};

/// Which phases have a current sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shunts {
    /// Phases a and b; c is minus their sum.
    Two,
    /// All three; what is common to them is sensor error and drops out.
    Three,
}

/// One current channel: `i = (counts - zero) * gain`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentChannel {
    /// Counts at zero current by design, in sixteenths of a count: the mean of many samples is finer than one.
    pub zero_sixteenths: i32,
    /// A per sixteenth of a count.
    pub gain: Ratio,
}

impl CurrentChannel {
    /// The current that `counts` stand for, with the zero at `zero` sixteenths of a count.
    #[must_use]
    #[inline(always)]
    pub fn current(&self, counts: u16, zero: i32) -> Current {
        // 20 bits and a sign of code, shifted up to 31: the product fits 63, and is narrowed from high above its end.
        let code = (i32::from(counts) << 4)
            .saturating_sub(zero)
            .clamp(-(1 << 20), (1 << 20) - 1);
        narrow_bits(
            i64::from(code << 11).wrapping_mul(i64::from(self.gain.to_bits())),
            21,
        )
    }
}

/// Current channels of one motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentSense {
    /// Which of the channels are there.
    pub shunts: Shunts,
    /// Phases a, b, c; c is unused with [`Shunts::Two`].
    pub channels: [CurrentChannel; 3],
}

impl CurrentSense {
    /// Phase currents a, b, c, with the zeros of the channels in sixteenths of a count.
    #[must_use]
    #[inline(always)]
    pub fn phases(&self, counts: [u16; 3], zeros: [i32; 3]) -> [Current; 3] {
        let ([qa, qb, qc], [na, nb, nc], [za, zb, zc]) = (&self.channels, counts, zeros);
        let (a, b) = (qa.current(na, za), qb.current(nb, zb));
        let c = match self.shunts {
            Shunts::Two => a.saturating_add(b).saturating_neg(),
            Shunts::Three => qc.current(nc, zc),
        };
        [a, b, c]
    }

    /// The zeros of the channels by design.
    #[must_use]
    pub const fn nominal_zeros(&self) -> [i32; 3] {
        let [a, b, c] = &self.channels;
        [a.zero_sixteenths, b.zero_sixteenths, c.zero_sixteenths]
    }

    /// The channels that are there.
    pub fn measured(&self) -> impl Iterator<Item = &CurrentChannel> {
        let count = match self.shunts {
            Shunts::Two => 2,
            Shunts::Three => 3,
        };
        self.channels.iter().take(count)
    }

    /// The phases as a vector in the stator's frame.
    #[must_use]
    #[inline(always)]
    pub fn vector(&self, [a, b, c]: [Current; 3]) -> AlphaBeta<StatorCurrent> {
        match self.shunts {
            Shunts::Two => clarke_two(a, b),
            Shunts::Three => clarke_three(a, b, c),
        }
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
    #[inline(always)]
    pub fn voltage(&self, counts: u16) -> Voltage {
        // The upper word is in 2^-11 V: half a millivolt is enough for what is not scaled by the counts themselves.
        let bits = multiply_upper(i32::from(counts) << 15, self.gain.to_bits());
        const END: i32 = 1 << 21;
        Voltage::from_bits(bits.clamp(-END, END - 1) << 10)
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

    /// Takes one sample of the three channels; the zeros in sixteenths of a count once there are enough.
    pub fn take(&mut self, counts: [u16; 3]) -> Option<[i32; 3]> {
        // 2^10 samples of 16 bits fit 26 bits.
        let add = |sum: u32, count: u16| sum.saturating_add(u32::from(count));
        let ([a, b, c], [na, nb, nc]) = (self.sums, counts);
        self.sums = [add(a, na), add(b, nb), add(c, nc)];
        self.samples = self.samples.saturating_add(1);
        if self.samples < 1 << CALIBRATION_SHIFT {
            return None;
        }
        let zeros = self
            .sums
            .map(|sum| (sum >> (CALIBRATION_SHIFT - 4)).cast_signed());
        *self = Self::default();
        Some(zeros)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn channel(lsb: f64, zero: f64) -> CurrentChannel {
        CurrentChannel {
            zero_sixteenths: (zero * 16.0) as i32,
            gain: Ratio::from_num(lsb / 16.0),
        }
    }

    proptest! {
        #[test]
        fn counts_become_amperes(counts in any::<u16>(), lsb in 1e-4..1.0f64, zero in 0.0..65535.0f64) {
            let channel = channel(lsb, zero);
            let got = channel.current(counts, channel.zero_sixteenths).to_num::<f64>();
            let exact = (f64::from(counts) - (zero * 16.0).floor() / 16.0) * lsb;
            prop_assert!((got - exact.clamp(-2048.0, 2048.0)).abs() < 1e-5 + exact.abs() * 2e-4);
        }

        #[test]
        fn extremes_do_not_wrap(counts in any::<[u16; 3]>(), zero in any::<[i32; 3]>(), gain in any::<i32>()) {
            let channels = zero.map(|z| CurrentChannel { zero_sixteenths: z, gain: Ratio::from_bits(gain) });
            for shunts in [Shunts::Two, Shunts::Three] {
                let sense = CurrentSense { shunts, channels };
                let _ = sense.vector(sense.phases(counts, zero));
            }
            let bus = BusSense { gain: TableVelocity::from_bits(gain) };
            prop_assert_eq!(bus.voltage(counts[0]).is_negative(), gain < 0 && counts[0] > 0);
        }
    }

    #[test]
    fn zeros_are_the_mean_to_a_sixteenth() {
        let mut calibration = ZeroCalibration::default();
        let mut found = None;
        for n in 0..1024u16 {
            assert!(found.is_none());
            found = calibration.take([2048 + n % 2, 2040, 65535]);
        }
        assert_eq!(found, Some([2048 * 16 + 8, 2040 * 16, 65535 * 16]));
        assert_eq!(calibration, ZeroCalibration::default());
    }
}
