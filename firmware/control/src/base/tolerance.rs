//! How much of what should not happen is put up with: a tally that each event fills and each step without one drains.

/// What a [`Tally`] tolerates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tolerance {
    /// What an event adds; a step takes one off. So a rate above one event in `weight` steps grows without end.
    pub weight: u32,
    /// Events in a row that are still tolerated.
    pub events: u32,
}

/// Events of late, weighed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    level: u32,
}

impl Tally {
    /// Nothing happened yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { level: 0 }
    }

    /// A step in which `events` happened. `true` if that is more than tolerated.
    #[inline(always)]
    pub fn step(&mut self, tolerance: Tolerance, events: u32) -> bool {
        let limit = tolerance.weight.saturating_mul(tolerance.events);
        // Held at twice the limit, so that the way back is bounded too.
        self.level = self
            .level
            .saturating_sub(1)
            .saturating_add(events.saturating_mul(tolerance.weight))
            .min(limit.saturating_mul(2));
        self.level > limit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOLERANCE: Tolerance = Tolerance {
        weight: 16,
        events: 8,
    };

    #[test]
    fn a_run_of_events_and_a_rate_are_found_and_forgiven() {
        let mut tally = Tally::new();
        let first = (1..).find(|_| tally.step(TOLERANCE, 1));
        assert_eq!(first, Some(9), "eight in a row are tolerated");
        let forgiven = (1..).find(|_| !tally.step(TOLERANCE, 0));
        assert!(forgiven.is_some_and(|steps| steps < 200));

        for (every, fails) in [(15, true), (17, false)] {
            let mut tally = Tally::new();
            let failed = (0..100_000u32).any(|k| tally.step(TOLERANCE, u32::from(k % every == 0)));
            assert_eq!(failed, fails, "one in {every}");
        }
    }

    #[test]
    fn many_at_once_do_not_wrap() {
        let mut tally = Tally::new();
        assert!(tally.step(TOLERANCE, u32::MAX));
        assert!(tally.step(TOLERANCE, u32::MAX));
        assert_eq!((1..).find(|_| !tally.step(TOLERANCE, 0)), Some(128));
    }
}
