//! What a probe session reads and writes while the drive runs: two structures of words at known symbols.
//!
//! `DRIVE_VIEW` is for reading. `DRIVE_COMMAND` is how the drive is told to move. Each word is whole by itself;
//! nothing here needs the core to be halted. The order of the words is the interface: add at the end, and raise
//! [`LAYOUT`].

use core::sync::atomic::{AtomicI32, AtomicU32, Ordering::Relaxed};

/// First word of the view: `DDFV`, little-endian.
const MAGIC: u32 = u32::from_le_bytes(*b"DDFV");
/// Number of this layout.
const LAYOUT: u32 = 1;

/// One motor, as its current loop saw it in the last millisecond.
#[repr(C)]
pub(crate) struct MotorView {
    /// Current, 2^-20 A: `i_d`, `i_q`.
    pub(crate) current: [AtomicI32; 2],
    /// Electrical speed, 2^-16 rad/s.
    pub(crate) omega_e: AtomicI32,
    /// Mechanical angle, 2^-32 turn.
    pub(crate) theta: AtomicU32,
    /// Steps of the current loop.
    pub(crate) steps: AtomicU32,
    /// Steps that ended after their period had begun.
    pub(crate) missed: AtomicU32,
    /// Cycles of the last step.
    pub(crate) cycles: AtomicU32,
    /// Cycles of the longest step.
    pub(crate) cycles_max: AtomicU32,
}

impl MotorView {
    const fn new() -> Self {
        Self {
            current: [AtomicI32::new(0), AtomicI32::new(0)],
            omega_e: AtomicI32::new(0),
            theta: AtomicU32::new(0),
            steps: AtomicU32::new(0),
            missed: AtomicU32::new(0),
            cycles: AtomicU32::new(0),
            cycles_max: AtomicU32::new(0),
        }
    }
}

/// The whole drive.
#[repr(C)]
pub(crate) struct DriveView {
    magic: AtomicU32,
    layout: AtomicU32,
    /// 0 off, 1 calibrating, 2 ready, 3 running, 4 stopping, 5 fault.
    pub(crate) state: AtomicU32,
    /// 0 none, else the code of the fault: see `fault_code`.
    pub(crate) fault: AtomicU32,
    /// Reason of the last reset: see `ResetReason`.
    pub(crate) reset_reason: AtomicU32,
    /// Time since the start, ms.
    pub(crate) uptime_ms: AtomicU32,
    /// Steps of the speed task.
    pub(crate) speed_steps: AtomicU32,
    /// Times that the speed task was still at work when its next step was due.
    pub(crate) speed_missed: AtomicU32,
    /// Cycles of its last step, interruptions included.
    pub(crate) speed_cycles: AtomicU32,
    /// Cycles of its longest step, interruptions included.
    pub(crate) speed_cycles_max: AtomicU32,
    /// The table's scale, counts.
    pub(crate) scale: AtomicI32,
    /// Heat sinks, ADC counts: screw, nut.
    pub(crate) temperatures: [AtomicU32; 2],
    /// Commands that were refused.
    pub(crate) refused: AtomicU32,
    /// Screw, nut.
    pub(crate) motors: [MotorView; 2],
}

/// What is asked of the drive. Write `velocity` and `base` first, then count `sequence` up; `run` acts at once.
#[repr(C)]
pub(crate) struct DriveCommand {
    /// Table velocity, 2^-28 m/s.
    pub(crate) velocity: AtomicI32,
    /// Base speed, 2^-18 rad/s, mechanical.
    pub(crate) base: AtomicI32,
    /// A new value makes the drive take the two words above.
    pub(crate) sequence: AtomicU32,
    /// 0: come to rest. 1: run. 2: come to rest and leave a fault whose cause is gone.
    pub(crate) run: AtomicU32,
}

impl DriveCommand {
    /// The drive shall run.
    #[inline(always)]
    pub(crate) fn asks_run(&self) -> bool {
        self.run.load(Relaxed) == 1
    }

    /// The drive shall leave a fault.
    #[inline(always)]
    pub(crate) fn asks_reset(&self) -> bool {
        self.run.load(Relaxed) == 2
    }
}

/// At a symbol that a debugger knows.
#[used]
#[unsafe(no_mangle)]
pub(crate) static DRIVE_VIEW: DriveView = DriveView {
    magic: AtomicU32::new(MAGIC),
    layout: AtomicU32::new(LAYOUT),
    state: AtomicU32::new(0),
    fault: AtomicU32::new(0),
    reset_reason: AtomicU32::new(0),
    uptime_ms: AtomicU32::new(0),
    speed_steps: AtomicU32::new(0),
    speed_missed: AtomicU32::new(0),
    speed_cycles: AtomicU32::new(0),
    speed_cycles_max: AtomicU32::new(0),
    scale: AtomicI32::new(0),
    temperatures: [AtomicU32::new(0), AtomicU32::new(0)],
    refused: AtomicU32::new(0),
    motors: [MotorView::new(), MotorView::new()],
};

/// At a symbol that a debugger knows.
#[used]
#[unsafe(no_mangle)]
pub(crate) static DRIVE_COMMAND: DriveCommand = DriveCommand {
    velocity: AtomicI32::new(0),
    base: AtomicI32::new(0),
    sequence: AtomicU32::new(0),
    run: AtomicU32::new(0),
};

/// Counts a word up. Only the word's one writer may call it.
#[inline(always)]
pub(crate) fn count(word: &AtomicU32) -> u32 {
    let next = word.load(Relaxed).wrapping_add(1);
    word.store(next, Relaxed);
    next
}

/// Keeps the largest value. Only the word's one writer may call it.
#[inline(always)]
pub(crate) fn keep_max(word: &AtomicU32, value: u32) {
    if value > word.load(Relaxed) {
        word.store(value, Relaxed);
    }
}
