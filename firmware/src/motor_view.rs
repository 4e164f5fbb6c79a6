//! What the current loops see, for the tasks below them and for a probe session.

use crate::config::config;
use crate::debug_view::DRIVE_VIEW;
use crate::motor_loop::MOTORS;
use control::runaway::sum_events;
use core::sync::atomic::Ordering::Relaxed;

/// Angles of the shafts in their rotors' sense, screw and nut, 2^-32 turn, as the current loops last saw them.
pub(crate) fn angles() -> [u32; 2] {
    core::array::from_fn(|k| {
        let exchange = &MOTORS[k].exchange;
        let angle = config().current_loops[k]
            .observer
            .encoder
            .angle(exchange.encoder());
        let reversed = exchange.alignment().is_some_and(|held| held.reversed);
        if reversed {
            angle.0.wrapping_neg()
        } else {
            angle.0
        }
    })
}

/// The bridges are closed for currents in their rotors' frames, screw and nut: also in a fault, where one motor brings the table to rest.
pub(crate) fn closed() -> [bool; 2] {
    MOTORS.each_ref().map(|motor| motor.exchange.is_closed())
}

/// How far the three currents of a motor are from adding up to nothing, screw and nut: see [`sum_events`].
pub(crate) fn current_sums() -> [u32; 2] {
    core::array::from_fn(|k| {
        let codes = MOTORS[k].exchange.codes_of_one_period();
        sum_events(
            &config().runaway[k],
            &config().current_loops[k].sense,
            codes,
        )
    })
}

/// Once a millisecond: what the current loops see, in the view's formats.
pub(crate) fn refresh() {
    for (k, (view, motor)) in DRIVE_VIEW.motors.iter().zip(&MOTORS).enumerate() {
        let config = &config().current_loops[k];
        let (observer, exchange) = (&config.observer, &motor.exchange);
        let current = exchange.current();
        let current = [current.d, current.q].map(|i| config.sense.scale.current(i));
        for (word, current) in view.current.iter().zip(current) {
            word.store(current.to_bits(), Relaxed);
        }
        let omega_e = observer.omega_e(exchange.status().theta_step).to_bits();
        let omega = omega_e.checked_div(observer.pole_pairs.cast_signed());
        view.speed.store(omega.unwrap_or(0), Relaxed);
        DRIVE_VIEW.encoder_wrong[k].store(exchange.wrong_readings(), Relaxed);
        for (word, value) in [
            (&view.steps, exchange.periods()),
            (&view.encoder, exchange.encoder()),
            (&view.missed, exchange.missed()),
            (&view.cycles, motor.cycles.load(Relaxed)),
            (&view.cycles_max, motor.cycles_max.load(Relaxed)),
        ] {
            word.store(value, Relaxed);
        }
    }
}
