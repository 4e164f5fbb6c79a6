//! Friction -> the currents that are fed forward against it.

use super::{attempt, within};
use crate::format::{Current, Misfit, SpeedGain, quantise};
use crate::friction::FrictionConfig;
use crate::plate::DrivePlate;

impl DrivePlate {
    /// # Errors
    /// [`Misfit`] if a friction is none, or its slope does not fit its format.
    pub(super) const fn friction(&self) -> Result<FrictionConfig, Misfit> {
        let plate = &self.friction;
        let [screw, nut] = &self.motors;
        let [screw_nm, nut_nm] = plate.bearings_nm;
        // A magnet that is turned round turns the slopes, not the sizes.
        let per_amp = [
            screw.pole_pairs as f64 * screw.flux_wb,
            nut.pole_pairs as f64 * nut.flux_wb,
        ];
        let [screw_per_amp, nut_per_amp] = per_amp;
        let some = screw_nm != 0.0 || nut_nm != 0.0 || plate.feed_nm != 0.0;
        let band = if some { plate.band_rad_s } else { 1.0 };
        attempt!(within(
            "band of a friction's sign",
            "rad/s",
            band,
            1e-3,
            1e3
        ));
        Ok(FrictionConfig {
            bearings: [
                attempt!(current(screw_nm / screw_per_amp.abs())),
                attempt!(current(nut_nm / nut_per_amp.abs())),
            ],
            feed: [
                attempt!(current(plate.feed_nm / screw_per_amp.abs())),
                attempt!(current(plate.feed_nm / nut_per_amp.abs())),
            ],
            bearing_slopes: [
                attempt!(slope(
                    screw_nm / screw_per_amp / band / screw.pole_pairs as f64
                )),
                attempt!(slope(nut_nm / nut_per_amp / band / nut.pole_pairs as f64)),
            ],
            feed_slopes: [
                attempt!(slope(plate.feed_nm / screw_per_amp / band)),
                attempt!(slope(plate.feed_nm / nut_per_amp / band)),
            ],
        })
    }
}

const fn current(amps: f64) -> Result<Current, Misfit> {
    attempt!(within("friction", "A", amps, -1e-9, 2000.0));
    Ok(Current::from_bits(attempt!(quantise(
        "friction", "A", amps, 20
    ))))
}

const fn slope(amps_per_rad_s: f64) -> Result<SpeedGain, Misfit> {
    Ok(SpeedGain::from_bits(attempt!(quantise(
        "friction over the band of its sign",
        "A s/rad",
        amps_per_rad_s,
        24
    ))))
}
