//! Limits of a runaway: parts of what a motor may do -> counts, steps, looks.

use super::{attempt, gain, power_of_two, within};
use crate::base::format::{Misfit, fixed_point, quantise};
use crate::base::rates::STEPS_PER_LOOK;
use crate::base::tolerance::Tolerance;
use crate::plate::{DrivePlate, MotorPlate};
use crate::watch::runaway::RunawayConfig;
use core::f64::consts::TAU;

impl MotorPlate {
    #[allow(clippy::cast_possible_truncation)]
    pub(super) const fn runaway(&self, drive: &DrivePlate) -> Result<RunawayConfig, Misfit> {
        let limits = &drive.runaway;
        let sense = attempt!(drive.board.current_sense(self.current_gains()));
        let ampere = power_of_two(sense.scale.fraction);
        let current_max = self.current_max();
        let speed_e = self.speed_max() * self.pole_pairs as f64;
        let emf_max = speed_e * self.flux_wb.abs();
        attempt!(within(
            "angle error",
            "degrees",
            limits.angle_deg,
            5.0,
            60.0
        ));
        attempt!(within(
            "over-speed",
            "of the largest speed",
            limits.over_speed,
            1.0,
            4.0
        ));
        let current = limits.current_error * current_max * ampere;
        attempt!(within(
            "current error",
            "2^-n A",
            current,
            1.0,
            1_073_741_824.0
        ));
        let current_sum = limits.current_sum * current_max * ampere;
        attempt!(within(
            "current sum",
            "2^-n A",
            current_sum,
            1.0,
            1_073_741_824.0
        ));
        let step = self.speed_max() * limits.over_speed / TAU * drive.board.sample_time();
        attempt!(within("over-speed", "turns a sample", step, 0.0, 0.25));
        let resistive = limits.resistance_error * self.resistance_ohm * current_max;
        let floor = limits.angle_floor * emf_max + resistive;
        let look = drive.speed_step() * STEPS_PER_LOOK as f64;
        Ok(RunawayConfig {
            theta_step_max: (step * 4_294_967_296.0) as u32,
            following: attempt!(fixed_point(
                "following error",
                "rad/s",
                limits.following * speed_e
            )),
            current: current as u32,
            current_sum: current_sum as u32,
            resistance: attempt!(gain("resistance", self.resistance_ohm, sense.scale)),
            emf_part: (sine(limits.angle_deg * TAU / 360.0) * 4_294_967_296.0) as i32,
            emf_floor: attempt!(quantise("voltage error of the model", "V", floor, 18))
                .unsigned_abs(),
            stall: attempt!(fixed_point("stall", "rad/s", limits.stall * speed_e)),
            pole_pairs: self.pole_pairs.cast_signed(),
            tolerances: [
                tolerance(limits.angle_s, look),
                tolerance(limits.current_error_s, look),
                tolerance(limits.over_speed_s, look),
                tolerance(limits.following_s, look),
                tolerance(limits.stall_s, look),
            ],
        })
    }
}

/// Up in a look that shows it, down in one that does not.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
const fn tolerance(seconds: f64, look: f64) -> Tolerance {
    let events = (seconds / look / 2.0 + 0.5) as u32;
    Tolerance {
        weight: 2,
        events: if events > 1 { events } else { 1 },
    }
}

/// Sine of a small angle, rad, by its series to the seventh power: to 1e-6 below one.
const fn sine(x: f64) -> f64 {
    let square = x * x;
    x * (1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0)))
}
