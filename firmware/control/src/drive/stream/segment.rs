//! The way from one set-point to the next: a cubic with given velocities at its ends.

use super::{SetPoint, TIME_BITS};
use crate::base::format::TableVelocity;

/// Fraction bits of a position, nm.
pub(super) const NM_BITS: u32 = 16;
/// Of the part of a segment's time.
const PART_BITS: u32 = 30;

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
        let velocity = next.velocity.unwrap_or_else(|| {
            let to = behind.unwrap_or(next);
            let way = Knot::of(to, TableVelocity::ZERO)
                .position
                .saturating_sub(from.position);
            let us = i64::from(to.at_us.wrapping_sub(from.at_us));
            // From 2^-16 nm a us to 2^-28 m/s: a thousandth, 2^12. A way is within 2^47.
            let per_us = way
                .wrapping_shl(TIME_BITS)
                .checked_div(us.saturating_mul(1000));
            let most = i64::from(i32::MAX);
            // Clamped to 32 bits.
            #[allow(clippy::cast_possible_truncation)]
            let bits = per_us
                .unwrap_or_default()
                .clamp(most.saturating_neg(), most) as i32;
            TableVelocity::from_bits(bits)
        });
        Self {
            from,
            to: Knot::of(next, velocity),
        }
    }

    /// Position, 2^-16 nm, at a time within it; at its start before that.
    #[allow(clippy::arithmetic_side_effects)]
    pub(super) fn at(&self, clock_us: u32) -> i64 {
        let us = i64::from(self.to.at_us.wrapping_sub(self.from.at_us));
        let gone = i64::from(clock_us.wrapping_sub(self.from.at_us).cast_signed()).clamp(0, us);
        let Some(part) = (gone << PART_BITS).checked_div(us) else {
            return self.from.position;
        };
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
