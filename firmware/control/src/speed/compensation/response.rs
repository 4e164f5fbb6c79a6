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

/// The loops over frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// Rising, a quarter octave apart on a straight line each.
    pub points: [ResponsePoint; POINTS],
    /// What is above is not compensated, 2^-32 turn a PWM period.
    pub frequency_max: u32,
}

impl Response {
    /// That of a drive that compensates nothing.
    pub(crate) const NONE: Self = Self {
        points: [ResponsePoint {
            realise: Phasor::ZERO,
            learn: Phasor::ZERO,
            follow: Phasor::ZERO,
        }; POINTS],
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
    pub fn at(&self, frequency: u32) -> Option<ResponsePoint> {
        if frequency > self.frequency_max {
            return None;
        }
        let [first, ..] = &self.points;
        if frequency < 1 << LOWEST_BITS {
            return Some(ResponsePoint {
                learn: Phasor::ZERO,
                follow: Phasor::ZERO,
                ..*first
            });
        }
        let octave = 31u32.wrapping_sub(frequency.leading_zeros());
        let rest = frequency.wrapping_shl(32u32.wrapping_sub(octave));
        let index = (octave.wrapping_sub(LOWEST_BITS) << STEP_BITS)
            .wrapping_add(rest >> (32 - STEP_BITS)) as usize;
        // 2^-31 of the way to the next point.
        let way = (rest << STEP_BITS >> 1).cast_signed();
        let (from, to) = (
            self.points.get(index)?,
            self.points.get(index.wrapping_add(1))?,
        );
        Some(ResponsePoint {
            realise: between(from.realise, to.realise, way),
            learn: between(from.learn, to.learn, way),
            follow: between(from.follow, to.follow, way),
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
