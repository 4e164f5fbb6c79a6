//! Phase voltages -> timer compare values, by space-vector modulation.
//!
//! The common mode is shifted so that the highest and the lowest phase lie symmetrically, which uses the bus up to
//! a phase-to-phase voltage of the whole bus: a d/q vector of `bus / sqrt(2)` in the power-invariant frame. The
//! timer counts up and down; a phase's high side is on while the counter is below its compare value, so the low
//! sides are on around the counter's top, where the shunts are sampled. A minimum on-time of the low sides keeps
//! that window open: it bounds the compare value from above, and the voltage circle is made smaller to match.

use crate::base::format::{StatorVoltage, Voltage, multiply_upper};
use crate::current::regulator::Circle;
use crate::current::sense::{Codes, Shunts};
use crate::current::transform::AlphaBeta;

/// Configuration of the modulator of one bridge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModulationConfig {
    /// Counter's top: a compare value of `period` is always on, 0 never.
    pub period: u16,
    /// Largest compare value that leaves the low sides their minimum on-time.
    pub compare_max: u16,
    /// The middle of the permitted range and half a count of rounding, fine counts: voltage zero.
    pub centre: i32,
    /// Fraction bits of a fine count, in which compare values are computed: 7, or as many as the lowest bus leaves.
    pub fraction: u32,
    /// What, divided by a count of the bus and shifted left by `scale_shift`, makes fine counts of voltages: the
    /// period times `sqrt(2/3)` of the inverse Clarke, per volt of one bus count, brought to [2^31, 2^32) so that the
    /// quotient has its bits.
    pub scale_per_bus_count: u32,
    /// See `scale_per_bus_count`.
    pub scale_shift: u32,
    /// 2^63 divided by `scale_per_bus_count`.
    pub scale_inverse: u32,
    /// Bus counts below this are taken as this: the division's floor, which keeps its result in its word.
    pub bus_counts_min: u16,
    /// Radius of the voltage circle for one bus count, 2^-28 V: `(1 - min_on / T) / sqrt(2)` of the bus, less twice the
    /// part that the dead time takes, less a thousandth for what is rounded. The compensation lifts the two outer phases
    /// apart by twice its voltage: sqrt(2) of it in the d/q frame, and 2 is safe.
    pub radius: u32,
    /// The square of half of it, 2^-34 V^2.
    pub radius_square: u32,
    /// Dead-time compensation.
    pub dead_time: DeadTime,
}

/// What makes compare values of voltages near one bus voltage: the bus voltage compensation, along its tangent. The
/// speed task divides; a current loop corrects by what the bus has changed since, a fraction of a percent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusScale {
    /// Voltages in 2^-17 V to fine counts of alpha, 2^-32, where the tangent meets a bus of zero counts: twice the scale,
    /// at most 2^30.
    pub at_zero: i32,
    /// By how much the scale falls with a count.
    pub slope: i32,
}

impl BusScale {
    /// The scale at `bus` counts. On a bus of more than twice the counts that it was made for it would turn its sign: there
    /// it is zero.
    #[inline(always)]
    #[allow(clippy::arithmetic_side_effects)]
    fn at(self, bus: u32) -> i32 {
        self.at_zero
            .wrapping_sub(self.slope.wrapping_mul(bus.cast_signed()))
            .max(0)
    }
}

/// Dead-time compensation: `v = v_full * clamp(i / i_full, -1, 1)`, straight in timer counts: the dead time takes as many
/// of them whatever the bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeadTime {
    /// Which channels have a code.
    pub shunts: Shunts,
    /// Codes of each channel to parts of the full compensation, 2^-16: within `i_full` of zero a current's sign is
    /// noise, and the compensation fades in. At most 2^30.
    pub slopes: [i32; 3],
    /// Half the dead time, as a compare value is half of an on-time, 2^-16 fine counts: times a part, 2^-32 of it.
    pub full: i32,
}

impl DeadTime {
    /// What is added to the compare values of the phases for their codes, fine counts.
    #[inline(always)]
    fn compensation(&self, shunts: Shunts, [a, b, c]: Codes) -> [i32; 3] {
        let [ka, kb, kc] = self.slopes;
        let (a, b) = (multiply_upper(a, ka), multiply_upper(b, kb));
        // Each is at most 2^29.
        #[allow(clippy::arithmetic_side_effects)]
        let c = match shunts {
            Shunts::Two => -(a + b),
            Shunts::Three => multiply_upper(c, kc),
        };
        const ONE: i32 = 1 << 16;
        [a, b, c].map(|part| multiply_upper(part.clamp(-ONE, ONE - 1), self.full))
    }
}

impl ModulationConfig {
    /// The circle of the d/q vectors that can be realised without touching a limit, at `counts` of the bus.
    #[must_use]
    #[inline(always)]
    pub fn circle(&self, counts: u32) -> Circle {
        let square =
            u64::from(counts.wrapping_mul(counts)).wrapping_mul(u64::from(self.radius_square));
        // In 2^-18 V: fewer than 1024 counts of less than a volt each, or the end of the format.
        let radius = u64::from(counts).wrapping_mul(u64::from(self.radius)) >> 10;
        #[allow(clippy::cast_possible_truncation)]
        Circle {
            radius: Voltage::from_bits(radius.min(1 << 30) as i32),
            square: (square >> 32) as u32,
        }
    }

