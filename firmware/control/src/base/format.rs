//! The fixed-point formats: one place that says what each quantity is stored in, and why.
//!
//! Each quantity has its own number of fraction bits, so that a volt cannot be added to an ampere: the compiler
//! refuses it.
//!
//! | type | unit | range | resolution | reason |
//! | --- | --- | --- | --- | --- |
//! | [`Current`] | A | ±2048 | 0.95 uA | current references need 2^-12 A (0.02 % of ripple at 2.5 mm/s); 8 bits more make rounding free |
//! | [`ScaledCurrent`] | A | at least 2.8 times the ADC's range | 2^-29 of it | measured currents: what `SMMUL` makes of an ADC's code, so that no step of the fast loop has to scale |
//! | [`Voltage`] | V | ±8192 | 3.8 uV | buses to 900 V; the sums of d and q fit; an integrator's step of 3.8 uV is 1.4 uA of error on the paper's motor, a hundredth of what the ADC resolves |
//! | [`StatorVoltage`] | V | ±16384 | 7.6 uV | what `SMMUL` makes of a [`Voltage`]; a rotated vector cannot leave it |
//! | [`Speed`] | electrical rad/s | ±32768 | 15 urad/s | the speed error needs 2^-10; 32768 rad/s is 62 000 rpm at 5 pole pairs |
//! | [`MechanicalSpeed`] | mechanical rad/s | ±8192 | 3.8 urad/s | 78 000 rpm; a table at 1 um/s is 1.3 mrad/s on a 5 mm lead |
//! | [`TableVelocity`] | m/s | ±8 | 3.7 nm/s | finer than any scale; 8 m/s is beyond ball screws |
//! | [`Unit`] | 1 | [-1, 1) | 4.7e-10 | cosine and sine |
//! | [`Ratio`] | 1 | ±2 | 9.3e-10 | gains of the observer |
//! | [`Gain`] | any | 31 bits and a shift | 2^-31 of itself | gains of the current loop: `SMMUL` and, where the plate wants it, a shift |
//! | [`SpeedGain`] | A s/rad, per step | ±128 | 6e-8 | speed-loop gains: 0.0733 and 0.0026 a step; resolved to 2e-5 |
//! | [`InertiaGain`] | A per rad/s, per step | ±2048 | 1e-6 | a motor of two pole pairs with a heavy table takes 185; 1.3 on the paper's |
//! | [`ElectricalChange`] | electrical rad/s a step | ±2048 | 1e-6 | a [`SpeedChange`] times 128 pole pairs, the most, is half of it |
//! | [`CurrentState`] | A | ±8.4e6 | 9.1e-13 | speed integrators: the full product, so no dead band |
//! | [`ProfileState`] | rad/s | ±3.4e10 | 3.7e-9 | whole changes and a target's steps fit, so that it is met exactly |
//! | [`SpeedChange`] | rad/s a step | ±8 | 3.7e-9 | 40 000 rad/s^2 at 5 kHz; a jerk of 50 rad/s^3 is 2e-6 a step^2, 500 of its steps |
//! | [`Angle`] | turn | [0, 1), wraps | 2^-32 | modular by nature: an angle's wrap is its arithmetic |
//!
//! Nothing here wraps but [`Angle`]. A product is taken in full width (`wide_mul`, 64 bits). It comes back through [`narrow`], which
//! saturates, or only its upper word is taken, which cannot overflow. Sums of narrow values are `saturating_add`, or plain where
//! their ranges prove that they fit. The proof stands beside them, and tests drive the ends in a build where an overflow panics.

use core::hint::cold_path;
use fixed::traits::FixedSigned;
use fixed::types::extra::{LeEqU32, LeEqU64};
use fixed::types::{I1F31, I2F30, I4F28, I8F24, I12F20, I14F18, I15F17, I16F16, I24F40, I36F28};
use fixed::{FixedI32, FixedI64};

