//! What a motor's torque current may be: less as winding and bridge warm up, and less for braking as the bus fills.
//!
//! A braking motor puts its energy back on the bus, which a rectifier does not take: the voltage climbs until the guard
//! opens the bridges and the motors coast. So braking fades out between two voltages of the plate; the stop then takes as
//! long as friction, copper, and a chopper if there is one, take to use the energy up.
//!
//! Below a speed all torque stays, either way: a motor that stands has no motion to brake, and while it turns at `omega` a torque
//! current `i` gives the bus `k omega i - R i^2`, at most `(k omega)^2 / 4 R`. Below the stall's speed that is less than half a
//! watt on both boards. With a sign of the motion alone, a motor at rest could not start one way while the bus is full, and the stall's
//! watch would name it.

use crate::base::format::{Current, narrow_bits};

/// Where braking fades out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RegenerationConfig {
    /// Bus at which nothing may be put back, ADC counts.
    pub full: u16,
    /// Counts below it at which the fading begins, at least 1.
    pub fades: u16,
    /// Braking current for a count below `full`, 2^-8 of a [`Current`]'s steps.
    pub per_count: i32,
    /// Turn of the shaft in a sample up to which braking is not limited, 2^-32 turn.
    pub slow: u32,
}

impl RegenerationConfig {
    /// What may be asked at `bus` counts of a shaft that turns by `theta_step` a sample, if `i_max` is allowed otherwise. Mostly the
    /// bus is far from full, and nothing else is computed.
    #[must_use]
    #[inline(always)]
    pub fn range(&self, i_max: Current, bus: u16, theta_step: i32) -> CurrentRange {
        if self.full.saturating_sub(bus) >= self.fades {
            return CurrentRange::both_ways(i_max);
        }
        self.fading_range(i_max, bus, theta_step)
    }

    #[cold]
    #[inline(never)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    fn fading_range(&self, i_max: Current, bus: u16, theta_step: i32) -> CurrentRange {
        CurrentRange::new(i_max, self.braking_max(i_max, bus, theta_step), theta_step)
    }

    /// The largest braking current at `bus` counts of a shaft that turns by `theta_step` a sample, if `i_max` is allowed otherwise.
    #[must_use]
    pub fn braking_max(&self, i_max: Current, bus: u16, theta_step: i32) -> Current {
        let left = self.full.saturating_sub(bus);
        if left >= self.fades || theta_step.unsigned_abs() <= self.slow {
            return i_max;
        }
        // 16 bits times 31.
        let product = i64::from(left).wrapping_mul(i64::from(self.per_count));
        i_max.min(narrow_bits(product, 8))
    }
}

/// The torque current that may be asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CurrentRange {
    /// Least, A.
    pub least: Current,
    /// Most, A.
    pub most: Current,
}

impl CurrentRange {
    /// The same both ways.
    #[must_use]
    #[inline(always)]
    pub fn both_ways(i_max: Current) -> Self {
        Self {
            // It is not below 0.
            least: i_max.wrapping_neg(),
            most: i_max,
        }
    }

    /// So much that speeds the shaft up, so much that brakes it, while it turns by `theta_step` a sample.
    #[must_use]
    #[inline(always)]
    pub fn new(driving: Current, braking: Current, theta_step: i32) -> Self {
        let [least, most] = if theta_step < 0 {
            [driving, braking]
        } else {
            [braking, driving]
        };
        Self {
            // Neither is below 0.
            least: least.wrapping_neg(),
            most,
        }
    }

    /// What of `current` may be asked.
    #[must_use]
    #[inline(always)]
    pub fn cut(self, current: Current) -> Current {
        current.min(self.most).max(self.least)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plate::test_plate;
    use proptest::prelude::*;

    proptest! {
        /// Against the same in floats: all below the lower voltage, nothing from the upper one on, a line between.
        #[test]
        fn braking_fades_along_a_line(counts in 0u16..4096, part in 0.1..1.0f64) {
            let plate = test_plate();
            let config = plate.config().unwrap();
            let i_max = Current::from_num(config.speed_loops[0].i_max.to_num::<f64>() * part);
            let got = config.regeneration[0].braking_max(i_max, counts, i32::MAX).to_num::<f64>();
            let (from, full) = (plate.bridge.brake_fade_from_v, plate.bridge.brake_fade_to_v);
            let volts = f64::from(counts) * plate.board.bus_volts_per_count;
            let whole = plate.motors[0].torque_max_nm / (5.0 * 0.11);
            let line = whole * ((full - volts) / (full - from)).clamp(0.0, 1.0);
            let expected = line.min(i_max.to_num());
            // Both voltages are rounded to counts: two of them, of 24 V / 0.11.
            let allowed = whole * 2.0 * plate.board.bus_volts_per_count / (full - from) + 1e-4;
            prop_assert!((got - expected).abs() <= allowed, "{got} A at {volts} V, expected {expected} A within {allowed}");
            if volts > full {
                prop_assert_eq!(got, 0.0);
            }
        }

        /// A motor at rest has nothing to brake: it starts either way on a bus that takes nothing.
        #[test]
        fn a_full_bus_leaves_a_motor_that_stands_its_torque(rpm in -200.0..200.0f64, asked in -4.0..4.0f64) {
            let plate = test_plate();
            let config = plate.config().unwrap();
            let regeneration = config.regeneration[0];
            let stall_rpm = plate.runaway.stall * plate.motors[0].speed_max_rpm;
            let step = (rpm / 60.0 * plate.board.sample_time() * 2f64.powi(32)) as i32;
            let (i_max, asked) = (config.speed_loops[0].i_max, Current::from_num(asked));
            let range = |bus| regeneration.range(i_max, bus, step);
            let got = range(u16::MAX).cut(asked);
            let brakes = rpm.abs() > stall_rpm && (asked < 0) != (rpm < 0.0);
            let expected = if brakes { Current::ZERO } else { asked.min(i_max).max(-i_max) };
            prop_assert!(
                (rpm.abs() - stall_rpm).abs() < 0.1 || got == expected,
                "{got} A of {asked} A at {rpm} rpm, expected {expected} A: the stall is at {stall_rpm} rpm"
            );
            prop_assert_eq!(range(0), CurrentRange::both_ways(i_max));
        }

        #[test]
        fn braking_is_against_the_motion(driving in 0.0..4.0f64, braking in 0.0..4.0f64, step in -1000i32..1000, asked in -6.0..6.0f64) {
            let [driving, braking, asked] = [driving, braking, asked].map(Current::from_num);
            let got = CurrentRange::new(driving, braking, step).cut(asked);
            let brakes = (asked < 0) != (step < 0);
            let limit = if brakes { braking } else { driving };
            prop_assert_eq!(got.abs(), asked.abs().min(limit));
            prop_assert!(got == 0 || (got < 0) == (asked < 0));
        }
    }
}