    /// Compare values of phases a, b, c for the voltage `v` within the circle, with the phase currents' `codes` for the
    /// dead time, on the bus measured as `bus_counts`, near that of `scale`.
    #[must_use]
    #[inline(always)]
    pub fn compare(
        &self,
        v: AlphaBeta<StatorVoltage>,
        codes: Codes,
        scale: BusScale,
        bus_counts: u32,
    ) -> [u16; 3] {
        let (shunts, fraction) = (self.dead_time.shunts, self.fraction);
        self.compare_of(shunts, fraction, v, codes, scale, bus_counts)
    }

    /// The same with the sensors and the fraction bits as a board says them, as constants where they are some.
    #[inline(always)]
    #[allow(clippy::arithmetic_side_effects)]
    pub(crate) fn compare_of(
        &self,
        shunts: Shunts,
        fraction: u32,
        v: AlphaBeta<StatorVoltage>,
        codes: Codes,
        scale: BusScale,
        bus_counts: u32,
    ) -> [u16; 3] {
        // sqrt(3)/2 less 1, in 2^-32.
        const SQRT_3_2_LESS_1: i32 = -575_416_510;
        let scale = scale.at(bus_counts);
        // Inverse Clarke in fine counts: whatever comes in, a product's upper word is within 2^30.
        let a = multiply_upper(v.alpha.to_bits(), scale);
        let beta = multiply_upper(v.beta.to_bits(), scale);
        let beta = beta + multiply_upper(beta, SQRT_3_2_LESS_1);
        let (half, above) = (a >> 1, beta.abs());
        let (b, c) = (beta - half, -beta - half);
        // The highest and the lowest phase lie symmetrically when half of the middle one is added to all.
        let middle = a.min(above - half).max(-above - half);
        let offset = (middle >> 1) + self.centre;
        let [da, db, dc] = self.dead_time.compensation(shunts, codes);
        // The circle keeps them within 0 and `compare_max`; the ends are those of any value that an interrupt might write.
        [a + offset + da, b + offset + db, c + offset + dc].map(|fine| counts(fine, fraction))
    }

    /// The scale at and near `bus_counts`. One 32-bit division.
    #[must_use]
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation)]
    pub fn bus_scale(&self, bus_counts: u16) -> BusScale {
        let counts = u32::from(bus_counts.max(self.bus_counts_min));
        let quotient = self.scale_per_bus_count.checked_div(counts).unwrap_or(0);
        // Below 2^29: `bus_counts_min` is chosen so.
        let scale = quotient.wrapping_shl(self.scale_shift);
        // scale / counts = scale * quotient / scale_per_bus_count, rounded down.
        let upper = |a: u32, b: u32| (u64::from(a).wrapping_mul(u64::from(b)) >> 32) as u32;
        let slope = upper(upper(scale, quotient), self.scale_inverse).wrapping_shl(1);
        BusScale {
            at_zero: scale.wrapping_add(slope.wrapping_mul(counts)).cast_signed(),
            slope: slope.cast_signed(),
        }
    }
}

