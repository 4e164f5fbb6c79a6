//! Sums of harmonics of one angle, from one `sin_cos` of it.

use crate::effects::Law;

/// Squarings `z^(2^k)`, k = 0..8, of `z = e^(i angle)`: whole orders up to 255 are products of these.
const SQUARINGS: usize = 8;

type Complex = (f64, f64);

fn product((a, b): Complex, (c, d): Complex) -> Complex {
    (a * c - b * d, a * d + b * c)
}

/// The powers of `e^(i angle)` from which harmonics are taken.
#[derive(Debug, Clone)]
pub(super) struct Powers {
    squares: [Complex; SQUARINGS],
    pub(super) sin: f64,
    pub(super) cos: f64,
    angle: f64,
}

impl Powers {
    /// Powers of `angle` that suffice for orders of `bits` binary digits.
    #[inline]
    pub(super) fn new(angle: f64, bits: usize) -> Self {
        let (sin, cos) = angle.sin_cos();
        let mut squares = [(1.0, 0.0); SQUARINGS];
        let mut power = (cos, sin);
        for square in squares.iter_mut().take(bits) {
            *square = power;
            power = product(power, power);
        }
        Powers {
            squares,
            sin,
            cos,
            angle,
        }
    }
}

#[derive(Debug, Clone, Copy)]
struct Whole {
    order: u32,
    cos: f64,
    sin: f64,
}

/// A sum of harmonics of one angle.
#[derive(Debug, Clone, Default)]
pub(super) struct Harmonics {
    whole: Vec<Whole>,
    other: Vec<Law>,
}

impl Harmonics {
    /// Adds a term; any law will do, periodic ones of small whole order are the fast ones.
    pub(super) fn push(&mut self, law: Law) {
        match law {
            Law::Periodic {
                order,
                amplitude,
                phase,
            } if order.fract() == 0.0 && (1.0..f64::from(1u32 << SQUARINGS)).contains(&order) => {
                let (sin, cos) = phase.sin_cos();
                // Whole and below 256 by the guard.
                self.whole.push(Whole {
                    order: order as u32,
                    cos: amplitude * cos,
                    sin: amplitude * sin,
                });
            }
            law => self.other.push(law),
        }
    }

    /// Binary digits of the highest whole order, for [`Powers::new`].
    pub(super) fn bits(&self) -> usize {
        self.whole
            .iter()
            .map(|term| u32::BITS - term.order.leading_zeros())
            .max()
            .unwrap_or(0) as usize
    }

    pub(super) fn is_empty(&self) -> bool {
        self.whole.is_empty() && self.other.is_empty()
    }

    #[inline]
    pub(super) fn sum(&self, powers: &Powers) -> f64 {
        let mut sum = 0.0;
        for term in &self.whole {
            let mut left = term.order;
            let mut power = powers.squares[left.trailing_zeros() as usize % SQUARINGS];
            left &= left - 1;
            while left != 0 {
                power = product(
                    power,
                    powers.squares[left.trailing_zeros() as usize % SQUARINGS],
                );
                left &= left - 1;
            }
            sum += term.cos * power.0 - term.sin * power.1;
        }
        for law in &self.other {
            sum += law.value(powers.angle);
        }
        sum
    }
}
