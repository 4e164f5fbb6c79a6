//! What the current loops see, for the parts below them and for a probe session.

use control::exchange::MotorExchange;
use control::plate::DriveConfig;
use control::runaway::sum_events;
use control::standing_watch::asked_torque;
use core::sync::atomic::Ordering::Relaxed;
use link::view::DriveView;

/// Angles of the shafts in their rotors' sense, screw and nut, 2^-32 turn, as the current loops last saw them.
pub(crate) fn angles(motors: [&MotorExchange; 2], config: &DriveConfig) -> [u32; 2] {
    core::array::from_fn(|k| {
        let encoder = &config.current_loops[k].observer.encoder;
        let angle = encoder.angle(motors[k].encoder());
        let reversed = motors[k].alignment().is_some_and(|held| held.reversed);
        if reversed {
            angle.0.wrapping_neg()
        } else {
            angle.0
        }
    })
}

/// How far the three currents of a motor are from adding up to nothing, screw and nut: see [`sum_events`].
pub(crate) fn current_sums(motors: [&MotorExchange; 2], config: &DriveConfig) -> [u32; 2] {
    core::array::from_fn(|k| {
        let codes = motors[k].codes_of_one_period();
        sum_events(&config.runaway[k], &config.current_loops[k].sense, codes)
    })
}

/// The torque that is asked of each motor: see [`asked_torque`].
pub(crate) fn asked_torques(motors: [&MotorExchange; 2], config: &DriveConfig) -> [i32; 2] {
    core::array::from_fn(|k| {
        asked_torque(motors[k], &config.current_loops[k], &config.speed_loops[k])
    })
}

/// What the current loops see, in the view's formats.
pub(crate) fn refresh(view: &DriveView, motors: [&MotorExchange; 2], config: &DriveConfig) {
    for (k, (shown, exchange)) in view.motors.iter().zip(motors).enumerate() {
        let config = &config.current_loops[k];
        let current = exchange.current();
        let current = [current.d, current.q].map(|i| config.sense.scale.current(i));
        for (word, current) in shown.current.iter().zip(current) {
            word.store(current.to_bits(), Relaxed);
        }
        let observer = &config.observer;
        let omega_e = observer.omega_e(exchange.status().theta_step).to_bits();
        let omega = omega_e.checked_div(observer.pole_pairs.cast_signed());
        shown.speed.store(omega.unwrap_or(0), Relaxed);
        view.encoder_wrong[k].store(exchange.wrong_readings(), Relaxed);
        for (word, value) in [
            (&shown.steps, exchange.periods()),
            (&shown.encoder, exchange.encoder()),
            (&shown.missed, exchange.missed()),
        ] {
            word.store(value, Relaxed);
        }
    }
}
