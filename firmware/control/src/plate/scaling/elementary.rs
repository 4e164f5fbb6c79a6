//! What a `const fn` has not: complex numbers, and functions by their series.

use super::{half, power_of_two};
use crate::speed::compensation::line::Phasor;

/// A term of a series that is smaller changes no sum.
const NOTHING: f64 = 1e-25;

/// A complex number.
#[derive(Clone, Copy)]
pub(super) struct Complex {
    pub(super) re: f64,
    pub(super) im: f64,
}

impl Complex {
    pub(super) const ONE: Self = Self { re: 1.0, im: 0.0 };

    #[inline(never)]
    pub(super) const fn plus(self, other: Self) -> Self {
        Self {
            re: self.re + other.re,
            im: self.im + other.im,
        }
    }

    #[inline(never)]
    pub(super) const fn minus(self, other: Self) -> Self {
        self.plus(other.scaled(-1.0))
    }

    #[inline(never)]
    pub(super) const fn scaled(self, by: f64) -> Self {
        Self {
            re: self.re * by,
            im: self.im * by,
        }
    }

    #[inline(never)]
    pub(super) const fn times(self, other: Self) -> Self {
        Self {
            re: self.re * other.re - self.im * other.im,
            im: self.re * other.im + self.im * other.re,
        }
    }

    #[inline(never)]
    pub(super) const fn over(self, other: Self) -> Self {
        self.times(inverse(other, 0.0))
    }

    pub(super) const fn square(self) -> f64 {
        self.re * self.re + self.im * self.im
    }

    /// `e^(-j angle)` for an angle below one, by its series.
    #[inline(never)]
    pub(super) const fn delay(angle: f64) -> Self {
        let (mut term, mut sum, mut n) = (Self::ONE, Self::ONE, 1u32);
        let step = Self {
            re: 0.0,
            im: -angle,
        };
        while n < 24 && term.square() > NOTHING * NOTHING {
            term = term.times(step).scaled(1.0 / n as f64);
            sum = sum.plus(term);
            n = n.saturating_add(1);
        }
        sum
    }

    /// In words of `fraction` bits, shortened to its words if it is too long.
    #[allow(clippy::cast_possible_truncation)]
    pub(super) const fn words(self, fraction: u32) -> Phasor {
        const END: f64 = 2_147_483_000.0;
        let scaled = self.scaled(power_of_two(fraction));
        let longest = if scaled.re.abs() > scaled.im.abs() {
            scaled.re.abs()
        } else {
            scaled.im.abs()
        };
        let fits = if longest > END {
            scaled.scaled(END / longest)
        } else {
            scaled
        };
        Phasor {
            re: (fits.re + half(fits.re)) as i32,
            im: (fits.im + half(fits.im)) as i32,
        }
    }
}

/// The inverse, less of it where the square of the length is not far above `least`.
#[inline(never)]
pub(super) const fn inverse(x: Complex, least: f64) -> Complex {
    let conjugate = Complex {
        re: x.re,
        im: -x.im,
    };
    conjugate.scaled(1.0 / (x.square() + least))
}

/// `e^-x`, x small, by its series.
pub(super) const fn decay(x: f64) -> f64 {
    let (mut term, mut sum, mut n) = (1.0_f64, 1.0, 1u32);
    while n < 30 && term.abs() > NOTHING {
        term *= -x / n as f64;
        sum += term;
        n = n.saturating_add(1);
    }
    sum
}

/// Sine and cosine of an angle below pi, by their series.
pub(super) const fn sine_and_cosine(angle: f64) -> (f64, f64) {
    let turned = Complex::delay(angle);
    (-turned.im, turned.re)
}
