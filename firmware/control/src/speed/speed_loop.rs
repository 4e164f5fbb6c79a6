//! Speed error -> `i_q` reference: PI with the gains of Eqs 11 and 12, inertia feed-forward, torque limit.

use crate::base::format::{
    Current, CurrentState, ElectricalChange, InertiaGain, Speed, SpeedGain, narrow,
};
use crate::speed::current_limit::CurrentRange;

/// Slacks beyond which the whole motion of a motor at rest is corrected.
const FULL: i32 = 4;

/// Configuration of a speed loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedLoopConfig {
    /// Eq 11, A per electrical rad/s.
    pub k_pw: SpeedGain,
    /// Eq 12 times the step, A per electrical rad/s a step.
    pub k_iw_step: SpeedGain,
    /// `J / (p^2 * flux * step)`: A per electrical rad/s that the reference gains a step.
    pub inertia: InertiaGain,
    /// Torque limit as a current, A.
    pub i_max: Current,
    /// Half of the angle within which a motor at rest is not corrected, 2^-32 mechanical turn, over the samples a step.
    pub slack: i32,
}

/// What a speed loop is asked, electrical.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpeedReference {
    /// Speed, rad/s.
    pub omega_e: Speed,
    /// Its change a step, rad/s, within half of its format.
    pub change: ElectricalChange,
}

impl SpeedReference {
    /// The motor is asked to stand.
    #[must_use]
    #[inline(always)]
    pub const fn is_rest(self) -> bool {
        self.omega_e.to_bits() | self.change.to_bits() == 0
    }
}

/// What a speed loop would ask without a limit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wanted {
    error: Speed,
    current: Current,
}

impl Wanted {
    /// Reference less speed, electrical rad/s.
    #[must_use]
    #[inline(always)]
    pub fn error(self) -> Speed {
        self.error
    }

    /// The current without a limit.
    #[must_use]
    #[inline(always)]
    pub fn current(self) -> Current {
        self.current
    }

    /// The same with another current.
    #[must_use]
    #[inline(always)]
    pub fn asking(self, current: Current) -> Self {
        Self { current, ..self }
    }

    /// The same with a current more.
    #[must_use]
    #[inline(always)]
    pub fn plus(self, current: Current) -> Self {
        Self {
            current: self.current.saturating_add(current),
            ..self
        }
    }
}

/// What a speed loop asks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpeedLoopOutput {
    /// `i_q` reference, within the torque limit.
    pub i_q: Current,
    /// The torque limit cut it.
    pub limited: bool,
}

/// State of a speed loop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpeedLoop {
    integral: CurrentState,
    /// Where a motor at rest is within its slack, and within [`FULL`] of them: 2^-32 mechanical turn, over the samples a step.
    deviations: [i32; 2],
}

