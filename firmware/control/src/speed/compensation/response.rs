//! How a motor's loops answer at a frequency: what turns a torque into a current reference, and an error into learning.
//!
//! The loops' phase turns with speed, so that a current which cancels a ripple at one speed adds to it at another. What is
//! learned is therefore the ripple's torque, which does not depend on speed; the model of the loops, from the plate, maps it
//! to a reference. A table over speed for each order would need every speed to be visited, and forgets nothing that the model
//! knows. What the model is wrong by, the learning takes: it converges while the model's phase is right within a quarter turn.

use super::line::Phasor;

/// Points an octave, as a power of two.
const STEP_BITS: u32 = 1;
/// The lowest point, 2^-32 turn a PWM period: 0.08 Hz at 20 kHz.
const LOWEST_BITS: u32 = 14;
/// The octave after the last: an eighth turn a PWM period.
const HIGHEST_BITS: u32 = 29;
/// Points of the table.
pub(crate) const POINTS: usize = ((HIGHEST_BITS - LOWEST_BITS) << STEP_BITS) as usize + 1;

/// The loops at one frequency.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ResponsePoint {
    /// Current reference per torque current, 2^-27: the current loop's and its delays' inverse.
    pub realise: Phasor,
    /// Learned torque current per speed error in electrical rad/s and step, 2^-34 A s, where it is learned at the full rate.
    pub learn: Phasor,
    /// Reference per true speed, 2^-29: the inverse of how the speed follows.
    pub follow: Phasor,
}

impl ResponsePoint {
    const NONE: Self = Self {
        realise: Phasor::ZERO,
        learn: Phasor::ZERO,
        follow: Phasor::ZERO,
    };
}

/// The loops between two points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BetweenPoints<'a> {
    from: &'a ResponsePoint,
    to: &'a ResponsePoint,
    /// [`Response::sense`] at both.
    sense: [[i8; 2]; 2],
    /// Part of the way from one to the other, 2^-31.
    way: i32,
    /// Below the table nothing is learned.
    learns: bool,
}

impl BetweenPoints<'_> {
    /// One of [`ResponsePoint`]'s numbers.
    #[must_use]
    #[inline(always)]
    pub fn of(&self, number: impl Fn(&ResponsePoint) -> Phasor) -> Phasor {
        between(number(self.from), number(self.to), self.way)
    }

    /// [`Response::sense`], 2^-30.
    #[must_use]
    #[inline(always)]
    pub fn sense(&self) -> Phasor {
        let [from, to] = self.sense.map(|[re, im]| Phasor {
            re: i32::from(re) << 24,
            im: i32::from(im) << 24,
        });
        between(from, to, self.way)
    }

    /// One that turns an error into learning.
    #[must_use]
    #[inline(always)]
    pub fn learning(&self, number: impl Fn(&ResponsePoint) -> Phasor) -> Phasor {
        match self.learns {
            true => self.of(number),
            false => Phasor::ZERO,
        }
    }
}

/// The loops over frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// Rising, a quarter octave apart on a straight line each.
    pub points: [ResponsePoint; POINTS],
    /// At each point: what cancels an error of the encoder in the speed reference, per error of the speed, 2^-6. The observer delays the
    /// error, and the hold of what is added delays that. Stack and RAM hold it many times, and 1 % is enough: the lines between points
    /// are off by more.
    pub sense: [[i8; 2]; POINTS],
    /// What is above is not compensated, 2^-32 turn a PWM period.
    pub frequency_max: u32,
}

impl Response {
    /// That of a drive that compensates nothing.
    pub(crate) const NONE: Self = Self {
        points: [ResponsePoint::NONE; POINTS],
        sense: [[0; 2]; POINTS],
        frequency_max: 0,
    };

    /// Frequency of a point, 2^-32 turn a PWM period.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)]
    pub(crate) const fn frequency(point: usize) -> u32 {
        let point = point as u32;
        let octave = LOWEST_BITS.wrapping_add(point >> STEP_BITS) & 31;
        let quarter = point & ((1 << STEP_BITS) - 1);
        1u32.wrapping_shl(octave)
            .wrapping_add(quarter.wrapping_shl(octave.wrapping_sub(STEP_BITS) & 31))
    }

    /// The loops at `frequency`, 2^-32 turn a PWM period, on a straight line between two points; `None` beyond the table and
    /// past [`Response::frequency_max`]. Below the table nothing is learned.
    #[must_use]
    #[inline(never)]
    pub fn at(&self, frequency: u32) -> Option<BetweenPoints<'_>> {
        if frequency > self.frequency_max {
            return None;
        }
        let ([first, ..], [sense, ..]) = (&self.points, &self.sense);
        if frequency < 1 << LOWEST_BITS {
            return Some(BetweenPoints {
                from: first,
                to: first,
                sense: [*sense; 2],
                way: 0,
                learns: false,
            });
        }
        let octave = 31u32.wrapping_sub(frequency.leading_zeros());
        let rest = frequency.wrapping_shl(32u32.wrapping_sub(octave));
        let index = (octave.wrapping_sub(LOWEST_BITS) << STEP_BITS)
            .wrapping_add(rest >> (32 - STEP_BITS)) as usize;
        Some(BetweenPoints {
            from: self.points.get(index)?,
            to: self.points.get(index.wrapping_add(1))?,
            sense: [
                *self.sense.get(index)?,
                *self.sense.get(index.wrapping_add(1))?,
            ],
            way: (rest << STEP_BITS >> 1).cast_signed(),
            learns: true,
        })
    }
}

#[inline(always)]
fn between(from: Phasor, to: Phasor, way: i32) -> Phasor {
    let one = |from: i32, to: i32| {
        let difference = i64::from(to).wrapping_sub(from.into());
        // A part below one of the difference of two words, added to the first of them.
        #[allow(clippy::cast_possible_truncation)]
        let gained = (difference.wrapping_mul(way.into()) >> 31) as i32;
        from.wrapping_add(gained)
    };
    Phasor {
        re: one(from.re, to.re),
        im: one(from.im, to.im),
    }
}
