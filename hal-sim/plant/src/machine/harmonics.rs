//! Sums of harmonics of one angle of each motor, from one `sin_cos` of it, of both motors side by side.

use super::pair::{Bits, Pair, bits, pair};
use crate::effects::Law;
use std::f64::consts::PI;

/// Longest polynomial; harmonics that would need a longer one take a `cos` of their own instead.
const MAX_DEGREE: u32 = 32;

/// A complex number for each motor.
type Complex = (Pair, Pair);

#[inline]
fn product((a, b): Complex, (c, d): Complex) -> Complex {
    (a * c - b * d, a * d + b * c)
}

/// An angle of each motor with its cosine and sine.
#[derive(Debug, Clone, Copy)]
pub(super) struct Phasors {
    angle: Pair,
    pub(super) cos: Pair,
    pub(super) sin: Pair,
}

impl Phasors {
    #[inline]
    pub(super) fn new(angle: Pair) -> Self {
        let (sin, cos) = sin_cos(angle);
        Phasors { angle, cos, sin }
    }
}

/// Largest angle, rad, of which a quarter turn is removed exactly: below 2^28 quarters, for its first part has 25 bits.
const REDUCIBLE: f64 = 4e8;

/// Sine and cosine, within 4e-16 of the library's: the polynomials of Cephes (Moshier, `sin.c`), which
/// `f64x2::sin_cos` has too, to the same bits. Without SSE4.1, which x86-64 does not promise, its rounding is a
/// call there, and its comparing of whole numbers is done one by one: here the nearest quarter turn is the last bits of a sum.
#[inline]
fn sin_cos(angle: Pair) -> (Pair, Pair) {
    // A quarter turn in three parts, the first two of so few bits that their products are exact.
    const QUARTER: [f64; 3] = [
        2.0 * 7.853_981_554_508_209e-1,
        2.0 * 7.946_627_356_147_928e-9,
        2.0 * 3.061_616_997_868_383e-17,
    ];
    // 1.5 * 2^52: the unit of a number of this size is 1, so a sum with it is rounded to a whole number.
    const WHOLE: f64 = 6_755_399_441_055_744.0;
    if !angle.abs().simd_le(Pair::splat(REDUCIBLE)).all() {
        return library_sin_cos(angle);
    }
    let shifted = angle * (2.0 / PI) + WHOLE;
    let quarters = shifted - WHOLE;
    let [first, second, third] = QUARTER;
    let x = angle - quarters * first - quarters * second - quarters * third;
    let x2 = x * x;
    let polynomial = |[c0, c1, c2, c3, c4, c5]: [f64; 6]| {
        let x4 = x2 * x2;
        (x2 * c3 + c2) * x4 + ((x2 * c5 + c4) * (x4 * x4) + (x2 * c1 + c0))
    };
    let sin = x * x2 * polynomial(SINE) + x;
    let cos = x2 * x2 * polynomial(COSINE) + (1.0 - x2 * 0.5);
    // An odd quarter exchanges the two; their signs are the second bit of the quarter, and of the next.
    let quarter: Bits = bits(shifted);
    let odd = Bits::splat(0) - (quarter & Bits::splat(1));
    let change = (bits(sin) ^ bits(cos)) & odd;
    let sign = |quarter: Bits| (quarter & Bits::splat(2)) << 62;
    (
        pair(bits(sin) ^ change ^ sign(quarter)),
        pair(bits(cos) ^ change ^ sign(quarter + Bits::splat(1))),
    )
}

#[cold]
fn library_sin_cos(angle: Pair) -> (Pair, Pair) {
    let [screw, nut] = angle.to_array().map(f64::sin_cos);
    (Pair::new([screw.0, nut.0]), Pair::new([screw.1, nut.1]))
}

/// `(sin x - x) / x^3` over `x^2`, to an eighth of a turn.
const SINE: [f64; 6] = [
    -1.666_666_666_666_663e-1,
    8.333_333_333_322_118e-3,
    -1.984_126_982_958_954e-4,
    2.755_731_362_138_572_2e-6,
    -2.505_074_776_285_780_7e-8,
    1.589_623_015_765_465_6e-10,
];

/// `(cos x - 1 + x^2 / 2) / x^4` over `x^2`, to an eighth of a turn.
const COSINE: [f64; 6] = [
    4.166_666_666_666_659_5e-2,
    -1.388_888_888_887_305_6e-3,
    2.480_158_728_885_170_4e-5,
    -2.755_731_417_929_674e-7,
    2.087_570_084_197_473e-9,
    -1.135_853_652_138_768_2e-11,
];

/// A sum of harmonics of one angle, for each motor its own.
///
/// Whole orders are the real part of a polynomial in `w = e^(i base angle)`, `base` the greatest common divisor of both
/// motors' orders.
#[derive(Debug, Clone, Default)]
pub(super) struct Harmonics {
    base: u32,
    /// Coefficients `amplitude * e^(i phase)` from the highest power of `w` down to the first.
    coefficients: Vec<Complex>,
    others: [Vec<Law>; 2],
}

