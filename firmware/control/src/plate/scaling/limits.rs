//! What a motor and its bridge bear for long, and where braking fades out -> squares, counts, parts of a look.

use super::{attempt, positive, power_of_two, within};
use crate::base::format::{Current, CurrentScale, Gain, Misfit, fixed_point, quantise};
use crate::base::rates::STEPS_PER_HEAT;
use crate::plate::{DrivePlate, MotorPlate, ThermalPlate};
use crate::speed::current_limit::RegenerationConfig;
use crate::speed::thermal::{HeatConfig, ThermalConfig};
use core::f64::consts::TAU;

/// Part of the rated heat at which folding back begins.
const FOLDS_FROM: f64 = 0.9;
/// Past the heat of 1.05 times the rated current it is a fault: the factor `k` that IEC 60255-149's curves usually have.
const TRIPS: f64 = 1.05 * 1.05;

impl MotorPlate {
    pub(super) const fn heat(&self, drive: &DrivePlate) -> Result<HeatConfig, Misfit> {
        let scale = attempt!(drive.board.current_sense(self.current_gains())).scale;
        let look = drive.speed_step() * STEPS_PER_HEAT as f64;
        let bridge = &drive.bridge.thermal;
        let winding = &self.thermal;
        let shortest = if bridge.seconds < winding.seconds {
            bridge.seconds
        } else {
            winding.seconds
        };
        // An electrical turn in a tenth of the shorter time constant.
        let turns = drive.board.sample_time() / (0.1 * shortest * self.pole_pairs as f64);
        #[allow(clippy::cast_possible_truncation)]
        Ok(HeatConfig {
            winding: attempt!(winding.config(self.current_max(), look, scale)),
            bridge: attempt!(bridge.config(self.current_max(), look, scale)),
            turning: (turns * 4_294_967_296.0) as i32,
        })
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub(super) const fn regeneration(
        &self,
        drive: &DrivePlate,
    ) -> Result<RegenerationConfig, Misfit> {
        let (board, bridge) = (&drive.board, &drive.bridge);
        let (from, full) = (bridge.brake_fade_from_v, bridge.brake_fade_to_v);
        attempt!(within(
            "bus at which braking begins to fade",
            "V",
            from,
            bridge.bus_min_v,
            full
        ));
        let (from, full) = (
            from / board.bus_volts_per_count,
            full / board.bus_volts_per_count,
        );
        attempt!(within(
            "bus at which braking ends",
            "counts",
            full,
            from + 8.0,
            board.adc_counts as f64
        ));
        let (from, full) = (from as u16, full as u16);
        let fades = full.saturating_sub(from);
        let per_count = self.current_max() / fades as f64;
        // Where the stall's watch begins: see the module.
        let slow = self.speed_max() * drive.runaway.stall / TAU * board.sample_time();
        Ok(RegenerationConfig {
            full,
            fades,
            per_count: attempt!(quantise(
                "braking current for a count of the bus",
                "A",
                per_count,
                Current::FRAC_NBITS.saturating_add(8)
            )),
            slow: (slow * 4_294_967_296.0) as u32,
        })
    }
}

impl ThermalPlate {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    const fn config(
        &self,
        current_max: f64,
        look: f64,
        scale: CurrentScale,
    ) -> Result<ThermalConfig, Misfit> {
        attempt!(positive("rated current", "A", self.rated_rms_a));
        // The vector's square is the sum of the phases'.
        let square = 3.0 * self.rated_rms_a * self.rated_rms_a;
        let rated_current = super::square_root(square);
        let ampere = power_of_two(scale.fraction);
        let rated = square * ampere * ampere / 4_294_967_296.0;
        attempt!(within(
            "square of the rated current",
            "2^-32 of a current's steps squared",
            rated,
            4096.0,
            1_073_741_823.0 / TRIPS
        ));
        let part = look / self.seconds * 4_294_967_296.0;
        attempt!(within(
            "look, part of the thermal time constant",
            "2^-32",
            part,
            500.0,
            429_496_729.0
        ));
        // From the largest current at the beginning to the rated one at the rated heat; at least as steep as from one and a
        // half times the rated current, so that the residual at a standstill settles below the trip.
        let more = current_max - rated_current;
        let half = rated_current / 2.0;
        let fold = if more > half { more } else { half } * power_of_two(Current::FRAC_NBITS)
            / ((1.0 - FOLDS_FROM) * rated);
        let shift = super::shift_of(fold * 4_294_967_296.0);
        let multiplier = fold * 4_294_967_296.0 / power_of_two(shift);
        attempt!(within(
            "fold-back",
            "A per heat",
            multiplier,
            500.0,
            2_147_483_648.0
        ));
        Ok(ThermalConfig {
            part: part as u32,
            rated: rated as i32,
            rated_current: attempt!(fixed_point("rated current", "A", rated_current)),
            fold: Gain {
                multiplier: multiplier as i32,
                shift,
            },
            trip: (rated * TRIPS) as i32,
        })
    }
}
