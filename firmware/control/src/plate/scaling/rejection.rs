//! Disturbance observer and notch: plate -> fixed point.

use super::elementary::{decay, sine_and_cosine};
use super::{attempt, within};
use crate::base::format::{Current, Misfit, Ratio, SpeedGain, fixed_point};
use crate::plate::{DrivePlate, MotorPlate};
use crate::speed::disturbance::DisturbanceConfig;
use crate::speed::notch::NotchConfig;
use core::f64::consts::PI;

/// A notch's coefficients.
pub(super) struct NotchGains {
    /// Of the present input and the two before.
    pub(super) b: [f64; 3],
    /// Less, of the two outputs before.
    pub(super) a: [f64; 2],
}

impl DrivePlate {
    /// Part of its way that the disturbance observer's filter goes in a step.
    pub(super) const fn disturbance_part(&self) -> f64 {
        1.0 - decay(self.rejection.disturbance_rad_s * self.speed_step())
    }

    /// What passes all where there is no notch.
    pub(super) const fn notch_gains(&self) -> NotchGains {
        let plate = &self.rejection.notch;
        if plate.hz == 0.0 {
            return NotchGains {
                b: [1.0, 0.0, 0.0],
                a: [0.0; 2],
            };
        }
        let (sine, cosine) = sine_and_cosine(PI * plate.hz * self.speed_step());
        let k = sine / cosine;
        let (zeros, poles) = (
            2.0 * plate.damping * plate.depth * k,
            2.0 * plate.damping * k,
        );
        let least = 1.0 + k * k;
        let over = 1.0 / (least + poles);
        let middle = 2.0 * (k * k - 1.0) * over;
        NotchGains {
            b: [(least + zeros) * over, middle, (least - zeros) * over],
            a: [middle, (least - poles) * over],
        }
    }

    /// # Errors
    /// [`Misfit`] if the frequency is beyond the speed task's, or the currents are.
    pub(super) const fn notch(&self) -> Result<NotchConfig, Misfit> {
        let plate = &self.rejection.notch;
        let active = plate.hz != 0.0;
        if active {
            let rate = 1.0 / self.speed_step();
            attempt!(within("notch", "Hz", plate.hz, 1e-3 * rate, 0.45 * rate));
            attempt!(within("damping of the notch", "", plate.damping, 0.01, 2.0));
            attempt!(within("depth of the notch", "", plate.depth, -1e-9, 1.0));
            let [screw, nut] = &self.motors;
            attempt!(within(
                "current through a notch",
                "A",
                screw.current_max(),
                0.0,
                1024.0
            ));
            attempt!(within(
                "current through a notch",
                "A",
                nut.current_max(),
                0.0,
                1024.0
            ));
        }
        let NotchGains {
            b: [b0, b1, b2],
            a: [a1, a2],
        } = self.notch_gains();
        Ok(NotchConfig {
            active,
            b: [ratio(b0), ratio(b1), ratio(b2)],
            a: [ratio(a1), ratio(a2)],
        })
    }
}

impl MotorPlate {
    /// # Errors
    /// [`Misfit`] if the filter is as fast as the speed task.
    pub(super) const fn disturbance(
        &self,
        drive: &DrivePlate,
    ) -> Result<DisturbanceConfig, Misfit> {
        let omega = drive.rejection.disturbance_rad_s;
        if omega == 0.0 {
            return Ok(DisturbanceConfig {
                active: false,
                part: Current::ZERO,
                inertia: SpeedGain::ZERO,
            });
        }
        attempt!(within(
            "disturbance observer",
            "rad/s",
            omega,
            1e-3 / drive.speed_step(),
            0.5 / drive.speed_step()
        ));
        let pole_pairs = self.pole_pairs as f64;
        let inertia = self.inertia_kg_m2 / (pole_pairs * pole_pairs * self.flux_wb);
        Ok(DisturbanceConfig {
            active: true,
            part: attempt!(fixed_point(
                "filter of the disturbance observer",
                "",
                drive.disturbance_part()
            )),
            inertia: attempt!(fixed_point(
                "inertia of the disturbance observer",
                "A s/rad",
                omega * inertia
            )),
        })
    }
}

/// Of a number within ±2.
#[allow(clippy::cast_possible_truncation)]
const fn ratio(x: f64) -> Ratio {
    Ratio::from_bits((x * 1_073_741_824.0) as i32)
}