/// Whole counts of a compare value in fine ones, cut to what the timer's 13 to 15 bits can need.
#[inline(always)]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn counts(fine: i32, fraction: u32) -> u16 {
    const END: i32 = (1 << 15) - 1;
    (fine >> (fraction & 31)).clamp(0, END) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::format::Angle;
    use crate::current::regulator::limit;
    use crate::current::transform::{DirectQuadrature, Rotation};
    use crate::plate::{DrivePlate, test_plate};
    use proptest::prelude::*;

    fn plate(dead_time_s: f64, min_on_time_s: f64) -> DrivePlate {
        let mut plate = test_plate();
        plate.bridge.dead_time_s = dead_time_s;
        plate.bridge.min_on_time_s = min_on_time_s;
        plate
    }

    fn config(plate: &DrivePlate) -> ModulationConfig {
        plate.motors[0].current_loop(plate).unwrap().modulation
    }

    fn bus(counts: u16) -> f64 {
        f64::from(counts) * test_plate().board.bus_volts_per_count
    }

    fn vector(alpha: f64, beta: f64) -> AlphaBeta<StatorVoltage> {
        AlphaBeta {
            alpha: StatorVoltage::from_num(alpha),
            beta: StatorVoltage::from_num(beta),
        }
    }

    proptest! {
        #[test]
        fn phase_to_phase_voltages_are_realised(
            angle in 0.0..core::f64::consts::TAU, part in 0.0..1.0f64, counts in 800u16..4095, min_on in 0.0..3e-6f64,
        ) {
            let config = config(&plate(0.0, min_on));
            let length = config.circle(counts.into()).radius.to_num::<f64>() * part;
            let compare = config.compare(vector(length * angle.cos(), length * angle.sin()), [0; 3], config.bus_scale(counts), counts.into());
            let volts = [0.0, 1.0, 2.0]
                .map(|k| (2f64 / 3.0).sqrt() * length * (angle - k * core::f64::consts::TAU / 3.0).cos());
            let lsb = bus(counts) / f64::from(config.period);
            for (j, k) in [(0, 1), (1, 2), (2, 0)] {
                let realised = (f64::from(compare[j]) - f64::from(compare[k])) * lsb;
                prop_assert!((realised - (volts[j] - volts[k])).abs() < 1.1 * lsb, "{realised} for {}", volts[j] - volts[k]);
            }
            let (highest, lowest) = (compare.iter().max().unwrap(), compare.iter().min().unwrap());
            prop_assert!((highest + lowest).abs_diff(config.compare_max) <= 1, "{compare:?} are not in the middle");
        }

        /// The whole circle is there: its square and its radius agree, and on it a phase is within 5 counts of an end.
        #[test]
        fn the_circle_is_what_the_bus_gives(counts in 100u16..4095, dead_time in 0.0..1e-6f64) {
            let config = config(&plate(dead_time, 2e-6));
            let circle = config.circle(counts.into());
            let radius = circle.radius.to_num::<f64>();
            prop_assert!((f64::from(circle.square) / 4.0 - radius * radius).abs() < 0.3);
            let exact = bus(counts) * (core::f64::consts::FRAC_1_SQRT_2 * (1.0 - 2.0 / 50.0) - 2.0 * dead_time / 50e-6);
            prop_assert!(radius < exact && radius > 0.998 * exact, "{radius} V of {exact} V");
        }

        #[test]
        fn dead_time_is_added_with_the_current(i in -4.0..4.0f64) {
            let plate = plate(1e-6, 0.0);
            let config = config(&plate);
            let code = (i / plate.board.amps_per_count * 2f64.powi(19)) as i32;
            let compare = config.compare(vector(0.0, 0.0), [code, -code, 0], config.bus_scale(3000), 3000).map(f64::from);
            let part = (i / plate.bridge.dead_time_fade_a).clamp(-1.0, 1.0);
            let counts = 4250.0 / 50.0 * part;
            prop_assert!(config.period == 4250);
            prop_assert!((compare[0] - compare[2] - counts).abs() < 1.1, "{compare:?} for {counts}");
            prop_assert!((compare[1] - compare[2] + counts).abs() < 1.1, "{compare:?} for {counts}");
        }

        /// Whatever the regulator asks, its limit to the circle leaves compare values that keep the low sides' on-time.
        #[test]
        fn any_voltage_in_the_circle_gives_a_compare_within_the_range(
            v in any::<[i32; 2]>(), theta_e in any::<u32>(), codes in any::<[i32; 3]>(), counts in any::<u16>(), on_the_circle in any::<bool>(),
        ) {
            for shunts in [Shunts::Two, Shunts::Three] {
                let mut plate = plate(1e-6, 1e-6);
                plate.board.shunts = shunts;
                let config = config(&plate);
                let counts = counts % 4096;
                let [d, q] = v.map(|x| Voltage::from_bits(if on_the_circle { x } else { x >> 6 }));
                let v = limit(DirectQuadrature { d, q }, config.circle(counts.into()).radius);
                let compare = config.compare(Rotation::new(Angle(theta_e)).inverse_park(v), codes, config.bus_scale(counts), counts.into());
                prop_assert!(compare.iter().all(|&c| c <= config.compare_max), "{compare:?}");
            }
        }

        /// Along the tangent: right to the square of the change, and never of another sign.
        #[test]
        fn the_scale_follows_the_bus(counts in 0..4096u16, now in 0..4096u16) {
            let config = config(&plate(0.0, 0.0));
            let near = config.bus_scale(counts);
            let got = f64::from(near.at(now.into()));
            let counts = counts.max(config.bus_counts_min);
            let exact = f64::from(config.scale_per_bus_count) * 2f64.powi(config.scale_shift as i32) / f64::from(now);
            prop_assert!(got >= 0.0);
            // A convex curve is above its tangents.
            if now >= config.bus_counts_min {
                prop_assert!(got <= exact * (1.0 + 3e-4), "{got} for {exact} at {now} counts, made for {counts}");
            }
            // Below the smallest bus the circle leaves no voltage to be scaled.
            prop_assume!(now >= config.bus_counts_min);
            let part = (f64::from(now) - f64::from(counts)) / f64::from(counts);
            if part.abs() < 0.5 {
                prop_assert!((got / exact - 1.0).abs() <= part * part + 3e-4, "{got} for {exact}");
            }
        }

        /// Debug builds panic where a sum would leave its format.
        #[test]
        fn no_input_overflows(v in any::<[i32; 2]>(), codes in any::<[i32; 3]>(), counts in any::<u16>()) {
            let config = config(&plate(1e-6, 1e-6));
            let [alpha, beta] = v.map(StatorVoltage::from_bits);
            let _ = config.compare(AlphaBeta { alpha, beta }, codes, config.bus_scale(counts), counts.into());
            prop_assert!(config.bus_scale(counts).at_zero > 0);
            prop_assert!(config.circle(counts.into()).radius >= 0);
        }
    }
}
