//! The way from one set-point to the next: a cubic with given velocities at its ends.

use super::{SetPoint, TIME_BITS};
use crate::base::format::TableVelocity;

/// Fraction bits of a position, nm.
pub(super) const NM_BITS: u32 = 16;
/// Of the part of a segment's time, and the bits that each division finds of it.
const PART_BITS: u32 = 46;
const DIVISIONS: [u32; 4] = [12, 12, 12, 10];
/// 2^-28 m/s of 2^-16 nm a us: 2^12 / 1000, in 2^-20.
const PER_US: i128 = 4_294_967;
const PER_US_BITS: u32 = 20;

/// An end of a segment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Knot {
    /// Time in the stream, us, which wraps.
    pub(super) at_us: u32,
    /// 2^-16 nm.
    pub(super) position: i64,
    pub(super) velocity: TableVelocity,
}

impl Knot {
    pub(super) const fn of(point: SetPoint, velocity: TableVelocity) -> Self {
        Self {
            at_us: point.at_us,
            // Positions are within 2^46 nm.
            position: point.position_nm.wrapping_shl(NM_BITS),
            velocity,
        }
    }

    /// The velocity of an even way to `point`.
    #[allow(clippy::arithmetic_side_effects)]
    fn velocity_to(self, point: SetPoint) -> TableVelocity {
        let way = Self::of(point, TableVelocity::ZERO)
            .position
            .saturating_sub(self.position);
        let per_us = quotient(1, point.at_us.wrapping_sub(self.at_us));
        // A way of 48 bits, times 31, times 23.
        let product = i128::from(way) * i128::from(per_us) * PER_US;
        let bits = product >> (PART_BITS + PER_US_BITS);
        let most = i128::from(i32::MAX);
        // Clamped to 32 bits.
        #[allow(clippy::cast_possible_truncation)]
        TableVelocity::from_bits(bits.clamp(-most, most) as i32)
    }
}

/// `part / whole`, 2^-46, of a whole below 2^17 and a part up to that; 0 where there is no whole. By 32-bit divisions, which the
/// core has: a 64-bit one is a loop.
#[allow(clippy::arithmetic_side_effects)]
fn quotient(part: u32, whole: u32) -> i64 {
    let (mut left, mut found) = (part.min(whole), 0i64);
    for bits in DIVISIONS {
        let dividend = left << bits;
        let digit = dividend.checked_div(whole).unwrap_or_default();
        left = dividend - digit * whole;
        found = found << bits | i64::from(digit);
    }
    found
}

/// From one set-point to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Segment {
    from: Knot,
    to: Knot,
}

impl Segment {
    /// At zero.
    pub(super) const NONE: Self = {
        const ZERO: Knot = Knot {
            at_us: 0,
            position: 0,
            velocity: TableVelocity::ZERO,
        };
        Self {
            from: ZERO,
            to: ZERO,
        }
    };

    pub(super) const fn new(from: Knot, to: Knot) -> Self {
        Self { from, to }
    }

    pub(super) const fn is_over(&self, clock_us: u32) -> bool {
        clock_us.wrapping_sub(self.to.at_us).cast_signed() > 0
    }

    pub(super) const fn end_us(&self) -> u32 {
        self.to.at_us
    }

    /// The segment from its end to `next`. The velocity there is `next`'s own, else that from this end to the one `behind`, or to
    /// `next` where there is none yet. It stays, so that the velocity has no step.
    pub(super) fn followed_by(&self, next: SetPoint, behind: Option<SetPoint>) -> Self {
        let from = self.to;
        let velocity = next
            .velocity
            .unwrap_or_else(|| from.velocity_to(behind.unwrap_or(next)));
        Self {
            from,
            to: Knot::of(next, velocity),
        }
    }

    /// Position, 2^-16 nm, at a time within it; at its start before that.
    #[allow(clippy::arithmetic_side_effects)]
    pub(super) fn at(&self, clock_us: u32) -> i64 {
        let whole = self.to.at_us.wrapping_sub(self.from.at_us);
        let us = i64::from(whole);
        let gone = clock_us.wrapping_sub(self.from.at_us).cast_signed();
        if gone <= 0 || whole == 0 {
            return self.from.position;
        }
        let part = quotient(gone.cast_unsigned(), whole);
        // What each end's velocity makes of the time, 2^-16 nm: 32 bits times 26 in 2^-12.
        let of_velocity = |velocity: TableVelocity| {
            i64::from(velocity.to_bits()).saturating_mul(us.saturating_mul(1000)) >> TIME_BITS
        };
        let [begins, ends] = [self.from.velocity, self.to.velocity].map(of_velocity);
        let way = self.to.position.saturating_sub(self.from.position);
        // Within 2^50 each: sums of a few fit.
        let times = |x: i64| {
            #[allow(clippy::cast_possible_truncation)]
            let product = ((i128::from(x) * i128::from(part)) >> PART_BITS) as i64;
            product
        };
        let cubic = begins + ends - 2 * way;
        let square = 3 * way - 2 * begins - ends;
        let gone = times(begins + times(square + times(cubic)));
        self.from.position.saturating_add(gone)
    }
}
