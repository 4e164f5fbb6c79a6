//! A brake that holds the table of an axis whose load drives the screw back while the bridges are off.
//!
//! It lets go once both bridges are closed, and the motors hold at rest until it has let go; only then the references move. It
//! closes where both references have come to rest, and the motors hold until it holds. Both times are the brake's own, which its
//! datasheet gives. Where the bridges open at once it closes with them, and the table falls for as long as that takes. The
//! alignment leaves it closed: the load is its.

/// State of the brake.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Brake {
    /// It is commanded to open.
    released: bool,
    /// Steps since its command last changed.
    steps: u32,
}

/// The brake's times in steps of the speed task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BrakeConfig {
    /// There is one.
    pub fitted: bool,
    /// Until it holds.
    pub closing_steps: u32,
    /// Until it has let go.
    pub opening_steps: u32,
}

impl Brake {
    /// Closed for as long as it has to be.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            released: false,
            steps: u32::MAX,
        }
    }

    /// One step in which it is commanded to open, or to hold.
    pub fn step(&mut self, release: bool) {
        self.steps = if release == self.released {
            self.steps.saturating_add(1)
        } else {
            0
        };
        self.released = release;
    }

    /// It is commanded to open.
    #[must_use]
    #[inline(always)]
    pub const fn is_released(&self) -> bool {
        self.released
    }

    /// It has let go, or there is none.
    #[must_use]
    pub const fn is_open(&self, config: &BrakeConfig) -> bool {
        !config.fitted || self.released && self.steps >= config.opening_steps
    }

    /// It holds, or there is none.
    #[must_use]
    pub const fn is_closed(&self, config: &BrakeConfig) -> bool {
        !config.fitted || !self.released && self.steps >= config.closing_steps
    }
}
