//! Friction that is known is fed forward: where a speed reference reverses, the speed loop need not wait for the error.
//!
//! Friction of each motor's bearings acts on its own speed, that of the ball pair and the guideway on the relative speed, with
//! opposite signs on screw and nut. After a reversal it does not turn at once but with the way (Dahl, "A solid friction model",
//! 1968; LuGre's `z` at low speed), to a level that is higher while the motion is slow (Stribeck). LuGre's `e^-(v / vs)^2` is a
//! line here, with the same area: off by at most 0.08 of what it takes more to break away. The references' motion is used, not
//! the measured one, which noise turns over at rest.

use crate::base::format::{Current, Ratio, Speed, SpeedGain, narrow};

/// A place with friction, as currents of one motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RubbingConfig {
    /// Part of the way to its level that [`STEPS`] go, per rad/s of the speed that it is given.
    pub rise: SpeedGain,
    /// A positive speed takes a negative current: the magnet is turned round.
    pub turned: bool,
    /// Level while it slides, A.
    pub coulomb: Current,
    /// What it takes more to break away, A.
    pub sticks: Current,
    /// What of that a speed takes, A per rad/s.
    pub fade: SpeedGain,
}

/// Currents of the frictions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrictionConfig {
    /// There is one.
    pub active: bool,
    /// Of the bearings, by the electrical speeds: screw, nut.
    pub bearings: [RubbingConfig; 2],
    /// Of pair and guideway at the screw, by the relative mechanical speed.
    pub feed: RubbingConfig,
    /// The nut's current of that over the screw's.
    pub feed_at_nut: SpeedGain,
}

/// How large each friction is, with its sign, A: bearings of screw and nut, feed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Friction {
    bearings: [Current; 2],
    feed: Current,
    /// The feed's at the nut.
    at_nut: Current,
    /// Which is next.
    next: u8,
}

/// Steps of the speed task in which each place has one.
pub(crate) const STEPS: u32 = 3;

impl Friction {
    /// None has been moved yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            bearings: [Current::ZERO; 2],
            feed: Current::ZERO,
            at_nut: Current::ZERO,
            next: 0,
        }
    }

    /// A step, of one place after the other: the speed references of screw and nut, electrical, and the relative one, mechanical
    /// -> what is added to the current references.
    #[must_use]
    #[inline(always)]
    pub fn currents(
        &mut self,
        config: &FrictionConfig,
        speeds: [Speed; 2],
        relative: Speed,
    ) -> [Current; 2] {
        let [screw_speed, nut_speed] = speeds;
        let [screw_config, nut_config] = &config.bearings;
        let [screw, nut] = &mut self.bearings;
        self.next = match self.next {
            0 => {
                step(screw, screw_config, screw_speed);
                1
            }
            1 => {
                step(nut, nut_config, nut_speed);
                2
            }
            _ => {
                step(&mut self.feed, &config.feed, relative);
                self.at_nut = narrow(config.feed_at_nut.wide_mul(self.feed));
                0
            }
        };
        [
            screw.saturating_add(self.feed),
            nut.saturating_sub(self.at_nut),
        ]
    }
}

/// A step of one place.
#[inline(always)]
fn step(state: &mut Current, config: &RubbingConfig, speed: Speed) {
    let speed_size = speed.saturating_abs();
    let faded: Current = narrow(config.fade.wide_mul(speed_size));
    let sticks = config.sticks.saturating_sub(faded).max(Current::ZERO);
    let size = config.coulomb.saturating_add(sticks);
    let level = if (speed < Speed::ZERO) != config.turned {
        size.saturating_neg()
    } else {
        size
    };
    let part: Ratio = narrow(config.rise.wide_mul(speed_size));
    let part = part.min(Ratio::ONE);
    *state = state.saturating_add(narrow(part.wide_mul(level.saturating_sub(*state))));
}

#[cfg(test)]
mod tests {
    use super::{Friction, STEPS};
    use crate::base::format::Speed;
    use crate::plate::{FrictionPlate, RubbingPlate, test_plate};
    use proptest::prelude::*;

    const BEARING: RubbingPlate = RubbingPlate {
        coulomb_nm: 0.05,
        sticks_nm: 0.03,
        stribeck_rad_s: 2.0,
        presliding_rad: 0.005,
    };
    const FEED: RubbingPlate = RubbingPlate {
        coulomb_nm: 0.1,
        ..BEARING
    };

    fn plate() -> crate::plate::DrivePlate {
        let mut plate = test_plate();
        plate.friction = FrictionPlate {
            bearings: [BEARING; 2],
            feed: FEED,
        };
        plate
    }

    /// `e^-(v / vs)^2` as a line of the same area.
    fn level(rubbing: &RubbingPlate, speed: f64) -> f64 {
        let end = std::f64::consts::PI.sqrt() * rubbing.stribeck_rad_s;
        rubbing.coulomb_nm + rubbing.sticks_nm * (1.0 - speed.abs() / end).max(0.0)
    }

    proptest! {
        #[test]
        fn each_friction_has_its_speeds_sign_and_its_torque(
            screw in -1500.0..1500.0f64, nut in -1500.0..1500.0f64, relative in -100.0..100.0f64,
        ) {
            prop_assume!(screw.abs() > 0.5 && nut.abs() > 0.5 && relative.abs() > 0.1);
            let mut plate = plate();
            plate.motors[1].flux_wb *= -1.0;
            let config = plate.config().unwrap();
            let mut friction = Friction::new();
            let speeds = [screw, nut].map(Speed::from_num);
            // Ten times its way for the slowest.
            let steps = (10.0 * 0.005 / 0.1 / plate.speed_step()) as u32;
            for _ in 0..steps {
                let _ = friction.currents(&config.friction, speeds, Speed::from_num(relative));
            }
            let got = friction.currents(&config.friction, speeds, Speed::from_num(relative));
            let one = |rubbing, speed: f64| level(&rubbing, speed) * speed.signum();
            let exact = [
                (one(BEARING, screw / 5.0) + one(FEED, relative)) / 0.55,
                (one(BEARING, nut / 5.0) - one(FEED, relative)) / -0.55,
            ];
            for (got, exact) in got.into_iter().zip(exact) {
                prop_assert!((got.to_num::<f64>() - exact).abs() < 2e-3, "{got} A for {exact} A");
            }
        }
    }

    /// The torque after a reversal, beside Dahl's.
    #[test]
    fn it_turns_with_the_way() {
        let plate = plate();
        let config = plate.config().unwrap();
        let mut friction = Friction::new();
        let mut step = |speed: f64| {
            let speeds = [Speed::ZERO; 2];
            let [screw, _] = friction.currents(&config.friction, speeds, Speed::from_num(speed));
            screw.to_num::<f64>()
        };
        let speed = 0.05;
        // Whole rounds.
        let rounds = |way: f64| way / speed / plate.speed_step() / f64::from(STEPS);
        let steps = |way: f64| STEPS * rounds(way).round() as u32;
        (0..steps(20.0 * FEED.presliding_rad)).for_each(|_| {
            step(-speed);
        });
        let mut last = 0.0;
        (0..steps(FEED.presliding_rad)).for_each(|_| last = step(speed));
        let most = level(&FEED, speed) / 0.55;
        let exact = most * (1.0 - 2.0 * (-1.0f64).exp());
        assert!(
            (last - exact).abs() < 0.01 * most,
            "{last} A after its way, expected {exact} A within 1 % of {most} A"
        );
    }
}
