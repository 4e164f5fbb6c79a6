//! The way of the table back to where it started.
//!
//! A probe that goes with the load moves the table by about what counts as motion; one against the load takes the other
//! motor along instead, and does not bring the table back. So it creeps away, a micrometre or two with each such probe, until
//! both motors push it back against each other: by as many probes as it takes, as long as each brings it nearer.

/// How far the way back is.
#[derive(Clone, Copy, Debug, Default)]
pub(super) enum Return {
    #[default]
    Asked,
    /// How far the table was away at the last look, 2^-32 turn.
    From(i32),
    /// It is near, or did not come nearer.
    Done,
}

impl Return {
    /// Begins, if that is asked, from `away`, if that is not `near` enough.
    pub(super) const fn begin(&mut self, away: i32, near: u32) {
        if matches!(self, Self::Asked) {
            self.look(away, near, u32::MAX);
        }
    }

    /// After a probe: on from `away`, if that is not `near` enough, and nearer than before.
    pub(super) const fn go_on(&mut self, away: i32, near: u32) {
        if let Self::From(last) = *self {
            self.look(away, near, last.unsigned_abs());
        }
    }

    /// How far the table was away at the last look; `None`: there is no way back to go.
    pub(super) const fn away(self) -> Option<i32> {
        match self {
            Self::From(away) => Some(away),
            Self::Asked | Self::Done => None,
        }
    }

    const fn look(&mut self, away: i32, near: u32, last: u32) {
        let left = away.unsigned_abs();
        *self = if left > near && left < last {
            Self::From(away)
        } else {
            Self::Done
        };
    }
}
