//! Once a millisecond: show what the current loops see, watch the tasks, feed the watchdog, report.

use crate::debug_view::{self, DRIVE_VIEW, count};
use crate::hw::analog;
use crate::hw::watchdog::Watchdog;
use core::sync::atomic::Ordering::Relaxed;

/// The tasks whose progress feeds the watchdog.
const TASKS: [&str; 3] = ["screw current loop", "nut current loop", "speed task"];

/// One millisecond.
pub(crate) fn step(watchdog: &mut Watchdog<3>) {
    let view = &DRIVE_VIEW;
    count(&view.uptime_ms);
    for (word, counts) in view.temperatures.iter().zip(analog::temperatures()) {
        word.store(u32::from(counts), Relaxed);
    }
    debug_view::refresh();
    let [screw, nut] = &view.motors;
    let progress = [&screw.steps, &nut.steps, &view.speed_steps].map(|steps| steps.load(Relaxed));
    if let Err(task) = watchdog.feed(progress) {
        defmt::error!("no progress in a millisecond: {=str}", TASKS[task]);
    }
}
