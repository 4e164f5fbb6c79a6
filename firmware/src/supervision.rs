//! Once a millisecond: show what the current loops see, watch the tasks, feed the watchdog, report.

use crate::CONFIG;
use crate::debug_view::{DRIVE_VIEW, count};
use crate::hw::analog;
use crate::hw::watchdog::Watchdog;
use crate::motor_loop::MOTORS;
use control::format::ScaledCurrent;
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
    for (k, (motor, shared)) in view.motors.iter().zip(&MOTORS).enumerate() {
        let config = &CONFIG.current_loops[k];
        for (word, scaled) in motor.current.iter().zip(&shared.current) {
            let scaled = ScaledCurrent(scaled.load(Relaxed));
            word.store(config.sense.scale.current(scaled).to_bits(), Relaxed);
        }
        let theta_step = shared.exchange.status().theta_step;
        let omega_e = config.observer.omega_e(theta_step);
        motor.omega_e.store(omega_e.to_bits(), Relaxed);
        motor.steps.store(shared.exchange.periods(), Relaxed);
        for (word, from) in [
            (&motor.theta, &shared.theta),
            (&motor.missed, &shared.missed),
            (&motor.cycles, &shared.cycles),
            (&motor.cycles_max, &shared.cycles_max),
        ] {
            word.store(from.load(Relaxed), Relaxed);
        }
    }
    let [screw, nut] = &view.motors;
    let progress = [&screw.steps, &nut.steps, &view.speed_steps].map(|steps| steps.load(Relaxed));
    if let Err(task) = watchdog.feed(progress) {
        defmt::error!("no progress in a millisecond: {=str}", TASKS[task]);
    }
}