impl Harmonics {
    /// The sum of some terms of each motor; any law will do, periodic ones of whole order are the fast ones.
    pub(super) fn new(laws: [Vec<Law>; 2]) -> Self {
        let mut sum = Harmonics::default();
        let mut whole: Vec<(u32, usize, [f64; 2])> = Vec::new();
        for (motor, law) in laws
            .into_iter()
            .enumerate()
            .flat_map(|(k, laws)| laws.into_iter().map(move |law| (k, law)))
        {
            match law {
                Law::Periodic {
                    order,
                    amplitude,
                    phase,
                } if order.fract() == 0.0 && (1.0..=10_000.0).contains(&order) => {
                    // Whole and in the range of u32 by the guard.
                    let order = order as u32;
                    let base = gcd(sum.base, order);
                    let highest = whole
                        .iter()
                        .map(|term| term.0)
                        .max()
                        .unwrap_or(0)
                        .max(order);
                    if highest / base <= MAX_DEGREE {
                        sum.base = base;
                        let (sin, cos) = phase.sin_cos();
                        whole.push((order, motor, [amplitude * cos, amplitude * sin]));
                    } else {
                        sum.others[motor].push(law);
                    }
                }
                law => sum.others[motor].push(law),
            }
        }
        let degree = whole
            .iter()
            .map(|term| term.0 / sum.base)
            .max()
            .unwrap_or(0);
        let mut coefficients = vec![[[0.0; 2]; 2]; degree as usize];
        for (order, motor, parts) in whole {
            let coefficient = &mut coefficients[(degree - order / sum.base) as usize];
            for (of_both, part) in coefficient.iter_mut().zip(parts) {
                of_both[motor] += part;
            }
        }
        sum.coefficients = coefficients
            .into_iter()
            .map(|[re, im]| (Pair::new(re), Pair::new(im)))
            .collect();
        sum
    }

    #[inline]
    pub(super) fn is_empty(&self) -> bool {
        self.coefficients.is_empty() && self.others.iter().all(Vec::is_empty)
    }

    #[inline]
    pub(super) fn value(&self, at: &Phasors) -> Pair {
        let mut sum = Pair::ZERO;
        if let Some((last, higher)) = self.coefficients.split_last() {
            let w = power((at.cos, at.sin), self.base);
            let mut polynomial = (Pair::ZERO, Pair::ZERO);
            for coefficient in higher {
                polynomial = product(
                    (polynomial.0 + coefficient.0, polynomial.1 + coefficient.1),
                    w,
                );
            }
            sum = product((polynomial.0 + last.0, polynomial.1 + last.1), w).0;
        }
        if self.others.iter().all(Vec::is_empty) {
            return sum;
        }
        let (mut values, angles) = (sum.to_array(), at.angle.to_array());
        for (k, laws) in self.others.iter().enumerate() {
            values[k] = laws
                .iter()
                .fold(values[k], |sum, law| sum + law.value(angles[k]));
        }
        Pair::new(values)
    }
}

/// `z` to a power of 1 or more, by squaring.
#[inline]
fn power(mut z: Complex, mut exponent: u32) -> Complex {
    while exponent & 1 == 0 {
        z = product(z, z);
        exponent >>= 1;
    }
    let mut result = z;
    exponent >>= 1;
    while exponent != 0 {
        z = product(z, z);
        if exponent & 1 == 1 {
            result = product(result, z);
        }
        exponent >>= 1;
    }
    result
}

fn gcd(a: u32, b: u32) -> u32 {
    if a == 0 { b } else { gcd(b % a, a) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn sine_and_cosine_are_the_librarys(
            angles in prop::array::uniform2(prop_oneof![-7.0..7.0f64, -1e6..1e6f64, -1e9..1e9f64, any::<f64>()]),
        ) {
            let (sin, cos) = sin_cos(Pair::new(angles));
            let same = |a: f64, b: f64| (a - b).abs() < 4e-16 || a.is_nan() && b.is_nan();
            for ((angle, sin), cos) in angles.into_iter().zip(sin.to_array()).zip(cos.to_array()) {
                let (true_sin, true_cos) = angle.sin_cos();
                prop_assert!(same(sin, true_sin), "sin {} is {}, expected {}", angle, sin, true_sin);
                prop_assert!(same(cos, true_cos), "cos {} is {}, expected {}", angle, cos, true_cos);
            }
        }

        #[test]
        fn equals_the_sum_of_its_laws(
            terms in prop::collection::vec((0..2usize, 1u32..400, any::<bool>(), -2.0..2.0f64, -7.0..7.0f64), 0..6),
            angles in prop::array::uniform2(-1e4..1e4f64),
        ) {
            let mut laws = [vec![], vec![]];
            for (motor, order, whole, amplitude, phase) in terms {
                laws[motor].push(Law::Periodic {
                    order: f64::from(order) + if whole { 0.0 } else { 0.5 },
                    amplitude,
                    phase,
                });
            }
            let expected: [f64; 2] = [0, 1].map(|k| laws[k].iter().map(|law: &Law| law.value(angles[k])).sum());
            let got = Harmonics::new(laws).value(&Phasors::new(Pair::new(angles))).to_array();
            for k in 0..2 {
                prop_assert!((got[k] - expected[k]).abs() < 1e-8, "{got:?} against {expected:?}");
            }
        }
    }
}
