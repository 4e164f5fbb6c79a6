//! A motor follows a torque set-point, within a speed; the other is held by its speed loop.
//!
//! The motor's speed loop is asked for the speed limit in the direction of the torque, and its current is cut to the set-point:
//! the smaller of both acts. The loop's integral stands while it is cut, so it does not wind up. Against its torque the motor is
//! braked beyond the speed limit by the loop's proportional part alone.
//!
//! Nothing compensates ripple or friction below the speed limit: the current is the set-point.

use crate::base::format::{Current, MechanicalSpeed, Speed, TableVelocity, narrow};
use crate::speed::coordinator::{CommandError, CoordinatorConfig, electrical};
use crate::speed::current_limit::CurrentRange;
use crate::speed::speed_loop::{SpeedLoopConfig, SpeedReference};

/// A table that moves at this or more, screw against nut, mechanical rad/s, is on its way there whatever torque is asked.
const MOVES: Speed = Speed::ONE;

/// What a motor is asked in place of a speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TorqueCommand {
    /// 0 is the screw, 1 the nut.
    pub motor: usize,
    /// Torque as a current along q, A.
    pub i_q: Current,
    /// Fastest that the motor turns by it, mechanical rad/s, above 0.
    pub speed_max: MechanicalSpeed,
}

impl TorqueCommand {
    /// Whether motors and feed allow it beside a base speed of the other motor, which is looked at by itself.
    ///
    /// # Errors
    /// [`CommandError`].
    pub fn allowed(
        self,
        coordinator: &CoordinatorConfig,
        loops: &[SpeedLoopConfig; 2],
        base: MechanicalSpeed,
    ) -> Result<(), CommandError> {
        let motor = self.motor;
        let most = loops
            .get(motor)
            .map_or(Current::ZERO, |config| config.i_max);
        if self.i_q.saturating_abs() > most {
            return Err(CommandError::Current {
                motor,
                asked: self.i_q,
                allowed: most,
            });
        }
        let allowed = coordinator
            .speed_max
            .get(motor)
            .copied()
            .unwrap_or_default();
        if self.speed_max <= MechanicalSpeed::ZERO || self.speed_max > allowed {
            return Err(CommandError::Speed {
                motor,
                asked: self.speed_max,
                allowed,
            });
        }
        let asked = self.speed_max.saturating_add(base.saturating_abs());
        let allowed = coordinator.relative_max();
        if asked > allowed {
            return Err(CommandError::Relative { asked, allowed });
        }
        Ok(())
    }

    /// Which way the table goes by it: the sign alone counts. `relative` is what the screw turns against the nut, mechanical rad/s.
    #[must_use]
    pub fn heading(self, relative: Speed) -> TableVelocity {
        let way = if relative.saturating_abs() >= MOVES {
            relative.to_bits()
        } else if self.motor == 0 {
            self.i_q.to_bits()
        } else {
            self.i_q.to_bits().saturating_neg()
        };
        TableVelocity::from_bits(way.signum())
    }

    /// What its motor's speed loop is asked, for so many electrical turns a mechanical turn.
    #[must_use]
    pub(crate) fn reference(self, pole_pairs: i32) -> SpeedReference {
        let limit = electrical(self.speed_max.into(), pole_pairs);
        SpeedReference {
            omega_e: if self.backwards() {
                limit.saturating_neg()
            } else {
                limit
            },
            ..SpeedReference::default()
        }
    }

    /// What of `range` it leaves its motor, which turns at `omega_e` and is asked for `reference`.
    #[must_use]
    pub(crate) fn range(
        self,
        config: &SpeedLoopConfig,
        range: CurrentRange,
        reference: Speed,
        omega_e: Speed,
    ) -> CurrentRange {
        // Beyond the speed limit against the torque.
        let error = reference.saturating_neg().saturating_sub(omega_e);
        let brakes: Current = narrow(config.k_pw.wide_mul(error));
        let CurrentRange { least, most } = range;
        if self.backwards() {
            let least = self.i_q.min(brakes).max(least).min(most);
            CurrentRange { least, most }
        } else {
            let most = self.i_q.max(brakes).min(most).max(least);
            CurrentRange { least, most }
        }
    }

