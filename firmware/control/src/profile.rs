//! A reference that moves to its target within an acceleration and a jerk, without overshoot.
//!
//! In units of one step, with `a` the change of the reference a step and `J` the largest change of `a` a step: from
//! acceleration `n*J` the steps `n, n-1, ..., 1` times `J` bring the reference `J*n(n+1)/2` further and end with
//! `a = 0`. Solved for `a`: the largest acceleration that can still stop in the distance `x` is
//! `sqrt(2*J*x + J^2/4) - J/2`. The profile takes the least of that, the limit, and what the jerk allows.

use crate::format::{ProfileState, square_root};
use fixed::FixedI32;
use fixed::types::I2F30;
use fixed::types::extra::U20;

/// Limits of a profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProfileConfig {
    /// Largest acceleration, rad/s a step, in 2^-20.
    pub acceleration: i32,
    /// Largest jerk, rad/s a step squared, in 2^-30.
    pub jerk: i32,
}

/// A reference on its way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Profile {
    /// The reference, mechanical rad/s.
    pub value: ProfileState,
    /// Its change in the last step, rad/s.
    pub change: ProfileState,
}

impl Profile {
    /// One step towards `target`.
    pub fn step(&mut self, config: &ProfileConfig, target: ProfileState) {
        let jerk = ProfileState::from(I2F30::from_bits(config.jerk));
        let limit = ProfileState::from(FixedI32::<U20>::from_bits(config.acceleration));
        let distance = target.saturating_sub(self.value);
        let wanted = stopping_change(distance, jerk).clamp(limit.saturating_neg(), limit);
        self.approach(wanted, jerk);
    }

    /// One step towards standing where it is, as fast as the jerk allows: what is asked while a motor cannot follow.
    pub fn ease(&mut self, config: &ProfileConfig) {
        self.approach(
            ProfileState::ZERO,
            ProfileState::from(I2F30::from_bits(config.jerk)),
        );
    }

    fn approach(&mut self, wanted: ProfileState, jerk: ProfileState) {
        let step = wanted
            .saturating_sub(self.change)
            .clamp(jerk.saturating_neg(), jerk);
        self.change = self.change.saturating_add(step);
        self.value = self.value.saturating_add(self.change);
    }
}

/// The largest change a step that still stops at `distance`, with its sign.
fn stopping_change(distance: ProfileState, jerk: ProfileState) -> ProfileState {
    let magnitude = distance.saturating_abs();
    let change = if magnitude <= jerk {
        // The last step lands on the target.
        magnitude
    } else {
        // 2*J*x in 2^-48: 32 bits of J (below 2 in 2^-32: 33 bits) times 30 bits of x in 2^-16. Distances beyond
        // 16384 rad/s, which no motor has, are cut to that.
        let jerk_bits = jerk.to_bits().unsigned_abs();
        let x_bits = (magnitude.to_bits().unsigned_abs() >> 16).min((1 << 30) - 1);
        let twice = jerk_bits.saturating_mul(x_bits).saturating_mul(2);
        let quarter = jerk_bits.saturating_mul(jerk_bits) >> 18;
        let root = u64::from(square_root(twice.saturating_add(quarter)));
        // The root is in 2^-24; back to 2^-32, below 2^41.
        ProfileState::from_bits((root << 8).cast_signed())
            .saturating_sub(ProfileState::from_bits(jerk.to_bits() >> 1))
            .max(jerk)
    };
    if distance.is_negative() {
        change.saturating_neg()
    } else {
        change
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn config(acceleration: f64, jerk: f64) -> ProfileConfig {
        ProfileConfig {
            acceleration: (acceleration * 2f64.powi(20)) as i32,
            jerk: (jerk * 2f64.powi(30)) as i32,
        }
    }

    proptest! {
        #[test]
        fn reaches_any_target_within_its_limits(
            targets in prop::collection::vec(-600.0..600.0f64, 1..4),
            acceleration in 1e-3..1.0f64,
            part in 1e-3..1.0f64,
        ) {
            let config = config(acceleration, acceleration * part);
            let jerk = f64::from(config.jerk) / 2f64.powi(30);
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
                prop_assert_eq!(profile.change, ProfileState::ZERO);
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
                    prop_assert!(profile.change.abs() <= ProfileState::from_num(0.200_001));
                    prop_assert!((profile.change - before).abs() <= ProfileState::from_num(0.004_000_1));
                }
            }
        }

        #[test]
        fn no_input_overflows(value in any::<i64>(), change in any::<i64>(), target in any::<i64>(), a in 0..i32::MAX, j in 0..i32::MAX) {
            let mut profile = Profile { value: ProfileState::from_bits(value), change: ProfileState::from_bits(change) };
            for _ in 0..10 {
                profile.step(&ProfileConfig { acceleration: a, jerk: j }, ProfileState::from_bits(target));
            }
        }
    }
}