/// Current, A. ±2048 A in steps of 2^-20 A.
pub type Current = I12F20;
/// Voltage, V. ±8192 V in steps of 2^-18 V.
pub type Voltage = I14F18;
/// Voltage in the stator's frame, V. ±16384 V in steps of 2^-17 V.
pub type StatorVoltage = I15F17;
/// Electrical angular speed, rad/s. ±32768 rad/s in steps of 2^-16 rad/s.
pub type Speed = I16F16;
/// Mechanical angular speed, rad/s. ±8192 rad/s in steps of 2^-18 rad/s.
pub type MechanicalSpeed = I14F18;
/// Table velocity, m/s. ±8 m/s in steps of 2^-28 m/s.
pub type TableVelocity = I4F28;
/// Cosine or sine, [-1, 1).
pub type Unit = I1F31;
/// A ratio, ±2.
pub type Ratio = I2F30;
/// Gain of a speed regulator, A per electrical rad/s (the integral one: per step). ±128.
pub type SpeedGain = I8F24;
/// Inertia feed-forward, A per electrical rad/s that a reference changes in a step. ±2048.
pub type InertiaGain = I12F20;
/// Change of an electrical speed in a step, rad/s. ±2048.
pub type ElectricalChange = I12F20;
/// State of a speed integrator, A, as wide as the product that feeds it.
pub type CurrentState = I24F40;
/// State of a profile, rad/s.
pub type ProfileState = I36F28;
/// Change of a profile, rad/s a step (and its change, per step squared). ±8.
pub type SpeedChange = I4F28;
/// A current of the fast loop, in 2^-n A: n is a [`CurrentScale`], which the plate's ADC range gives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ScaledCurrent(pub i32);

/// The fraction bits of a motor's [`ScaledCurrent`]s, 0 to 30.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CurrentScale {
    /// Fraction bits.
    pub fraction: u32,
}

impl CurrentScale {
    /// A current in this scale, cut to half of the word: the difference of two then fits.
    #[must_use]
    #[inline(always)]
    #[allow(clippy::arithmetic_side_effects)]
    pub fn scaled(self, current: Current) -> ScaledCurrent {
        let bits = current.to_bits();
        ScaledCurrent(if self.fraction >= Current::FRAC_NBITS {
            shift_up(bits, self.fraction - Current::FRAC_NBITS, 30)
        } else {
            bits >> (Current::FRAC_NBITS - self.fraction)
        })
    }

    /// A current of this scale, saturated to its format.
    #[must_use]
    #[inline(always)]
    #[allow(clippy::arithmetic_side_effects)]
    pub fn current(self, ScaledCurrent(bits): ScaledCurrent) -> Current {
        Current::from_bits(if self.fraction >= Current::FRAC_NBITS {
            bits >> (self.fraction - Current::FRAC_NBITS)
        } else {
            shift_up(bits, Current::FRAC_NBITS - self.fraction, 31)
        })
    }
}

/// A gain that one instruction applies: `x * multiplier / 2^32`, shifted left by `shift`, which is zero on most plates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gain {
    /// See above.
    pub multiplier: i32,
    /// See above; 0 to 16.
    pub shift: u32,
}

impl Gain {
    /// The gain times `x`: within ±2^30.
    #[must_use]
    #[inline(always)]
    pub fn times(self, x: i32) -> i32 {
        self.shifted(self.product(x))
    }

    /// The same before it is shifted: within ±2^30 by itself.
    #[must_use]
    #[inline(always)]
    pub(crate) fn product(self, x: i32) -> i32 {
        multiply_upper(self.multiplier, x)
    }

    /// Two [`Gain::product`]s, shifted, away from the straight way, whose registers it would take.
    #[must_use]
    #[cold]
    #[inline(never)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    pub(crate) fn shifted_seldom(shift: u32, d: i32, q: i32) -> (i32, i32) {
        let end = 1i32.wrapping_shl(30u32.wrapping_sub(shift));
        let shifted = |x: i32| {
            // As [`shift_up`] does it, of what is not to be called from here.
            x.min(end.wrapping_sub(1))
                .max(end.wrapping_neg())
                .wrapping_shl(shift)
        };
        (shifted(d), shifted(q))
    }

    /// A [`Gain::product`], shifted.
    #[must_use]
    #[inline(always)]
    fn shifted(self, product: i32) -> i32 {
        if self.shift == 0 {
            return product;
        }
        shift_up(product, self.shift, 30)
    }
}

