//! Sums of harmonics of one angle, from one `sin_cos` of it.

use crate::effects::Law;

/// Longest polynomial; harmonics that would need a longer one take a `cos` of their own instead.
const MAX_DEGREE: u32 = 32;

type Complex = (f64, f64);

#[inline]
fn product((a, b): Complex, (c, d): Complex) -> Complex {
    (a * c - b * d, a * d + b * c)
}

/// An angle with its cosine and sine.
#[derive(Debug, Clone, Copy)]
pub(super) struct Phasor {
    angle: f64,
    pub(super) cos: f64,
    pub(super) sin: f64,
}

impl Phasor {
    #[inline]
    pub(super) fn new(angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        Phasor { angle, cos, sin }
    }

    /// Two at once, in one vector instruction each.
    #[inline]
    pub(super) fn pair(angles: [f64; 2]) -> [Self; 2] {
        let (sin, cos) = wide::f64x2::from(angles).sin_cos();
        let (sin, cos) = (sin.to_array(), cos.to_array());
        [0, 1].map(|k: usize| Phasor {
            angle: angles[k],
            cos: cos[k],
            sin: sin[k],
        })
    }
}

/// A sum of harmonics of one angle.
///
/// Whole orders are the real part of a polynomial in `w = e^(i base angle)`, `base` their greatest common divisor.
#[derive(Debug, Clone, Default)]
pub(super) struct Harmonics {
    base: u32,
    /// Coefficients `amplitude * e^(i phase)` from the highest power of `w` down to the first.
    coefficients: Vec<Complex>,
    other: Vec<Law>,
}

impl Harmonics {
    /// The sum of some terms; any law will do, periodic ones of whole order are the fast ones.
    pub(super) fn new(laws: Vec<Law>) -> Self {
        let mut sum = Harmonics::default();
        let mut whole: Vec<(u32, Complex)> = Vec::new();
        for law in laws {
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
                        whole.push((order, (amplitude * cos, amplitude * sin)));
                    } else {
                        sum.other.push(law);
                    }
                }
                law => sum.other.push(law),
            }
        }
        let degree = whole
            .iter()
            .map(|term| term.0 / sum.base)
            .max()
            .unwrap_or(0);
        sum.coefficients = vec![(0.0, 0.0); degree as usize];
        for (order, (cos, sin)) in whole {
            let coefficient = &mut sum.coefficients[(degree - order / sum.base) as usize];
            *coefficient = (coefficient.0 + cos, coefficient.1 + sin);
        }
        sum
    }

    pub(super) fn is_empty(&self) -> bool {
        self.coefficients.is_empty() && self.other.is_empty()
    }

    #[inline]
    pub(super) fn value(&self, at: Phasor) -> f64 {
        let mut sum = 0.0;
        if !self.coefficients.is_empty() {
            let w = power((at.cos, at.sin), self.base);
            let mut polynomial = (0.0, 0.0);
            for coefficient in &self.coefficients {
                let (re, im) = (polynomial.0 + coefficient.0, polynomial.1 + coefficient.1);
                polynomial = product((re, im), w);
            }
            sum = polynomial.0;
        }
        self.other
            .iter()
            .fold(sum, |sum, law| sum + law.value(at.angle))
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
        fn a_pair_is_two_angles(angles in [-1e6..1e6f64, -1e6..1e6f64]) {
            for (pair, one) in Phasor::pair(angles).into_iter().zip(angles.map(Phasor::new)) {
                prop_assert_eq!(pair.angle, one.angle);
                prop_assert!((pair.cos - one.cos).abs() < 4e-16 && (pair.sin - one.sin).abs() < 4e-16);
            }
        }

        #[test]
        fn equals_the_sum_of_its_laws(
            terms in prop::collection::vec((1u32..400, any::<bool>(), -2.0..2.0f64, -7.0..7.0f64), 0..6),
            angle in -1e4..1e4f64,
        ) {
            let laws: Vec<Law> = terms
                .into_iter()
                .map(|(order, whole, amplitude, phase)| Law::Periodic {
                    order: f64::from(order) + if whole { 0.0 } else { 0.5 },
                    amplitude,
                    phase,
                })
                .collect();
            let expected: f64 = laws.iter().map(|law| law.value(angle)).sum();
            let got = Harmonics::new(laws).value(Phasor::new(angle));
            prop_assert!((got - expected).abs() < 1e-8, "{got} against {expected}");
        }
    }
}
