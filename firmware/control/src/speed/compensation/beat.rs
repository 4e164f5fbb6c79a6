//! Where an encoder's counting beats with the sampling: a ripple that is not there.
//!
//! An encoder gives whole counts. Of a shaft that turns evenly its error is a sawtooth with harmonics at whole multiples `m` of the
//! rate of counts, of an amplitude of a count over `pi * m`. A sample folds each of them to within half of its own rate, where
//! an order of the turn may lie. The speed loop's error then has a ripple at that order that no torque makes.
//!
//! Learning is an integrator: of a ripple that is `d` Hz away it learns a part of `1 / (2 pi d tau)`. The current that would cancel
//! the sawtooth grows with the square of the frequency. So does the distance within which a line does not learn.

use crate::base::format::{Speed, multiply_upper};

/// Harmonics of the sawtooth that are looked at. Of those above, less than a twelfth is learned.
const HARMONICS: u32 = 12;

/// Where one motor's encoder beats.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BeatConfig {
    /// Counts a PWM period, 2^-48, per 2^-16 electrical rad/s.
    pub counts: i64,
    /// The distance from the first harmonic, of the square of a frequency, both parts of the PWM frequency: 2^-8.
    pub distance: u32,
}

impl BeatConfig {
    /// A harmonic of the encoder's counting lies too near to `frequency`, 2^-32 turn a PWM period, of a shaft that is asked to turn
    /// evenly at `omega_e`.
    #[inline(always)]
    pub(super) fn is_near(&self, omega_e: Speed, frequency: u32) -> bool {
        let counts = i64::from(omega_e.to_bits()).wrapping_mul(self.counts) >> 16;
        // Whole counts a period are dropped: a sample does not see them.
        #[allow(clippy::cast_possible_truncation)]
        let first = counts as u32;
        // A frequency is within an eighth.
        let square = multiply_upper(frequency.cast_signed(), frequency.cast_signed());
        let distance = (u64::from(square.unsigned_abs()).wrapping_mul(self.distance.into())) >> 8;
        let mut harmonic = 0u32;
        let mut folded = 0u32;
        while harmonic < HARMONICS {
            harmonic = harmonic.wrapping_add(1);
            folded = folded.wrapping_add(first);
            let away = folded.cast_signed().unsigned_abs().abs_diff(frequency);
            if u64::from(away).wrapping_mul(harmonic.into()) < distance {
                return true;
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plate::{DrivePlate, test_plate};
    use std::f64::consts::TAU;

    const TAU_S: f64 = 0.5;
    /// Current of the largest torque, of which a thousandth may be learned of each harmonic.
    const MOST: f64 = 1e-3;

    fn plate(counts_per_turn: u32) -> DrivePlate {
        let mut plate = test_plate();
        plate.compensation.learning_s = TAU_S;
        plate.motors[0].encoder.counts_per_turn = counts_per_turn;
        plate
    }

    /// The current that takes an angle of a radian at `order`, of the largest torque's.
    fn per_radian(plate: &DrivePlate, hz: f64, order: f64) -> f64 {
        let motor = &plate.motors[0];
        let torque = f64::from(motor.pole_pairs) * motor.flux_wb;
        (TAU * hz * order).powi(2) * motor.inertia_kg_m2 / torque / motor.current_max()
    }

    /// The current that an integrator with the time constant of learning has after ten of them, of the largest torque's, where a
    /// shaft turns evenly at `hz` and `order` is learned from whole counts alone.
    fn learned(plate: &DrivePlate, hz: f64, order: f64) -> f64 {
        let motor = &plate.motors[0];
        let period = plate.board.sample_time();
        let counts = f64::from(motor.encoder.counts_per_turn);
        let per_radian = per_radian(plate, hz, order);
        let (mut re, mut im) = (0.0f64, 0.0f64);
        for k in 0..(10.0 * TAU_S / period) as u32 {
            let turned = hz * period * f64::from(k);
            let error = TAU * ((turned * counts).floor() / counts - turned + 0.5 / counts);
            let (sin, cos) = (TAU * order * turned).sin_cos();
            let part = period / TAU_S;
            re += part * (2.0 * error * per_radian * cos - re);
            im += part * (2.0 * error * per_radian * sin - im);
        }
        re.hypot(im)
    }

    fn is_near(plate: &DrivePlate, hz: f64, order: f64) -> bool {
        let motor = &plate.motors[0];
        let beat = plate.config().unwrap().compensation.beat[0];
        let omega_e = Speed::from_num(TAU * hz * f64::from(motor.pole_pairs));
        let frequency = hz * order * plate.board.sample_time() * 4_294_967_296.0;
        beat.is_near(omega_e, frequency as u32)
    }

    /// Each harmonic leaves a thousandth at most, and the first that is not looked at leaves all that it takes.
    #[test]
    fn counting_is_not_learned_as_a_ripple() {
        let plate = plate(16_000);
        let mut near = 0;
        for speed in 0..400 {
            let hz = 8.0 + 0.031 * f64::from(speed);
            for order in [60.0, 90.0] {
                if is_near(&plate, hz, order) {
                    near += 1;
                    continue;
                }
                let learned = learned(&plate, hz, order);
                let next = 2.0 / 16_000.0 / f64::from(HARMONICS + 1);
                let limit = MOST * f64::from(HARMONICS) + next * per_radian(&plate, hz, order);
                assert!(
                    learned < limit,
                    "order {order} at {hz} Hz: learned {learned:.4} of the largest current, expected less than {limit:.4}"
                );
            }
        }
        assert!(
            (8..400).contains(&near),
            "{near} of 800 are near, expected some"
        );
    }

    /// Where a harmonic meets an order exactly, all of its current would be learned.
    #[test]
    fn a_harmonic_that_meets_an_order_is_found() {
        for counts in [4_000, 16_000, 40_000] {
            let plate = plate(counts);
            let rate = 1.0 / plate.board.sample_time();
            for order in [30.0, 60.0, 90.0] {
                for harmonic in 1..4u32 {
                    for sign in [1.0, -1.0] {
                        let counting = f64::from(harmonic) * f64::from(counts) + sign * order;
                        let hz = (12.0 * counting / rate).round() * rate / counting;
                        let current = learned(&plate, hz, order);
                        assert!(
                            is_near(&plate, hz, order) || current < MOST,
                            "{counts} counts, harmonic {harmonic}, order {order} at {hz} Hz: {current:.4} of the largest current"
                        );
                    }
                }
            }
        }
    }

    /// An encoder of many counts keeps hardly any speed from being learned.
    #[test]
    fn a_fine_encoder_hardly_beats() {
        let plate = plate(1 << 21);
        let near = (0..2000).filter(|k| is_near(&plate, 8.0 + 0.01 * f64::from(*k), 90.0));
        let near = near.count();
        assert!(
            near < 20,
            "{near} of 2000 speeds are near, expected less than 20"
        );
    }
}
