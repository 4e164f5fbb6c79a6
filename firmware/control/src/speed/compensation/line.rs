//! One order of a ripple: a complex coefficient, what it gives at an angle, and how it learns.

use crate::base::format::{Angle, Unit, multiply_upper};

/// Repetitions of a ripple in a mechanical turn, 2^-16: 0 is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Order(pub u32);

impl Order {
    /// The ripple's own angle at a shaft's angle over many turns, 2^-32 turn. Such an angle may wrap at 2^16 turns, which
    /// are whole repetitions of any order.
    #[must_use]
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)]
    pub const fn angle(self, turned: u64) -> Angle {
        self.angle_of_shifted(turned << 16)
    }

    /// The same of an angle that is shifted up by the 16 bits that a repetition's fraction takes: then it is a product's upper
    /// word.
    #[must_use]
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)]
    pub(super) const fn angle_of_shifted(self, turned: u64) -> Angle {
        Angle((turned.wrapping_mul(self.0 as u64) >> 32) as u32)
    }

    /// The ripple's frequency, 2^-32 turn a PWM period, of a shaft that turns by `theta_step` a period, either way.
    #[must_use]
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)]
    pub const fn frequency(self, theta_step: i32) -> u32 {
        let wide = (theta_step.unsigned_abs() as u64).wrapping_mul(self.0 as u64) >> 16;
        if wide > u32::MAX as u64 {
            u32::MAX
        } else {
            wide as u32
        }
    }
}

/// A complex number of two words.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Phasor {
    /// In phase with the cosine.
    pub re: i32,
    /// A quarter ahead.
    pub im: i32,
}

impl Phasor {
    /// Zero.
    pub const ZERO: Self = Self { re: 0, im: 0 };

    /// What a shaft that turns the other way makes of a response: its conjugate.
    #[must_use]
    #[inline(always)]
    pub const fn turned_by(self, theta_step: i32) -> Self {
        if theta_step < 0 {
            Self {
                re: self.re,
                im: self.im.wrapping_neg(),
            }
        } else {
            self
        }
    }

    /// The product of two, each word of which is the upper word of a sum within 63 bits, shifted left by `shift` and cut to
    /// its word.
    #[must_use]
    #[inline(always)]
    pub fn times(self, other: Self, shift: u32) -> Self {
        let product = |a: i32, b: i32| i64::from(a).wrapping_mul(i64::from(b)) >> 1;
        let part = |x: i64| saturated(x, 31u32.saturating_sub(shift));
        Self {
            re: part(product(self.re, other.re).wrapping_sub(product(self.im, other.im))),
            im: part(product(self.re, other.im).wrapping_add(product(self.im, other.re))),
        }
    }

    /// The sum of two.
    #[must_use]
    #[inline(always)]
    pub const fn plus(self, other: Self) -> Self {
        Self {
            re: self.re.saturating_add(other.re),
            im: self.im.saturating_add(other.im),
        }
    }

    /// The difference of two, of parts within 2^30.
    #[must_use]
    #[inline(always)]
    pub const fn minus(self, other: Self) -> Self {
        Self {
            re: self.re.wrapping_sub(other.re),
            im: self.im.wrapping_sub(other.im),
        }
    }

    /// Halved so many times.
    #[must_use]
    #[inline(always)]
    pub const fn halved(self, times: u32) -> Self {
        Self {
            re: self.re.wrapping_shr(times),
            im: self.im.wrapping_shr(times),
        }
    }

    /// Times a part of 2^31.
    #[must_use]
    #[inline(always)]
    pub fn part(self, part: i32) -> Self {
        let times = |x| multiply_upper(x, part).saturating_mul(2);
        Self {
            re: times(self.re),
            im: times(self.im),
        }
    }
}

/// `x >> shift`, cut to a word.
#[inline(always)]
#[allow(clippy::cast_possible_truncation)]
fn saturated(x: i64, shift: u32) -> i32 {
    (x >> (shift & 63)).clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32
}

/// One order's state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Line {
    /// How often it repeats in a turn.
    order: Order,
    /// The coefficient: `re + j im`, upper words.
    learned: [i64; 2],
    /// What it gives at the present speed, in the unit of what is given.
    gives: Phasor,
    /// What an error adds to it.
    learns: Phasor,
}

impl Line {
    /// A line that gives nothing.
    pub const NONE: Self = Self::starting(Order(0), Phasor::ZERO);

    /// A line that was learned before.
    #[must_use]
    pub const fn starting(order: Order, coefficient: Phasor) -> Self {
        let Phasor { re, im } = coefficient;
        Self {
            order,
            learned: [wide_of(re), wide_of(im)],
            gives: Phasor::ZERO,
            learns: Phasor::ZERO,
        }
    }

    /// How often it repeats in a turn.
    #[must_use]
    #[inline(always)]
    pub const fn order(&self) -> Order {
        self.order
    }

    /// What was learned.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)]
    pub const fn coefficient(&self) -> Phasor {
        let [re, im] = self.learned;
        Phasor {
            re: (re >> 32) as i32,
            im: (im >> 32) as i32,
        }
    }

    /// It learns at the present speed.
    #[must_use]
    #[inline(always)]
    pub fn learns(&self) -> bool {
        self.learns != Phasor::ZERO
    }

