//! The drive's configuration, in RAM: the board's own, until the start has put another in its place.

use crate::board;
use control::guard::GuardConfig;
use control::plate::{DriveConfig, DrivePlate};
use core::cell::UnsafeCell;

/// The board's own plate; with the feature `smooth` it learns the ripple that motors, encoders and lead usually have.
pub(crate) const PLATE: DrivePlate = if cfg!(feature = "smooth") {
    board::PLATE.smooth(board::SCALE_COUNT_M)
} else {
    board::PLATE
};

/// What is configured: all that the tasks read.
#[derive(Clone, Copy)]
pub(crate) struct Configured {
    /// The control's.
    pub(crate) drive: DriveConfig,
    /// The supervision's.
    pub(crate) guard: GuardConfig,
}

/// Of the board's own plate, computed while compiling: a number that does not fit its format stops the build.
pub(crate) const BOARD: Configured = Configured {
    drive: match PLATE.config() {
        Ok(config) if cfg!(feature = "encoders-at-zero") => config.aligned(&PLATE),
        Ok(config) => config,
        Err(_) => {
            panic!("a number of the board's plate does not fit its fixed-point format")
        }
    },
    guard: board::GUARD,
};

struct Held(UnsafeCell<Configured>);

// SAFETY: nobody writes it.
unsafe impl Sync for Held {}

static HELD: Held = Held(UnsafeCell::new(BOARD));

/// The control's configuration.
#[inline(always)]
pub(crate) fn config() -> &'static DriveConfig {
    // SAFETY: nobody writes it once a task can run.
    unsafe { &(*HELD.0.get()).drive }
}

/// The supervision's.
#[inline(always)]
pub(crate) fn guard() -> &'static GuardConfig {
    // SAFETY: as above.
    unsafe { &(*HELD.0.get()).guard }
}
