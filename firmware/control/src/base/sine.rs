//! Cosine and sine of an angle: a table of points on the circle, and from the nearest one on along its tangent.
//!
//! The tangent leaves the circle: half an interval out, at pi/512 rad, it is 1.9e-5 too long. The points lie half of that
//! inside, so that the length is right within 9.5e-6 everywhere; the direction is right within 8e-8 rad.

use crate::base::format::{Angle, Unit, multiply_upper};
use core::f64::consts::{PI, TAU};

/// Points a turn, as a power of two.
const POINT_BITS: u32 = 9;
const POINTS: usize = 1 << POINT_BITS;
/// Half an interval, rad.
const REACH: f64 = PI / POINTS as f64;

/// Cosine (lower word) and sine of each point, 2^-31: a word each, but loaded as one.
#[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
static CIRCLE: [u64; POINTS] = circle();

/// Half an interval in 2^-32 rad, as the upper word of its product with a full word.
#[allow(clippy::cast_possible_truncation)]
const SCALE: i32 = (REACH * 8_589_934_592.0 + 0.5) as i32;

impl Angle {
    /// Cosine and sine, each within 9.5e-6.
    #[must_use]
    #[inline(always)]
    pub fn cos_sin(self) -> (Unit, Unit) {
        self.cos_sin_scaled::<SCALE>()
    }

    /// The same for a second angle in one function. A constant is a ten-thousandth larger (5e-7 rad at most): the compiler
    /// would keep one 64-bit constant for both, and multiplies by such a one in four instructions instead of one.
    #[must_use]
    #[inline(always)]
    pub fn second_cos_sin(self) -> (Unit, Unit) {
        self.cos_sin_scaled::<{ SCALE + 5000 }>()
    }

    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, clippy::arithmetic_side_effects)]
    fn cos_sin_scaled<const SCALE: i32>(self) -> (Unit, Unit) {
        const HALF: u32 = 1 << (31 - POINT_BITS);
        let nearest = self.0.wrapping_add(HALF) >> (32 - POINT_BITS);
        let point = CIRCLE.get(nearest as usize).copied().unwrap_or(0);
        let (cos, sin) = (point as i32, (point >> 32) as i32);
        // The rest for the angle, with half an interval as the full word.
        let left = (self.0 << POINT_BITS).cast_signed();
        let left = multiply_upper(left, SCALE);
        // Within the word: where cosine or sine is largest there is a point, and all points lie inside the circle.
        (
            Unit::from_bits(cos - multiply_upper(sin, left)),
            Unit::from_bits(sin + multiply_upper(cos, left)),
        )
    }
}

#[allow(
    clippy::float_arithmetic,
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation
)]
const fn circle() -> [u64; POINTS] {
    const RADIUS: f64 = 2_147_483_648.0 * (1.0 - REACH * REACH / 4.0);
    let mut points = [0; POINTS];
    let mut k = 0;
    while k < POINTS {
        let angle = TAU * (k as f64 / POINTS as f64);
        let cos = (RADIUS * sine(angle + PI / 2.0)) as i32;
        let sin = (RADIUS * sine(angle)) as i32;
        points[k] = (sin.cast_unsigned() as u64) << 32 | cos.cast_unsigned() as u64;
        k += 1;
    }
    points
}

/// The sine's series, for angles of -pi to 3 pi, for the table.
#[allow(clippy::float_arithmetic, clippy::arithmetic_side_effects)]
const fn sine(angle: f64) -> f64 {
    let x = if angle > PI { angle - TAU } else { angle };
    let (mut term, mut sum, mut n) = (x, x, 2.0);
    while n < 40.0 {
        term = -term * x * x / (n * (n + 1.0));
        sum += term;
        n += 2.0;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn off(angle: u32) -> f64 {
        let ((cos, sin), (second_cos, second_sin)) =
            (Angle(angle).cos_sin(), Angle(angle).second_cos_sin());
        let (exact_sin, exact_cos) = (f64::from(angle) / 2f64.powi(32) * TAU).sin_cos();
        let off = |got: Unit, exact: f64| (got.to_num::<f64>() - exact).abs();
        let first = off(cos, exact_cos).max(off(sin, exact_sin));
        let second = off(second_cos, exact_cos).max(off(second_sin, exact_sin));
        first.max(second)
    }

    proptest! {
        #[test]
        fn cosine_and_sine_are_right(angle in any::<u32>()) {
            prop_assert!(off(angle) < 9.5e-6, "{} off at {angle}", off(angle));
        }
    }

    /// The ends of every interval, where the tangent is furthest out and a wrap of the sum would show.
    #[test]
    fn also_at_the_ends_of_each_interval() {
        for k in 0..POINTS as u32 {
            let end = (k << (32 - POINT_BITS)).wrapping_add(1 << (31 - POINT_BITS));
            for angle in [end.wrapping_sub(1), end, k << (32 - POINT_BITS)] {
                assert!(off(angle) < 9.5e-6, "{} off at {angle}", off(angle));
            }
        }
    }
}
