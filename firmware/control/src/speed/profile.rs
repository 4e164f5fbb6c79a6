//! A reference that moves to its target within an acceleration and a jerk, without overshoot.
//!
//! In units of one step, with `a` the change of the reference a step and `J` the largest change of `a` a step: from
//! acceleration `n*J` the steps `n, n-1, ..., 1` times `J` bring the reference `J*n(n+1)/2` further and end with
//! `a = 0`. Solved for `a`: the largest acceleration that can still stop in the distance `x` is
//! `sqrt(2*J*x + J^2/4) - J/2`. The profile takes the smallest of that, the limit, and what the jerk allows.
//! Further away than the limit needs to stop, no root is taken.

use crate::base::format::{ProfileState, SpeedChange, square_root};

/// Limits of a profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProfileConfig {
    /// Largest acceleration, rad/s a step.
    acceleration: SpeedChange,
    /// Largest jerk, rad/s a step squared.
    jerk: SpeedChange,
    /// From here on the largest acceleration can still stop, rad/s. It is not below 0.
    braking: ProfileState,
}

impl ProfileConfig {
    /// The limits, not negative: the largest acceleration, rad/s a step, and jerk, rad/s a step squared.
    #[must_use]
    pub const fn new(acceleration: SpeedChange, jerk: SpeedChange) -> Self {
        // sqrt(2*J*x + J^2/4) - J/2 = a, solved for x and rounded up.
        let (a, j) = (
            acceleration.to_bits().unsigned_abs() as u64,
            jerk.to_bits().unsigned_abs() as u64,
        );
        let braking = match a
            .wrapping_mul(a.wrapping_add(j))
            .checked_div(j.wrapping_mul(2))
        {
            Some(x) => ProfileState::from_bits(x.saturating_add(1).cast_signed()),
            None => ProfileState::MAX,
        };
        Self {
            acceleration,
            jerk,
            braking,
        }
    }

    /// Largest acceleration, rad/s a step.
    #[must_use]
    #[inline(always)]
    pub const fn acceleration(&self) -> SpeedChange {
        self.acceleration
    }
}

/// A reference on its way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Profile {
    /// The reference, mechanical rad/s: beyond any motor's, but within ±2^33.
    pub value: ProfileState,
    /// Its change in the last step, rad/s.
    pub change: SpeedChange,
}

impl Profile {
    /// One step towards `target`, which is within the same range.
    #[inline(always)]
    pub fn step(&mut self, config: &ProfileConfig, target: ProfileState) {
        // Both are within a quarter of the word.
        #[allow(clippy::arithmetic_side_effects)]
        let distance = target - self.value;
        if distance == ProfileState::ZERO && self.change == SpeedChange::ZERO {
            return;
        }
        let magnitude = distance.to_bits().unsigned_abs();
        let wanted = if magnitude >= config.braking.to_bits().cast_unsigned() {
            config.acceleration
        } else {
            stopping_change(magnitude, config)
        };
        let wanted = if distance.is_negative() {
            // It is not below 0.
            wanted.wrapping_neg()
        } else {
            wanted
        };
        self.approach(wanted, config.jerk);
    }

    /// One step towards standing where it is, as fast as the jerk allows: what is asked while a motor cannot follow.
    #[inline(always)]
    pub fn ease(&mut self, config: &ProfileConfig) {
        self.approach(SpeedChange::ZERO, config.jerk);
    }

    #[inline(always)]
    fn approach(&mut self, wanted: SpeedChange, jerk: SpeedChange) {
        // A jerk is not below 0 either.
        let step = wanted
            .saturating_sub(self.change)
            .min(jerk)
            .max(jerk.wrapping_neg());
        self.change = self.change.saturating_add(step);
        // It takes 2^30 steps of the largest change, two days, to leave the range from within a motor's speeds.
        #[allow(clippy::arithmetic_side_effects)]
        let value = self.value + ProfileState::from(self.change);
        self.value = value;
    }
}

