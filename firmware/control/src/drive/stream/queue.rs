//! Set-points that wait for their turn.

use super::{SetPoint, SetPointError, WAITING};

/// A ring of them.
#[derive(Clone, Debug)]
pub(super) struct Queue {
    points: [SetPoint; WAITING],
    /// Counts those that were taken, and those that were added.
    first: usize,
    next: usize,
}

// The counts wrap in step with the ring.
const _: () = assert!(WAITING.is_power_of_two());

impl Queue {
    pub(super) const fn new() -> Self {
        const NONE: SetPoint = SetPoint {
            at_us: 0,
            position_nm: 0,
            velocity: None,
        };
        Self {
            points: [NONE; WAITING],
            first: 0,
            next: 0,
        }
    }

    pub(super) fn push(&mut self, point: SetPoint) -> Result<(), SetPointError> {
        if self.next.wrapping_sub(self.first) >= WAITING {
            return Err(SetPointError::Full);
        }
        let place = self.points.get_mut(self.next & (WAITING - 1));
        *place.ok_or(SetPointError::Full)? = point;
        self.next = self.next.wrapping_add(1);
        Ok(())
    }

    /// The first, which stays.
    pub(super) fn front(&self) -> Option<SetPoint> {
        if self.next == self.first {
            return None;
        }
        self.points.get(self.first & (WAITING - 1)).copied()
    }

    /// The first, which goes.
    pub(super) fn pop(&mut self) -> Option<SetPoint> {
        let point = self.front()?;
        self.first = self.first.wrapping_add(1);
        Some(point)
    }
}