    /// The limit of the speed is below zero.
    pub(crate) fn backwards(self) -> bool {
        self.i_q < Current::ZERO
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plate::test_plate;
    use crate::speed::speed_loop::SpeedLoop;
    use proptest::prelude::*;

    fn asked(motor: usize, amps: f64, rad_s: f64) -> TorqueCommand {
        TorqueCommand {
            motor,
            i_q: Current::from_num(amps),
            speed_max: MechanicalSpeed::from_num(rad_s),
        }
    }

    proptest! {
        /// Within the speed limit the current is the set-point; a motor that is faster is braked, either way.
        #[test]
        fn the_current_is_the_set_point_within_the_speed(amps in -4.0..4.0f64, turns in -3.0..3.0f64) {
            let plate = test_plate();
            let config = plate.motors[0].speed_loop(&plate).unwrap();
            let command = asked(0, amps, 50.0);
            let reference = command.reference(5);
            let omega_e = Speed::from_num(turns * 250.0);
            let range = command.range(&config, CurrentRange::both_ways(config.i_max), reference.omega_e, omega_e);
            let mut state = SpeedLoop::new();
            let wanted = state.wanted(&config, reference, omega_e);
            let i_q = state.limit(&config, wanted, false, range).i_q;
            let [k, i] = [config.k_pw, config.k_iw_step].map(|gain| gain.to_num::<f64>());
            prop_assert!(i_q.abs() <= config.i_max);
            let (room, omega) = (command.i_q.to_num::<f64>().abs() / k, omega_e.to_num::<f64>());
            if omega.abs() < 250.0 - room - 1.0 {
                prop_assert_eq!(i_q, command.i_q);
            } else if omega.abs() > 250.0 + 1.0 + room {
                prop_assert!((i_q < 0) == (omega > 0.0) && i_q != 0, "{} A at {} rad/s, {} a step", i_q, omega, i);
            }
        }

        /// The speed loop does not wind up while its current is cut: it takes over where its proportional part says.
        #[test]
        fn it_takes_over_without_windup(amps in 0.1..4.0f64) {
            let plate = test_plate();
            let config = plate.motors[0].speed_loop(&plate).unwrap();
            let command = asked(0, amps, 50.0);
            let reference = command.reference(5);
            let mut state = SpeedLoop::new();
            let mut at = |omega: f64| {
                let omega_e = Speed::from_num(omega);
                let range = command.range(&config, CurrentRange::both_ways(config.i_max), reference.omega_e, omega_e);
                let wanted = state.wanted(&config, reference, omega_e);
                state.limit(&config, wanted, false, range).i_q
            };
            for _ in 0..20_000 {
                prop_assert_eq!(at(0.0), command.i_q);
            }
            prop_assert!(at(250.0).abs() < Current::from_num(0.01));
            prop_assert!(at(260.0) < Current::ZERO);
        }

        #[test]
        fn extremes_stay_within_the_range(i_q: i32, speed: i32, omega: i32, least in i32::MIN / 2..=0, most in 0..i32::MAX / 2, motor in 0usize..3) {
            let plate = test_plate();
            let config = plate.motors[0].speed_loop(&plate).unwrap();
            let command = TorqueCommand { motor, i_q: Current::from_bits(i_q), speed_max: MechanicalSpeed::from_bits(speed) };
            let coordinator = plate.config().unwrap().coordinator;
            let _ = command.allowed(&coordinator, &[config; 2], MechanicalSpeed::from_bits(omega));
            let range = CurrentRange { least: Current::from_bits(least), most: Current::from_bits(most) };
            let left = command.range(&config, range, command.reference(5).omega_e, Speed::from_bits(omega));
            prop_assert!(range.least <= left.least && left.least <= left.most && left.most <= range.most, "{:?} of {:?}", left, range);
        }
    }

    #[test]
    fn the_table_goes_by_the_torque_or_where_it_is_pushed() {
        for (motor, amps, relative, way) in [
            (0, 1.0, 0.0, 1),
            (0, -1.0, 0.5, -1),
            (1, 1.0, 0.0, -1),
            (1, -1.0, -0.5, 1),
            (0, 1.0, -2.0, -1),
            (1, 1.0, 2.0, 1),
            (0, 0.0, 0.0, 0),
        ] {
            let heading = asked(motor, amps, 1.0).heading(Speed::from_num(relative));
            assert_eq!(heading.to_bits(), way, "{motor} {amps} {relative}");
        }
    }

    #[test]
    fn what_motor_or_feed_cannot_do_is_refused() {
        let plate = test_plate();
        let config = plate.config().unwrap();
        let most = config.speed_loops[0].i_max.to_num::<f64>();
        // 100 mm/s on a lead of 5 mm.
        let fastest = plate.feed.velocity_max / plate.feed.lead_m * core::f64::consts::TAU;
        for (command, base, allowed) in [
            (asked(0, 0.99 * most, 0.99 * fastest), 0.0, true),
            (asked(1, -0.99 * most, 0.5 * fastest), 0.4 * fastest, true),
            (asked(1, 1.01 * most, 1.0), 0.0, false),
            (asked(0, 1.0, 0.0), 0.0, false),
            (asked(0, 1.0, -1.0), 0.0, false),
            (asked(0, 1.0, 1.02 * fastest), 0.0, false),
            (asked(0, 1.0, 0.6 * fastest), -0.5 * fastest, false),
            (asked(2, 0.0, 1.0), 0.0, false),
        ] {
            let base = MechanicalSpeed::from_num(base);
            let said = command.allowed(&config.coordinator, &config.speed_loops, base);
            assert_eq!(said.is_ok(), allowed, "{command:?}: {said:?}");
        }
    }
}