/// What `x` is cut to beyond ±2^`bits`.
#[cold]
#[inline(never)]
#[allow(clippy::arithmetic_side_effects)]
#[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
fn end_of(x: i32, bits: u32) -> i32 {
    (i32::MAX >> (31 - bits)) ^ (x >> 31)
}

/// `x` shifted left by `shift`, at most 16 bits, and cut to ±2^`bits`.
#[inline(always)]
#[allow(clippy::arithmetic_side_effects)]
pub(crate) fn shift_up(x: i32, shift: u32, bits: u32) -> i32 {
    let shifted = x.wrapping_shl(shift);
    if shifted.wrapping_shr(shift) != x {
        return end_of(x, bits);
    }
    if bits >= 31 {
        return shifted;
    }
    shifted.clamp(-1 << bits, (1 << bits) - 1)
}

/// An angle as a fraction of a turn: 2^32 is one turn, and the wrap of the integer is the wrap of the angle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Angle(pub u32);

impl Angle {
    /// The angle `turns` past zero; whole turns drop out. For configuration and tests, not for the loops.
    #[must_use]
    pub const fn from_turns(turns: f64) -> Self {
        // The cast saturates at 2^63; angles of a plate are a few turns.
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::float_arithmetic
        )]
        Self((turns * 4_294_967_296.0) as i64 as u32)
    }

    /// This angle plus `other`, modulo one turn.
    #[must_use]
    pub const fn plus(self, other: Self) -> Self {
        Self(self.0.wrapping_add(other.0))
    }

    /// This angle turned on by `step` 2^-32 turn.
    #[must_use]
    pub const fn turned(self, step: i32) -> Self {
        Self(self.0.wrapping_add_signed(step))
    }

    /// The way from `other` to this angle, the short way round, in 2^-32 turn: [-2^31, 2^31).
    #[must_use]
    pub const fn minus(self, other: Self) -> i32 {
        self.0.wrapping_sub(other.0).cast_signed()
    }

    /// This angle times a whole number, modulo one turn: mechanical to electrical.
    #[must_use]
    pub const fn times(self, factor: u32) -> Self {
        Self(self.0.wrapping_mul(factor))
    }
}

/// A full-width product, brought back to 32 bits: rounded down, saturated at the ends of the format.
///
/// A value beyond an end comes back as that end to within `2^(32 - shift)` of the format's last steps, `shift` being
/// the fraction bits that are dropped: see [`narrow_bits`].
#[must_use]
#[inline(always)]
pub fn narrow<Wide: LeEqU64, Narrow: LeEqU32>(wide: FixedI64<Wide>) -> FixedI32<Narrow> {
    const {
        assert!(
            Wide::U32 > Narrow::U32,
            "a product has the fraction bits of both factors"
        );
    };
    narrow_bits(
        wide.to_bits(),
        const { Wide::U32.saturating_sub(Narrow::U32) },
    )
}

/// [`narrow`] on bare bits, for a product whose factors have no common type: drops `shift` fraction bits, 1 to 63.
///
/// Only the upper word is saturated, which a Cortex-M4 does in one instruction (`SSAT`) where the whole value takes
/// eight. The lower word of a value beyond the end stays what it was, so the end is met to `2^(32 - shift)` last steps:
/// at most one part in `2^(shift - 1)` of the range. With 32 bits and more to drop nothing can be beyond.
#[inline(always)]
pub(crate) fn narrow_bits<F: LeEqU32>(wide: i64, shift: u32) -> FixedI32<F> {
    // In range after the clamp, so the casts and shifts keep the value; every caller's shift is a constant.
    #[allow(clippy::cast_possible_truncation, clippy::arithmetic_side_effects)]
    let bits = if shift >= 32 {
        (wide >> (shift & 63)) as i32
    } else {
        let end = 1i32 << (shift - 1);
        let upper = ((wide >> 32) as i32).clamp(-end, end - 1);
        (upper << (32 - shift)) | (wide as u32 >> shift).cast_signed()
    };
    FixedI32::from_bits(bits)
}

/// The upper word of a product: `a * b / 2^32`, rounded down. It cannot overflow, and is one instruction.
#[must_use]
#[inline(always)]
pub(crate) fn multiply_upper(a: i32, b: i32) -> i32 {
    // |a * b| <= 2^62, so the shifted product fits 31 bits.
    #[allow(clippy::cast_possible_truncation, clippy::arithmetic_side_effects)]
    let upper = ((i64::from(a) * i64::from(b)) >> 32) as i32;
    upper
}

