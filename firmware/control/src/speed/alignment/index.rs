//! The index of an encoder, as an alignment meets it.
//!
//! An index puts the count to zero in hardware. The first time it does so after switching on, the count jumps from where it
//! happened to begin, and all that an alignment had found of the encoder with it. So the jump is seen here and taken out of
//! the angle that the alignment works in, and the turning goes on until the index was passed: after that the count means
//! the same for as long as the drive is on.

use super::MotorSeen;
use crate::base::format::Angle;
use crate::current::observer::EncoderAlignment;

/// In so much of a turn the index was passed, 2^-32 turn: one and an eighth. If the count did not jump then, it had begun
/// right, or there is no index, which the [`guard`](crate::guard) finds.
const PASSED: i64 = (1 << 32) + (1 << 29);

/// Steps after a jump in which the observer's speed is not the shaft's, where it had to follow: 12.8 ms at 5 kHz.
const FOLLOWED: u8 = 64;

/// The count of an encoder from its index on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Index {
    /// What is more than motion, 2^-32 turn; `None`: there is no index.
    jump_max: Option<u32>,
    /// The index was not yet passed.
    awaited: bool,
    last: Option<Angle>,
    /// By how much the count jumped.
    jumped: Angle,
    /// Turned in all.
    turned: i64,
    /// Steps until the observer has followed the jump.
    following: u8,
}

impl Index {
    /// An encoder whose first jump of more than `jump_max` is its index; `None`: it has none.
    pub(super) const fn new(jump_max: Option<u32>) -> Self {
        Self {
            jump_max,
            awaited: jump_max.is_some(),
            last: None,
            jumped: Angle(0),
            turned: 0,
            following: 0,
        }
    }

    /// The index was not yet passed.
    pub(super) const fn awaited(&self) -> bool {
        self.awaited
    }

    /// A step: gives `seen` the encoder's angle as if its count had not jumped. `true`: the count jumped after its index was passed,
    /// which no index does. Nothing is looked for while the shaft may still `coast` after a reset: the observer does not know its
    /// speed, and nothing of its angle has been found yet.
    pub(super) fn step(&mut self, seen: &mut MotorSeen, coasts: bool) -> bool {
        let last = self.last.replace(seen.theta).unwrap_or(seen.theta);
        let again = self
            .jump_max
            .is_some_and(|jump_max| !coasts && self.look(jump_max, last, seen));
        seen.theta = Angle(seen.theta.0.wrapping_sub(self.jumped.0));
        self.following = self.following.saturating_sub(1);
        again
    }

    /// The speed that is seen may be that of an observer which follows the jump.
    pub(super) const fn followed(&self) -> bool {
        self.following > 0
    }

    /// Looks for the jump: `true` if it is not the first.
    fn look(&mut self, jump_max: u32, last: Angle, seen: &MotorSeen) -> bool {
        let jump = seen.theta.minus(last.turned(seen.theta_step));
        let jumps = jump.unsigned_abs() > jump_max && !self.followed();
        if !self.awaited {
            return jumps;
        }
        let motion = if jumps {
            self.jumped = self.jumped.turned(jump);
            self.awaited = false;
            self.following = FOLLOWED;
            seen.theta_step
        } else {
            seen.theta.minus(last)
        };
        self.turned = self.turned.saturating_add(motion.into());
        if self.turned.unsigned_abs() > PASSED.unsigned_abs() {
            self.awaited = false;
        }
        false
    }

    /// What was found of the angle of [`Index::step`], of the encoder's own.
    pub(super) fn of_encoder(&self, found: EncoderAlignment, pole_pairs: u32) -> EncoderAlignment {
        EncoderAlignment {
            index_awaited: self.awaited(),
            ..found.past_index(self.jumped.minus(Angle(0)), pole_pairs)
        }
    }
}
