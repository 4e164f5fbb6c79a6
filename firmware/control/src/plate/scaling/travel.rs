//! Soft limits and homing -> nanometres and words of the references.

use super::{attempt, positive, power_of_two, within};
use crate::base::format::{Misfit, Speed, SpeedChange};
use crate::plate::DrivePlate;
use crate::watch::travel::{
    LATENCY_S, LENGTH_BITS, PER_ACCELERATION_BITS, SQUARED_BITS, STANDS_BEFORE_M, TIME_BITS,
    TIME_PER_WORD_BITS, TravelConfig,
};
use core::f64::consts::TAU;

/// Longest that acceleration may take to its limit, s, where a soft limit is set.
const RISE_MAX_S: f64 = 8.0;

impl DrivePlate {
    /// # Errors
    /// [`Misfit`] if homing goes nowhere, or the soft limits are none, or not to be stopped before.
    pub(super) const fn travel_fits(&self) -> Result<(), Misfit> {
        let (home, feed) = (&self.travel.home, &self.feed);
        attempt!(positive("homing velocity", "m/s", home.velocity));
        attempt!(positive(
            "homing velocity off the switch",
            "m/s",
            home.leaving_velocity
        ));
        attempt!(positive("way of homing", "m", home.furthest_m));
        let (least, most) = (self.travel.soft_least_m, self.travel.soft_most_m);
        if least == most {
            return Ok(());
        }
        attempt!(within(
            "way between the soft limits",
            "m",
            most - least,
            2.0 * STANDS_BEFORE_M,
            1000.0
        ));
        // `config` has checked that they are positive.
        within(
            "time to the largest table acceleration",
            "s",
            feed.acceleration_max / feed.jerk_max,
            0.0,
            RISE_MAX_S,
        )
    }

    /// The soft limits, of a plate that has a configuration.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)]
    pub const fn travel_config(&self) -> TravelConfig {
        let (feed, step) = (&self.feed, self.speed_step());
        let nm = 1e9;
        // Of a radian of screw against nut.
        let per_radian = feed.lead_m / TAU * nm;
        let speed_word = power_of_two(Speed::FRAC_NBITS);
        let change_word = power_of_two(SpeedChange::FRAC_NBITS);
        let (acceleration, jerk) = (feed.acceleration_max * nm, feed.jerk_max * nm);
        let acceleration_word = per_radian / (change_word * step);
        let (second, length) = (power_of_two(TIME_BITS), power_of_two(LENGTH_BITS));
        let lag = 1.0 / self.tuning.speed_rad_s;
        // Squares are used without `2 * SQUARED_BITS + LENGTH_BITS`.
        let square = power_of_two(2 * SQUARED_BITS + LENGTH_BITS);
        let (least, most) = (self.travel.soft_least_m, self.travel.soft_most_m);
        TravelConfig {
            nm_per_count: (feed.scale_count_m * nm * length) as i64,
            ends_nm: if least == most {
                None
            } else {
                Some([(least * nm) as i64, (most * nm) as i64])
            },
            stands_before_nm: (STANDS_BEFORE_M * nm) as i64,
            velocity_per_word: (per_radian / speed_word * length) as i64,
            time_per_word: (acceleration_word / jerk * second * power_of_two(TIME_PER_WORD_BITS))
                as i64,
            acceleration_per_word: (acceleration_word * length) as i64,
            acceleration_more: (jerk * LATENCY_S) as i64,
            latency: (LATENCY_S * second) as i64,
            time: ((acceleration / (2.0 * jerk) + LATENCY_S + lag) * second) as i64,
            per_acceleration: (square / (2.0 * acceleration) * power_of_two(PER_ACCELERATION_BITS)
                + 1.0) as i64,
        }
    }
}
