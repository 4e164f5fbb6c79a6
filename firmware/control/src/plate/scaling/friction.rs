//! Friction -> the currents that are fed forward against it.

use super::{attempt, within};
use crate::base::format::{Current, Misfit, SpeedGain, fixed_point};
use crate::plate::{DrivePlate, RubbingPlate};
use crate::speed::friction::{FrictionConfig, RubbingConfig, STEPS};

/// Where the line that stands for `e^-x^2` ends, so that it has the same area: the root of pi.
const LINE_ENDS: f64 = 1.772_453_850_905_516;

impl DrivePlate {
    /// # Errors
    /// [`Misfit`] if a friction is none, or its slope does not fit its format.
    pub(super) const fn friction(&self) -> Result<FrictionConfig, Misfit> {
        let [screw, nut] = &self.motors;
        let plate = &self.friction;
        let [screw_plate, nut_plate] = &plate.bearings;
        let (screw_pairs, nut_pairs) = (screw.pole_pairs as f64, nut.pole_pairs as f64);
        let screw_per_amp = screw_pairs * screw.flux_wb;
        let nut_per_amp = nut_pairs * nut.flux_wb;
        Ok(FrictionConfig {
            active: screw_plate.rubs() || nut_plate.rubs() || plate.feed.rubs(),
            bearings: [
                attempt!(self.rubbing(screw_plate, screw_per_amp, screw_pairs)),
                attempt!(self.rubbing(nut_plate, nut_per_amp, nut_pairs)),
            ],
            feed: attempt!(self.rubbing(&plate.feed, screw_per_amp, 1.0)),
            feed_at_nut: attempt!(fixed_point("flux of the screw over the nut's", "1", {
                screw_per_amp / nut_per_amp
            })),
        })
    }

    /// A friction as currents of a motor of so many N m per A, by a speed of so many rad/s a mechanical one.
    const fn rubbing(
        &self,
        plate: &RubbingPlate,
        per_amp: f64,
        pairs: f64,
    ) -> Result<RubbingConfig, Misfit> {
        if !plate.rubs() {
            return Ok(RubbingConfig {
                rise: SpeedGain::ZERO,
                turned: false,
                coulomb: Current::ZERO,
                sticks: Current::ZERO,
                fade: SpeedGain::ZERO,
            });
        }
        let (presliding, stribeck) = (plate.presliding_rad, plate.stribeck_rad_s);
        attempt!(within("presliding", "rad", presliding, 1e-6, 10.0));
        attempt!(within("Stribeck speed", "rad/s", stribeck, 1e-3, 1e4));
        let size = per_amp.abs();
        let rise = STEPS as f64 * self.speed_step() / presliding / pairs;
        let fade = plate.sticks_nm / size / (LINE_ENDS * stribeck) / pairs;
        Ok(RubbingConfig {
            rise: attempt!(fixed_point("steps over the presliding", "s/rad", rise)),
            turned: per_amp < 0.0,
            coulomb: attempt!(current(plate.coulomb_nm / size)),
            sticks: attempt!(current(plate.sticks_nm / size)),
            fade: attempt!(fixed_point(
                "friction over its Stribeck speed",
                "A s/rad",
                fade
            )),
        })
    }
}

const fn current(amps: f64) -> Result<Current, Misfit> {
    attempt!(within("friction", "A", amps, -1e-9, 2000.0));
    fixed_point("friction", "A", amps)
}
