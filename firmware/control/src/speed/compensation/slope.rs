//! How a torque's coefficient changes with the motor's load.
//!
//! Harmonics of flux and gains of current sensors scale with the current, cogging does not. One load cannot tell them apart, two can: the
//! coefficient is taken as a straight line over the load, through what was learned at the last two. Once the line is known, a load that
//! vanishes takes its part of the ripple's current with it.

use super::TORQUE_BITS;
use super::line::Phasor;

/// Fraction bits of a change of a coefficient, A per A of load: ±1 is within the format, and one unit is 60 nA per A.
pub const PER_LOAD_BITS: u32 = 24;
/// Largest part of it: a harmonic as large as the load itself.
const PER_LOAD_MAX: i32 = 1 << PER_LOAD_BITS;
/// Fraction bits of a load.
const LOAD_BITS: u32 = 8;

/// The straight line of one order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadSlope {
    /// Change of the coefficient, 2^-24 A per A.
    per_load: Phasor,
    /// What was learned last, 2^-17 A.
    learned: Phasor,
    /// The load it was learned at, 2^-8 A; [`NEVER`] if nothing was.
    load: i32,
}

/// No load.
const NEVER: i32 = i32::MIN;

impl LoadSlope {
    /// Nothing is known.
    pub const NONE: Self = Self::starting(Phasor::ZERO);

    /// A line that was learned before.
    #[must_use]
    pub const fn starting(per_load: Phasor) -> Self {
        Self {
            per_load,
            learned: Phasor::ZERO,
            load: NEVER,
        }
    }

    /// Change of the coefficient, 2^-24 A per A.
    #[must_use]
    pub const fn per_load(&self) -> Phasor {
        self.per_load
    }

    /// What a load, 2^-8 A, adds to the coefficient, 2^-17 A.
    #[must_use]
    #[inline(always)]
    pub fn at(&self, load: i32) -> Phasor {
        // Within 2^24 times 2^23, in 2^-32.
        const SHIFT: u32 = PER_LOAD_BITS + LOAD_BITS - TORQUE_BITS;
        #[allow(clippy::cast_possible_truncation)]
        let part = |per_load: i32| {
            (i64::from(per_load).wrapping_mul(load.into()) >> SHIFT)
                .clamp(i32::MIN.into(), i32::MAX.into()) as i32
        };
        Phasor {
            re: part(self.per_load.re),
            im: part(self.per_load.im),
        }
    }

    /// Takes what was learned at a load in all, 2^-17 A. `true`: the line has changed, as the load differs from the last one by more than
    /// `least`, 2^-8 A.
    #[inline(never)]
    pub fn take(&mut self, coefficient: Phasor, load: i32, least: u32) -> bool {
        let before = core::mem::replace(&mut self.learned, coefficient);
        let at = core::mem::replace(&mut self.load, load);
        let apart = load.saturating_sub(at);
        if at == NEVER || apart.unsigned_abs() <= least.max(1) {
            return false;
        }
        // `2^31 / apart`, below 2^30: a quotient of two words is an instruction.
        #[allow(clippy::cast_possible_truncation)]
        let inverse = (1u32 << 31)
            .checked_div(apart.unsigned_abs())
            .unwrap_or(0)
            .cast_signed();
        // 2^-17 A, times 2^(31 + 8) over 1 A, is 2^-56 times 2^32 = 2^-24 once the lower word is left out, shifted by 16.
        let part = |now: i32, before: i32| {
            let change = now.saturating_sub(before);
            let change = if apart < 0 {
                change.saturating_neg()
            } else {
                change
            };
            let slope = i64::from(change).wrapping_mul(inverse.into()) >> 16;
            #[allow(clippy::cast_possible_truncation)]
            let slope = slope.clamp((-PER_LOAD_MAX).into(), PER_LOAD_MAX.into()) as i32;
            slope
        };
        self.per_load = Phasor {
            re: part(coefficient.re, before.re),
            im: part(coefficient.im, before.im),
        };
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn amps(x: f64) -> i32 {
        (x * f64::from(1 << TORQUE_BITS)) as i32
    }

    fn load(x: f64) -> i32 {
        (x * f64::from(1 << LOAD_BITS)) as i32
    }

    proptest! {
        /// Cogging of `fixed` A and a flux harmonic of `scaled` A per A are distinguished by two loads, at any third.
        #[test]
        fn two_loads_make_the_line(
            fixed in -2.0..2.0f64, scaled in -0.2..0.2f64, loads in prop::array::uniform3(-20.0..20.0f64),
        ) {
            let [one, other, third] = loads;
            prop_assume!((one - other).abs() > 1.0);
            let ripple = |load: f64| Phasor { re: amps(fixed + scaled * load), im: amps(fixed - scaled * load) };
            let mut slope = LoadSlope::NONE;
            prop_assert!(!slope.take(ripple(one), load(one), load(0.5).unsigned_abs()));
            prop_assert_eq!(slope.per_load(), Phasor::ZERO);
            prop_assert!(slope.take(ripple(other), load(other), load(0.5).unsigned_abs()));
            let fixed_part = ripple(other).minus(slope.at(load(other)));
            let at_third = fixed_part.plus(slope.at(load(third)));
            let off = at_third.minus(ripple(third));
            // A unit of the load is 4 mA.
            let allowed = amps(0.01 * scaled.abs() * (1.0 + (third - other).abs() / (one - other).abs())) + 64;
            prop_assert!(off.re.abs() <= allowed && off.im.abs() <= allowed, "{off:?}, expected within {allowed}");
        }

        /// A load that hardly differs says nothing; debug builds panic where a sum would leave its format.
        #[test]
        fn no_end_overflows(
            learned in prop::collection::vec((any::<(i32, i32)>(), any::<i32>()), 2..20), least in any::<u32>(),
        ) {
            let mut slope = LoadSlope::NONE;
            let mut before: Option<i32> = None;
            for ((re, im), load) in learned {
                let changed = slope.take(Phasor { re, im }, load, least);
                let before_it = before.filter(|&before| before != NEVER);
                let apart = before_it.map_or(0, |before| load.saturating_sub(before).unsigned_abs());
                prop_assert_eq!(changed, apart > least.max(1));
                let Phasor { re, im } = slope.per_load();
                prop_assert!(re.abs() <= PER_LOAD_MAX && im.abs() <= PER_LOAD_MAX);
                let _ = slope.at(load);
                before = Some(load);
            }
        }
    }
}