impl SpeedLoop {
    /// A loop with an empty integrator.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            integral: CurrentState::ZERO,
            deviations: [0; 2],
        }
    }

    /// A loop that has found that load, A.
    #[must_use]
    pub(crate) fn holding(load: Current, config: &SpeedLoopConfig) -> Self {
        Self {
            integral: hold(load.into(), config.i_max),
            deviations: [0; 2],
        }
    }

    /// What it has found of its motor's load, 2^-8 A: the integral's upper word.
    #[must_use]
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)]
    pub const fn load(&self) -> i32 {
        (self.integral.to_bits() >> 32) as i32
    }

    /// The speed of a motor at rest that its loop corrects, of `theta_step`, both in 2^-32 turn a sample. An encoder on the edge of a count
    /// shows the whole count each time that the edge is passed. The full answer to that pushes the motor back over the edge, so it would
    /// swing. None of what is within the slack is corrected, a quarter within [`FULL`] slacks, and all beyond.
    #[must_use]
    pub fn beyond_slack(&mut self, config: &SpeedLoopConfig, theta_step: i32) -> i32 {
        let [quarter, all] = &mut self.deviations;
        let quarter = beyond(quarter, config.slack, theta_step);
        let all = beyond(all, config.slack.saturating_mul(FULL), theta_step);
        all.saturating_add(quarter.saturating_sub(all) / 4)
    }

    /// One step: both halves.
    #[inline(always)]
    pub fn step(
        &mut self,
        config: &SpeedLoopConfig,
        reference: SpeedReference,
        omega_e: Speed,
        voltage_limited: bool,
    ) -> SpeedLoopOutput {
        let wanted = self.wanted(config, reference, omega_e);
        let range = CurrentRange::both_ways(config.i_max);
        self.limit(config, wanted, voltage_limited, range)
    }

    /// The first half: error, integral and feed-forward -> current. Two loops take it one after the other before either
    /// is limited: across a limit's branches the compiler would keep their gains in 64 bits, and multiply by such a one in
    /// three instructions.
    #[must_use]
    #[inline(always)]
    pub fn wanted(
        &self,
        config: &SpeedLoopConfig,
        reference: SpeedReference,
        omega_e: Speed,
    ) -> Wanted {
        let error = reference.omega_e.saturating_sub(omega_e);
        // All have the integral's fraction bits. The proportional part is within 2^62, the feed-forward of half a word of
        // change within 2^61, the integral within 2^51.
        #[allow(clippy::arithmetic_side_effects)]
        let sum =
            self.integral + config.inertia.wide_mul(reference.change) + config.k_pw.wide_mul(error);
        Wanted {
            error,
            current: narrow(sum),
        }
    }

    /// The second half: the torque limit, which is `range` within the configured one, and the integral. `voltage_limited`: the current loop could not follow the last
    /// reference, so the integrator must not push further that way.
    #[inline(always)]
    pub fn limit(
        &mut self,
        config: &SpeedLoopConfig,
        wanted: Wanted,
        voltage_limited: bool,
        range: CurrentRange,
    ) -> SpeedLoopOutput {
        let Wanted { error, current } = wanted;
        let i_q = range.cut(current);

        // Anti-windup by conditional integration: no error is integrated that pushes further into a limit. What the
        // limit cut is not taken from the integrator: a short peak of the other parts would leave it without the
        // load's torque.
        let limited = i_q != current;
        let pushing = (limited || voltage_limited) && error.is_negative() == current.is_negative();
        if !pushing {
            // The integral is within 2^51 and the product within 2^62.
            #[allow(clippy::arithmetic_side_effects)]
            let integral = self.integral + config.k_iw_step.wide_mul(error);
            self.integral = hold(integral, config.i_max);
        }
        SpeedLoopOutput { i_q, limited }
    }
}

/// By how much an angle that turns by `step` leaves ±`slack`, which follows it.
fn beyond(deviation: &mut i32, slack: i32, step: i32) -> i32 {
    let turned = deviation.saturating_add(step);
    *deviation = turned.min(slack).max(slack.saturating_neg());
    turned.saturating_sub(*deviation)
}

