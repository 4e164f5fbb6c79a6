//! The drive's configuration, in RAM: the board's own, until the start has put another in its place.

use crate::board;
use control::guard::GuardConfig;
use control::plate::{DriveConfig, DrivePlate};
use control::speed_task::SpeedTask;
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

/// The board's own plate; with the feature `smooth` it learns the ripple that motors, encoders and lead usually have.
pub(crate) const PLATE: DrivePlate = if cfg!(feature = "smooth") {
    board::PLATE.smooth(board::SCALE_COUNT_M)
} else {
    board::PLATE
};

/// What is configured: all that the tasks read. The control's comes first: see [`Held`].
#[derive(Clone, Copy)]
#[repr(C)]
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

/// The speed task's state and what it is configured with, side by side, so that one address in a register serves for both.
#[repr(C)]
struct Held {
    task: UnsafeCell<MaybeUninit<SpeedTask>>,
    configured: UnsafeCell<Configured>,
}

// SAFETY: nobody writes what is configured, and the task's state is its task's alone.
unsafe impl Sync for Held {}

static HELD: Held = Held {
    task: UnsafeCell::new(MaybeUninit::uninit()),
    configured: UnsafeCell::new(BOARD),
};

/// Where the speed task's state lies.
///
/// # Safety
/// For the speed task alone, which may not have it twice at a time.
#[inline(always)]
pub(crate) unsafe fn task() -> &'static mut MaybeUninit<SpeedTask> {
    // SAFETY: as is asked of the caller.
    unsafe { &mut *HELD.task.get() }
}

/// The control's configuration.
#[inline(always)]
pub(crate) fn config() -> &'static DriveConfig {
    // SAFETY: nobody writes it once a task can run.
    unsafe { &(*HELD.configured.get()).drive }
}

/// The supervision's.
#[inline(always)]
pub(crate) fn guard() -> &'static GuardConfig {
    // SAFETY: as above.
    unsafe { &(*HELD.configured.get()).guard }
}