/// `x` with its upper word cut to ±`end`, 2^30 at most.
#[must_use]
#[inline(always)]
#[allow(clippy::cast_possible_truncation, clippy::arithmetic_side_effects)]
pub(crate) fn cut_upper(x: i64, end: i32) -> i64 {
    let upper = (x >> 32) as i32;
    if upper.wrapping_add(end).cast_unsigned() < end.cast_unsigned() << 1 {
        return x;
    }
    cold_path();
    // `Ord::clamp` would panic at ends of the wrong order: see `cut`.
    let cut = upper.min(end - 1).max(-end);
    (i64::from(cut) << 32) | i64::from(x as u32)
}

/// `x` cut to ±`limit`. `Ord::clamp` would panic at a negative limit, which no configuration has but which the compiler
/// cannot know; here it would come back as the limit without its sign.
#[must_use]
#[inline(always)]
pub fn cut<T: FixedSigned>(x: T, limit: T) -> T {
    x.min(limit).max(limit.saturating_neg())
}

/// Square root, rounded down to 16 significant bits: `sqrt(x)` for the integer `x`.
///
/// 16 bits are enough for what uses it (the voltage circle, the braking curve) and cost one 32-bit root
/// instead of a 64-bit one, which on a Cortex-M4 needs software division.
#[must_use]
#[inline]
pub fn square_root(x: u64) -> u32 {
    // An even number of bits, so that the root shifts by half of it; x >> shift fits 32 bits.
    let excess = 32u32.saturating_sub(x.leading_zeros());
    let shift = excess.saturating_add(excess & 1);
    #[allow(clippy::cast_possible_truncation, clippy::arithmetic_side_effects)]
    let root = whole_root((x >> shift) as u32) << (shift / 2);
    root
}

/// Whole roots of 64 to 255: of a number whose uppermost byte it is, the root's first four bits.
#[allow(clippy::indexing_slicing, reason = "computed by the compiler")]
#[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
static ROOTS: [u8; 192] = {
    let mut roots = [8; 192];
    let mut k = 0;
    while k < 192 {
        let mut root = 8u8;
        while (root as usize + 1) * (root as usize + 1) <= k + 64 {
            root += 1;
        }
        roots[k] = root;
        k += 1;
    }
    roots
};

/// The whole square root, by Karatsuba's halving (Zimmermann, INRIA RR-3805, 1999), as the standard library's is, whose
/// table has no name by which a linker could place it in fast memory.
#[inline]
#[allow(clippy::arithmetic_side_effects, clippy::indexing_slicing)]
fn whole_root(x: u32) -> u32 {
    // One of the uppermost two bits is set; 0 stays 0.
    let shift = (x | 1).leading_zeros() & !1;
    let n = x << shift;
    let head = n >> 24;
    let first = u32::from(ROOTS[(head.saturating_sub(64) as usize).min(191)]);
    // What a root leaves is at most twice the root, so that the next bits of it are a division's.
    let next = |root: u32, left: u32, bits: u32, high: u32, low: u32| {
        let numerator = left << bits | high;
        // It is not 0, which only the compiler does not know.
        let quotient = numerator.checked_div(2 * root).unwrap_or_default();
        let rest = numerator - quotient * 2 * root;
        let root = (root << bits) + quotient;
        let (left, square) = (rest << bits | low, quotient * quotient);
        if left < square {
            (root - 1, left + 2 * root - 1 - square)
        } else {
            (root, left - square)
        }
    };
    let left = head.saturating_sub(first * first);
    let (root, left) = next(first, left, 4, n >> 20 & 15, n >> 16 & 15);
    let (root, _) = next(root, left, 8, n >> 8 & 255, n & 255);
    if x == 0 { 0 } else { root >> (shift / 2) }
}

/// A number that its format, or physics, does not allow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Misfit {
    /// What the number is.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Its value.
    pub value: f64,
    /// What it must exceed: the smallest magnitude that its format holds to one part in a thousand, or a bound.
    pub least: f64,
    /// What it must stay below.
    pub below: f64,
}