/// The largest change a step that still stops in `distance`, 2^-28 rad/s, which is below the distance that the limit needs.
#[cold]
#[inline(never)]
#[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
fn stopping_change(distance: u64, config: &ProfileConfig) -> SpeedChange {
    let jerk = config.jerk.to_bits().unsigned_abs();
    if distance <= u64::from(jerk) {
        // The last step lands on the target. Below 2^31, as the jerk is.
        #[allow(clippy::cast_possible_truncation)]
        return SpeedChange::from_bits((distance as u32).cast_signed());
    }
    // 2*J*x + J^2/4 in 2^-44: J below 8 in 2^-28 (31 bits) times x in 2^-16. Distances beyond 16384 rad/s, which no motor
    // has, are cut to that.
    let x = (distance >> 12).min((1 << 30) - 1);
    let wide = u64::from(jerk);
    let square = (wide.wrapping_mul(x) << 1).wrapping_add(wide.wrapping_mul(wide) >> 14);
    // The root is in 2^-22: below 8192 of 16 significant bits, and cut to the limit.
    let root = u64::from(square_root(square)) << 6;
    let change = root.saturating_sub(wide >> 1).max(wide);
    let limit = config.acceleration.to_bits();
    SpeedChange::from_bits(i32::try_from(change).unwrap_or(limit).min(limit))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn config(acceleration: f64, jerk: f64) -> ProfileConfig {
        ProfileConfig::new(
            SpeedChange::from_num(acceleration),
            SpeedChange::from_num(jerk),
        )
    }

    proptest! {
        #[test]
        fn reaches_any_target_within_its_limits(
            targets in prop::collection::vec(-600.0..600.0f64, 1..4),
            acceleration in 1e-3..1.0f64,
            part in 1e-3..1.0f64,
        ) {
            let config = config(acceleration, acceleration * part);
            let jerk = config.jerk.to_num::<f64>();
            let mut profile = Profile::default();
            for target in targets {
                let goal = ProfileState::from_num(target);
                let start = profile.value.to_num::<f64>();
                let steps = ((target - start).abs() / acceleration + 4.0 * acceleration / jerk) * 1.5 + 50.0;
                let mut before = profile;
                let mut furthest = 0.0f64;
                for _ in 0..steps as usize {
                    profile.step(&config, goal);
                    let (a, b) = (profile.change.to_num::<f64>(), before.change.to_num::<f64>());
                    prop_assert!(a.abs() <= acceleration + 1e-6, "acceleration {a}");
                    prop_assert!((a - b).abs() <= jerk + 1e-8, "jerk {}", a - b);
                    furthest = furthest.max((profile.value.to_num::<f64>() - target) * (target - start).signum());
                    before = profile;
                }
                prop_assert_eq!(profile.value, goal, "change {}", profile.change);
                prop_assert_eq!(profile.change, SpeedChange::ZERO);
                prop_assert!(furthest <= jerk + 1e-3, "overshoot {furthest}, jerk {jerk}");
            }
        }

        #[test]
        fn a_new_target_on_the_way_keeps_the_jerk(
            targets in prop::collection::vec((-600.0..600.0f64, 1usize..2000), 1..20),
        ) {
            let config = config(0.2, 0.004);
            let mut profile = Profile::default();
            for (target, steps) in targets {
                for _ in 0..steps {
                    let before = profile.change;
                    profile.step(&config, ProfileState::from_num(target));
                    prop_assert!(profile.change.abs() <= SpeedChange::from_num(0.200_001));
                    prop_assert!((profile.change - before).abs() <= SpeedChange::from_num(0.004_000_1));
                }
            }
        }

        /// A reference that a motor cannot follow stands still within the jerk limit too, and soon.
        #[test]
        fn easing_keeps_the_jerk(target in 100.0..600.0f64, steps in 100usize..1000, back in any::<bool>()) {
            let config = config(0.2, 0.004);
            let mut profile = Profile::default();
            let goal = ProfileState::from_num(if back { -target } else { target });
            for _ in 0..steps {
                profile.step(&config, goal);
            }
            let needed = profile.change.abs().to_num::<f64>() / 0.004;
            for _ in 0..needed.ceil() as usize {
                let before = profile.change;
                profile.ease(&config);
                let by = (profile.change - before).abs().to_num::<f64>();
                prop_assert!(by <= 0.004_000_1, "eased by {by} rad/s a step in one step: the jerk is 0.004");
            }
            prop_assert_eq!(profile.change, SpeedChange::ZERO);
        }

        /// Debug builds panic where a sum would leave its format.
        #[test]
        fn no_input_overflows(
            value in -(1i64 << 61)..1 << 61, change in any::<i32>(), target in -(1i64 << 61)..1 << 61, a in 0..i32::MAX, j in 0..i32::MAX,
        ) {
            let [acceleration, jerk] = [a, j].map(SpeedChange::from_bits);
            let mut profile = Profile { value: ProfileState::from_bits(value), change: SpeedChange::from_bits(change) };
            for _ in 0..10 {
                profile.step(&ProfileConfig::new(acceleration, jerk), ProfileState::from_bits(target));
            }
        }

        /// Where the root is no longer taken, it would give the limit.
        #[test]
        fn the_limit_begins_where_the_root_reaches_it(a in 1_000_000..i32::MAX / 64, part in 0.001..1.0f64) {
            let acceleration = SpeedChange::from_bits(a);
            let config = ProfileConfig::new(acceleration, SpeedChange::from_num(acceleration.to_num::<f64>() * part));
            prop_assume!(config.jerk > 0 && config.braking < 16_384);
            let below = stopping_change(config.braking.to_bits().unsigned_abs() - 1, &config);
            prop_assert!((below.to_num::<f64>() / acceleration.to_num::<f64>() - 1.0).abs() < 2e-2 + 4e-7 / acceleration.to_num::<f64>());
        }
    }
}