    /// Goes on from another coefficient.
    pub const fn learn_anew(&mut self, coefficient: Phasor) {
        let Phasor { re, im } = coefficient;
        self.learned = [wide_of(re), wide_of(im)];
    }

    /// Forgets what was learned.
    pub fn restart(&mut self) {
        *self = Self::starting(self.order, Phasor::ZERO);
    }

    /// Takes what it gives and learns at another speed, and holds what it has learned to `most` in each part.
    #[inline(always)]
    pub fn tune(&mut self, gives: Phasor, learns: Phasor, most: i32) {
        let end = i64::from(most).wrapping_shl(32);
        self.learned = self
            .learned
            .map(|part| part.min(end).max(end.wrapping_neg()));
        (self.gives, self.learns) = (gives, learns);
    }

    /// The value at an angle, given by its cosine and sine, in twice the unit of `gives`.
    #[must_use]
    #[inline(always)]
    pub fn value(&self, (cos, sin): (Unit, Unit)) -> i32 {
        // Cosine and sine never have |cos| + |sin| above sqrt(2): the sum is within 1.42 * 2^30.
        multiply_upper(self.gives.re, cos.to_bits())
            .wrapping_sub(multiply_upper(self.gives.im, sin.to_bits()))
    }

    /// Learns from the error at that angle, within 2^25: `learned += error * e^(-j angle) * learns / 2`.
    #[inline(always)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    pub fn learn(&mut self, (cos, sin): (Unit, Unit), error: i32) {
        let (cos, sin) = (cos.to_bits(), sin.to_bits());
        let Phasor { re, im } = self.learns;
        // Each sum within 1.42 * 2^30, as above.
        let towards = [
            multiply_upper(re, cos).wrapping_add(multiply_upper(im, sin)),
            multiply_upper(im, cos).wrapping_sub(multiply_upper(re, sin)),
        ];
        let error = i64::from(error);
        for (learned, towards) in self.learned.iter_mut().zip(towards) {
            // An error is within 2^25, so a product within 2^56; the state is within 2^61 after each tuning, of which there is
            // one in 64 steps at least.
            *learned = learned.wrapping_add(error.wrapping_mul(i64::from(towards)));
        }
    }
}

const fn wide_of(x: i32) -> i64 {
    (x as i64).wrapping_shl(32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn an_orders_angle_goes_on_through_the_wrap_of_turns(
            order in 1u32..1000 << 16, turns in any::<u16>(), theta in any::<u32>(),
        ) {
            let order = Order(order);
            let at = |turns: u64| u64::from(theta) + (turns << 32);
            // 2^16 turns are whole repetitions of any order.
            prop_assert_eq!(order.angle(at(turns.into())), order.angle(at(u64::from(turns) + (1 << 16))));
            let exact = f64::from(order.0) / 65_536.0 * (f64::from(turns) + f64::from(theta) / 2f64.powi(32));
            let off = order.angle(at(turns.into())).minus(Angle::from_turns(exact.fract()));
            prop_assert!(f64::from(off).abs() < 2f64.powi(32 - 20), "{off} of 2^32 off");
        }

        #[test]
        fn a_product_is_the_complex_one(re in any::<i32>(), im in any::<i32>(), other in any::<(i32, i32)>(), shift in 0u32..16) {
            let got = Phasor { re, im }.times(Phasor { re: other.0, im: other.1 }, shift);
            let exact = [
                f64::from(re) * f64::from(other.0) - f64::from(im) * f64::from(other.1),
                f64::from(re) * f64::from(other.1) + f64::from(im) * f64::from(other.0),
            ]
            .map(|x| x / 2f64.powi(32 - shift as i32));
            for (got, exact) in [got.re, got.im].into_iter().zip(exact) {
                let cut = exact.clamp(f64::from(i32::MIN), f64::from(i32::MAX));
                prop_assert!((f64::from(got) - cut).abs() <= 2.0, "{got} for {exact}");
            }
        }

        /// Debug builds panic where a sum would leave its format.
        #[test]
        fn no_end_overflows(
            learns in any::<(i32, i32)>(),
            steps in prop::collection::vec((any::<u32>(), -(1 << 25)..=1i32 << 25), 64),
        ) {
            let mut line = Line::starting(Order(1), Phasor { re: 1 << 28, im: -(1 << 28) });
            line.tune(Phasor { re: i32::MIN, im: i32::MAX }, Phasor { re: learns.0, im: learns.1 }, 1 << 28);
            let mut exact = [0f64; 2].map(|_| 0.0);
            for (angle, error) in steps {
                let at = Angle(angle).cos_sin();
                let _ = line.value(at);
                line.learn(at, error);
                let (cos, sin) = (at.0.to_num::<f64>(), at.1.to_num::<f64>());
                exact[0] += f64::from(error) * (f64::from(learns.0) * cos + f64::from(learns.1) * sin) / 2f64.powi(33);
                exact[1] += f64::from(error) * (f64::from(learns.1) * cos - f64::from(learns.0) * sin) / 2f64.powi(33);
            }
            let Phasor { re, im } = line.coefficient();
            let start = f64::from(1 << 28);
            prop_assert!((f64::from(re) - start - exact[0]).abs() < 4.0, "{re} for {}", exact[0] + start);
            prop_assert!((f64::from(im) + start - exact[1]).abs() < 4.0, "{im} for {}", exact[1] - start);
        }
    }
}