impl core::fmt::Display for Misfit {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self {
            name,
            unit,
            value,
            least,
            below,
        } = self;
        if *below == f64::MAX {
            return write!(
                f,
                "{name} is {value} {unit}, expected more than {least}: check the plate data that it comes from"
            );
        }
        write!(
            f,
            "{name} is {value} {unit}, but the drive holds values from {least:.3e} to {below:.3e}: check the plate \
             data, the rates and the bandwidths that it comes from"
        )
    }
}

impl core::error::Error for Misfit {}

/// `value` in a format of `fraction` bits, if the format holds it to one part in a thousand. Zero is held.
///
/// # Errors
/// [`Misfit`] if the value is not finite, too large for the format, or too small to be resolved.
#[allow(clippy::float_arithmetic)]
#[inline(never)]
pub const fn quantise(
    name: &'static str,
    unit: &'static str,
    value: f64,
    fraction: u32,
) -> Result<i32, Misfit> {
    #[allow(clippy::arithmetic_side_effects)]
    let scale = (1u64 << fraction) as f64;
    let (below, least) = (2_147_483_648.0 / scale, 500.0 / scale);
    let magnitude = value.abs();
    let held = magnitude < below && (magnitude >= least || magnitude == 0.0);
    if !held {
        return Err(Misfit {
            name,
            unit,
            value,
            least,
            below,
        });
    }
    let half = if value < 0.0 { -0.5 } else { 0.5 };
    // |value * scale| < 2^31, and a rounding up to 2^31 saturates in the cast.
    #[allow(clippy::cast_possible_truncation)]
    Ok((value * scale + half) as i32)
}

/// The same in the format of the number that it becomes.
///
/// # Errors
/// As [`quantise`].
#[inline(never)]
pub const fn fixed_point<Fraction: LeEqU32>(
    name: &'static str,
    unit: &'static str,
    value: f64,
) -> Result<FixedI32<Fraction>, Misfit> {
    match quantise(name, unit, value, FixedI32::<Fraction>::FRAC_NBITS) {
        Ok(bits) => Ok(FixedI32::from_bits(bits)),
        Err(misfit) => Err(misfit),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn narrow_saturates_and_never_wraps(bits in any::<i64>()) {
            let wide = I24F40::from_bits(bits);
            let got: Current = narrow(wide);
            let exact = bits as f64 / 2f64.powi(40);
            let ends = (Current::MIN.to_num::<f64>(), Current::MAX.to_num::<f64>());
            // 20 bits are dropped: the ends are met to 2^12 last steps.
            prop_assert!((got.to_num::<f64>() - exact.clamp(ends.0, ends.1)).abs() <= 2f64.powi(12 - 20));
            if exact > ends.0 && exact < ends.1 {
                prop_assert!((got.to_num::<f64>() - exact).abs() <= 2f64.powi(-20));
            }
        }

        #[test]
        fn whole_roots_are_those_of_the_standard_library(x in any::<u32>(), bits in 0u32..32) {
            // Of all sizes, and around squares.
            for x in [x >> bits, (x >> 16).pow(2), (x >> 16).pow(2).saturating_sub(1), u32::MAX - (x >> 20)] {
                prop_assert_eq!(whole_root(x), x.isqrt(), "{}", x);
            }
        }

        #[test]
        fn square_root_has_sixteen_bits(x in any::<u64>()) {
            let root = f64::from(square_root(x));
            let exact = (x as f64).sqrt();
            prop_assert!(root <= exact * (1.0 + 1e-12));
            prop_assert!(exact - root <= 1.0 + exact * 3.1e-5);
        }

        #[test]
        fn quantise_refuses_or_holds_to_a_thousandth(value in any::<f64>(), fraction in 0u32..31) {
            match quantise("x", "V", value, fraction) {
                Ok(bits) if value == 0.0 => prop_assert_eq!(bits, 0),
                Ok(bits) => {
                    let held = f64::from(bits) / 2f64.powi(fraction as i32);
                    prop_assert!((held / value - 1.0).abs() <= 1.01e-3);
                }
                Err(misfit) => prop_assert!(
                    !value.is_finite() || value.abs() >= misfit.below || value.abs() < misfit.least
                ),
            }
        }
    }
}
