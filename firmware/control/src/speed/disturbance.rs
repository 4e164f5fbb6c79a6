//! Disturbance observer: what a motor's current does not explain of its acceleration is a torque that nobody knows, and is added to
//! the current (Ohnishi, Shibata and Murakami, "Motion control for advanced mechatronics", IEEE/ASME Trans. Mechatronics 1(1),
//! 1996).
//!
//! With the inertia `J` as a current per acceleration and a filter `Q = g / (s + g)` the disturbance is
//! `Q (i - J s w) = Q (i + g J w) - g J w`: no derivative is taken. What the drive feeds forward by itself, against ripple and
//! friction, is not in `i`: those are known, and not found a second time.

use crate::base::format::{Current, CurrentState, Speed, SpeedGain, narrow};

/// Configuration of an observer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DisturbanceConfig {
    /// There is one.
    pub active: bool,
    /// Part of the way that the filter goes in a step, 2^-20.
    pub part: Current,
    /// `g J`: A per electrical rad/s.
    pub inertia: SpeedGain,
}

/// State of an observer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Disturbance {
    /// Filtered `i + g J w`; `None` before the first step.
    filtered: Option<CurrentState>,
}

impl Disturbance {
    /// One that has seen nothing.
    #[must_use]
    pub const fn new() -> Self {
        Self { filtered: None }
    }

    /// A step: the current that was asked in the last one, less what was fed forward, and the speed -> the current that the
    /// disturbance takes.
    #[inline(always)]
    pub fn step(&mut self, config: &DisturbanceConfig, asked: Current, omega_e: Speed) -> Current {
        let moving: Current = narrow(config.inertia.wide_mul(omega_e));
        let seen = asked.saturating_add(moving);
        // A shaft that turns already is not disturbed by that.
        let before = self.filtered.unwrap_or(CurrentState::from(moving));
        let held: Current = narrow(before);
        // The part is below 2^20: the product is within 2^51, as the state between two currents is.
        #[allow(clippy::arithmetic_side_effects)]
        let filtered = before + config.part.wide_mul(seen.saturating_sub(held));
        self.filtered = Some(filtered);
        let now: Current = narrow(filtered);
        now.saturating_sub(moving)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plate::{RejectionPlate, test_plate};
    use proptest::prelude::*;

    const G: f64 = 100.0;

    fn config() -> (DisturbanceConfig, f64, f64) {
        let mut plate = test_plate();
        plate.rejection = RejectionPlate {
            disturbance_rad_s: G,
            ..RejectionPlate::NONE
        };
        let motor = &plate.motors[0];
        let inertia = motor.inertia_kg_m2 / (25.0 * motor.flux_wb);
        let config = plate.config().unwrap().disturbance[0];
        (config, inertia, plate.speed_step())
    }

    /// A load step on an inertia that nothing else moves: `d (1 - e^-gt)` is found.
    #[test]
    fn a_step_of_load_is_found_with_the_filters_time_constant() {
        let (config, inertia, step) = config();
        let (mut disturbance, mut omega) = (Disturbance::new(), 50.0);
        let load = 0.8;
        for k in 0..200 {
            let found = disturbance.step(&config, Current::ZERO, Speed::from_num(omega));
            let exact = load * (1.0 - (-G * f64::from(k) * step).exp());
            // The speed is sampled: half a step of the filter.
            let off = (found.to_num::<f64>() - exact).abs();
            assert!(
                off < 1.1 * load * G * step,
                "step {k}: found {found} A, expected {exact} A within {} A",
                1.1 * load * G * step
            );
            omega -= load / inertia * step;
        }
    }

    proptest! {
        /// What moves by its current alone is not disturbed, from whatever speed it starts.
        #[test]
        fn what_the_current_explains_is_no_disturbance(omega in -1500.0..1500.0f64, amps in -2.0..2.0f64) {
            let (config, inertia, step) = config();
            let (mut disturbance, mut speed) = (Disturbance::new(), omega);
            for _ in 0..100 {
                let found = disturbance.step(&config, Current::from_num(amps), Speed::from_num(speed));
                // A current is seen a step before what it does; speeds are in 2^-16 rad/s, times g J.
                let most = 1.1 * G * step * amps.abs() + 1e-4;
                prop_assert!(found.to_num::<f64>().abs() < most, "{found} A, expected within {most} A");
                speed += amps / inertia * step;
            }
        }

        #[test]
        fn no_input_overflows(inputs in prop::collection::vec((any::<i32>(), any::<i32>()), 1..100)) {
            let (config, ..) = config();
            let mut disturbance = Disturbance::new();
            for (asked, omega) in inputs {
                disturbance.step(&config, Current::from_bits(asked), Speed::from_bits(omega));
            }
        }
    }
}