/// Holds an integral to ±`i_max`, to a thousandth of an ampere: only its upper word is compared.
#[inline(always)]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::arithmetic_side_effects
)]
fn hold(integral: CurrentState, i_max: Current) -> CurrentState {
    let bits = integral.to_bits();
    // An upper word is in 2^-8 A.
    let end = i_max.to_bits() >> 12;
    let upper = ((bits >> 32) as i32).min(end).max(-end);
    CurrentState::from_bits(i64::from(upper) << 32 | i64::from(bits as u32))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plate::test_plate;
    use proptest::prelude::*;

    fn config() -> SpeedLoopConfig {
        let plate = test_plate();
        plate.motors[0].speed_loop(&plate).unwrap()
    }

    proptest! {
        #[test]
        fn agrees_with_the_law_in_floats(
            samples in prop::collection::vec((-1600.0..1600.0f64, -1600.0..1600.0f64, -0.5..0.5f64), 1..80),
        ) {
            let config = config();
            let mut speed_loop = SpeedLoop::default();
            let mut integral = 0.0;
            let [kp, ki] = [config.k_pw, config.k_iw_step].map(|k| k.to_num::<f64>());
            let kj = config.inertia.to_num::<f64>();
            let i_max = config.i_max.to_num::<f64>();
            for (reference, omega, change) in samples {
                let asked = SpeedReference { omega_e: Speed::from_num(reference), change: ElectricalChange::from_num(change) };
                let out = speed_loop.step(&config, asked, Speed::from_num(omega), false);
                let wanted = kp * (reference - omega) + integral + kj * change;
                // Exactly at the limit a rounding decides whether the integral goes on.
                prop_assume!((wanted.abs() - i_max).abs() > 1e-4);
                let exact = wanted.clamp(-i_max, i_max);
                if exact == wanted || (reference < omega) != (wanted < 0.0) {
                    integral = (integral + ki * (reference - omega)).clamp(-i_max, i_max);
                }
                let off = (out.i_q.to_num::<f64>() - exact).abs();
                prop_assert!(off < 1e-3, "measured {} A, expected {exact} A within 1e-3", out.i_q);
            }
        }

        #[test]
        fn extremes_stay_within_the_torque_limit(
            samples in prop::collection::vec((any::<i32>(), any::<i32>(), any::<i32>(), any::<bool>()), 1..100),
        ) {
            let config = config();
            let mut speed_loop = SpeedLoop::default();
            for (reference, omega, change, limited) in samples {
                let asked = SpeedReference { omega_e: Speed::from_bits(reference), change: ElectricalChange::from_bits(change >> 1) };
                let out = speed_loop.step(&config, asked, Speed::from_bits(omega), limited);
                prop_assert!(out.i_q.abs() <= config.i_max);
            }
        }

        /// A count there and back asks for nothing once it was seen; of a longer way all but the slack is corrected.
        #[test]
        fn a_motor_at_rest_has_slack(slack in 1..1i32 << 20, passed in 4..64i32, away in -100..100i32) {
            let config = SpeedLoopConfig { slack, ..config() };
            let mut speed_loop = SpeedLoop::new();
            let count = slack + slack / 2;
            let _ = speed_loop.beyond_slack(&config, count);
            for _ in 0..passed {
                prop_assert_eq!(speed_loop.beyond_slack(&config, -count), 0);
                prop_assert_eq!(speed_loop.beyond_slack(&config, count), 0);
            }
            let mut speed_loop = SpeedLoop::new();
            let steps = (0..passed).map(|_| i64::from(speed_loop.beyond_slack(&config, away * slack / passed)));
            let corrected: i64 = steps.sum();
            let turned = i64::from(away * slack / passed) * i64::from(passed);
            let [quarter, all] = [1, FULL].map(|slacks| {
                let slack = i64::from(slack * slacks);
                turned - turned.clamp(-slack, slack)
            });
            let expected = all + (quarter - all) / 4;
            prop_assert!((corrected - expected).abs() <= i64::from(passed), "{corrected} of {turned}, expected {expected}");
        }

        #[test]
        fn does_not_wind_up(error in 50.0..1500.0f64) {
            let config = config();
            let mut speed_loop = SpeedLoop::default();
            let at = |omega_e: f64| SpeedReference { omega_e: Speed::from_num(omega_e), change: ElectricalChange::ZERO };
            for _ in 0..5000 {
                speed_loop.step(&config, at(error), Speed::ZERO, false);
            }
            // The integrator stood still at the limit, so an error that asks for braking brakes at once.
            let out = speed_loop.step(&config, at(-60.0), Speed::ZERO, false);
            prop_assert!(out.i_q < config.i_max - Current::ONE, "{}", out.i_q);
        }

        #[test]
        fn a_limited_voltage_stops_the_integrator_only_where_it_pushes(error in 0.5..10.0f64) {
            let config = config();
            let mut speed_loop = SpeedLoop::default();
            let asked = SpeedReference { omega_e: Speed::from_num(error), change: ElectricalChange::ZERO };
            speed_loop.step(&config, asked, Speed::ZERO, true);
            prop_assert_eq!(speed_loop.integral, CurrentState::ZERO);
            speed_loop.step(&config, asked, Speed::ZERO, false);
            prop_assert!(speed_loop.integral > 0);
        }
    }
}
