//! Friction that is known is fed forward: where a speed reference reverses, the speed loop need not wait for the error.
//!
//! Coulomb friction of each motor's bearings acts on its own speed, that of the ball pair and the guideway on the relative
//! speed, with opposite signs on screw and nut. The references' signs are used, not the measured ones, which noise turns over
//! at rest; within a narrow band of speeds the sign fades, so that no step is asked that the current loop cannot follow.

use crate::format::{Current, Speed, SpeedGain, cut, narrow};

/// Currents of the frictions, and how steep their signs are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrictionConfig {
    /// Of the bearings: screw, nut, A.
    pub bearings: [Current; 2],
    /// Of the pair and the guideway at screw and nut, A.
    pub feed: [Current; 2],
    /// The friction's slope within the band: A per electrical rad/s of screw and nut.
    pub bearing_slopes: [SpeedGain; 2],
    /// The same of the pair and the guideway, per mechanical rad/s of the relative speed.
    pub feed_slopes: [SpeedGain; 2],
}

impl FrictionConfig {
    /// What is added to the current references of screw and nut: their speed references, electrical, and the relative one,
    /// mechanical.
    #[must_use]
    #[inline(always)]
    pub fn currents(&self, speeds: [Speed; 2], relative: Speed) -> [Current; 2] {
        let [screw, nut] = speeds;
        let [screw_bearing, nut_bearing] = self.bearings;
        let [screw_slope, nut_slope] = self.bearing_slopes;
        let [screw_feed, nut_feed] = self.feed;
        let [screw_feed_slope, nut_feed_slope] = self.feed_slopes;
        [
            level(screw, screw_slope, screw_bearing).saturating_add(level(
                relative,
                screw_feed_slope,
                screw_feed,
            )),
            level(nut, nut_slope, nut_bearing).saturating_sub(level(
                relative,
                nut_feed_slope,
                nut_feed,
            )),
        ]
    }
}

/// A friction with its sign.
#[inline(always)]
fn level(speed: Speed, slope: SpeedGain, most: Current) -> Current {
    cut(narrow(slope.wide_mul(speed)), most)
}

#[cfg(test)]
mod tests {
    use crate::format::Speed;
    use crate::plate::{FrictionPlate, test_plate};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn each_friction_has_its_speeds_sign_and_its_torque(
            screw in -1500.0..1500.0f64, nut in -1500.0..1500.0f64, relative in -100.0..100.0f64,
        ) {
            let mut plate = test_plate();
            plate.friction = FrictionPlate { bearings_nm: [0.05, 0.04], feed_nm: 0.1, band_rad_s: 0.02 };
            let config = plate.config().unwrap().friction;
            let got = config.currents([screw, nut].map(Speed::from_num), Speed::from_num(relative));
            let sign = |speed: f64| (speed / 0.02).clamp(-1.0, 1.0);
            let exact = [
                (0.05 * sign(screw / 5.0) + 0.1 * sign(relative)) / 0.55,
                (0.04 * sign(nut / 5.0) - 0.1 * sign(relative)) / 0.55,
            ];
            for (got, exact) in got.into_iter().zip(exact) {
                prop_assert!((got.to_num::<f64>() - exact).abs() < 2e-3, "{got} A for {exact} A");
            }
        }
    }
}
