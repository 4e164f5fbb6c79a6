//! A board's plate -> the scales of its ADC channels and of its PWM.

use super::{SQRT_3, attempt, positive, power_of_two, rounded, within};
use crate::base::format::{CurrentScale, Misfit, TableVelocity, quantise};
use crate::current::modulation::{DeadTime, ModulationConfig};
use crate::current::sense::{BusSense, CurrentSense, Shunts};
use crate::current::transform::AlphaBeta;
use crate::plate::{BoardPlate, BridgePlate};
use core::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// What divides by the bus, brought to [2^31, 2^32) of its word.
struct BusDivider {
    /// Fraction bits of the quotient.
    fraction: u32,
    numerator: f64,
    shift: u32,
    /// Lowest bus at which the quotient fits its word, counts.
    least: u16,
}

impl BusDivider {
    const fn new(per_count: f64, bus_counts_min: f64, adc_counts: u32) -> Self {
        // At the lowest bus the quotient must be within a quarter of its word.
        let mut fraction = 7u32;
        while per_count * power_of_two(fraction) > 536_870_912.0 * bus_counts_min && fraction > 3 {
            fraction = fraction.saturating_sub(1);
        }
        let full = per_count * power_of_two(fraction);
        let (mut numerator, mut shift) = (full, 0u32);
        while numerator >= 4_294_967_295.0 {
            numerator /= 2.0;
            shift = u32::saturating_add(shift, 1);
        }
        // Below this it would leave that.
        let mut least = (full / 536_870_912.0 + 1.0) as u16;
        // And the tangent there would leave it on a bus that leaps to the end of its range.
        while full / least as f64 * (adc_counts as f64 / least as f64 - 2.0) > 2_147_483_647.0 {
            least = least.saturating_add(1);
        }
        Self {
            fraction,
            numerator,
            shift,
            least,
        }
    }
}

impl BoardPlate {
    pub(super) const fn modulation(
        &self,
        bridge: &BridgePlate,
        sense: &CurrentSense,
    ) -> Result<ModulationConfig, Misfit> {
        let period = self.period();
        attempt!(within(
            "PWM frequency",
            "Hz",
            self.pwm_hz,
            9_999.0,
            40_001.0
        ));
        attempt!(within(
            "PWM period",
            "timer counts",
            self.timer_hz / (2.0 * self.pwm_hz),
            100.0,
            32_768.0
        ));
        let low_side = bridge.min_on_time_s / self.sample_time();
        attempt!(within(
            "minimum on-time",
            "PWM periods",
            low_side,
            -1e-9,
            0.5
        ));
        let dead = bridge.dead_time_s / self.sample_time();
        attempt!(within("dead time", "PWM periods", dead, -1e-9, 0.2));
        let circle = ((1.0 - low_side) * FRAC_1_SQRT_2 - 2.0 * dead) * 0.999;
        attempt!(within("voltage circle", "bus", circle, 0.0, 1.0));
        // A voltage is in 2^-17 V.
        let per_bus_count = period as f64 / self.bus_volts_per_count;
        attempt!(within(
            "PWM counts per volt and bus count",
            "counts/V",
            per_bus_count,
            1024.0,
            2_097_152.0
        ));
        let bus_counts_min = bridge.bus_min_v / self.bus_volts_per_count;
        let per_count = per_bus_count * 32_768.0 * (SQRT_2 / SQRT_3);
        let divided = BusDivider::new(per_count, bus_counts_min, self.adc_counts);
        let bus_counts_min = bus_counts_min as u16;
        let radius = circle * self.bus_volts_per_count;
        attempt!(within(
            "voltage circle of a bus count",
            "V",
            radius,
            1e-4,
            0.2499
        ));
        let compare_max = (period as f64 * (1.0 - low_side)) as u16;
        Ok(ModulationConfig {
            period,
            compare_max,
            centre: (compare_max as i32).saturating_add(1) << divided.fraction.saturating_sub(1),
            fraction: divided.fraction,
            scale_per_bus_count: divided.numerator as u32,
            scale_inverse: (9_223_372_036_854_775_808.0 / divided.numerator) as u32,
            scale_shift: divided.shift,
            bus_counts_min: if bus_counts_min > divided.least {
                bus_counts_min
            } else {
                divided.least
            },
            radius: (radius * 268_435_456.0) as u32,
            radius_square: (radius * radius * 17_179_869_184.0) as u32,
            dead_time: attempt!(self.dead_time(bridge, sense, divided.fraction)),
        })
    }

    const fn dead_time(
        &self,
        bridge: &BridgePlate,
        sense: &CurrentSense,
        fraction: u32,
    ) -> Result<DeadTime, Misfit> {
        // Compare values are counted up to half a period.
        let counts = bridge.dead_time_s * self.timer_hz / 2.0;
        attempt!(within("dead time", "timer counts", counts, -1e-9, 256.0));
        attempt!(positive(
            "current of the full dead-time compensation",
            "A",
            bridge.dead_time_fade_a
        ));
        let [a, b, c] = sense.amperes;
        Ok(DeadTime {
            shunts: self.shunts,
            slopes: [
                bridge.dead_time_slope(a, sense.scale),
                bridge.dead_time_slope(b, sense.scale),
                bridge.dead_time_slope(c, sense.scale),
            ],
            #[allow(clippy::cast_possible_truncation)]
            full: (counts * 65_536.0 * power_of_two(fraction)) as i32,
        })
    }

    #[allow(clippy::cast_possible_truncation)]
    pub(super) const fn current_sense(&self, gains: [f64; 3]) -> Result<CurrentSense, Misfit> {
        attempt!(within(
            "ADC range",
            "counts",
            self.adc_counts as f64,
            1023.5,
            65_536.5
        ));
        attempt!(within(
            "ADC counts at zero current",
            "counts",
            self.zero_counts,
            -1e-9,
            self.adc_counts as f64
        ));
        let [ga, gb, gc] = gains;
        attempt!(within("gain of a current channel", "", ga, 0.5, 2.0));
        attempt!(within("gain of a current channel", "", gb, 0.5, 2.0));
        attempt!(within("gain of a current channel", "", gc, 0.5, 2.0));
        let largest = largest(gains);
        attempt!(within(
            "ADC full scale",
            "A",
            self.adc_counts as f64 * self.amps_per_count.abs() * largest,
            0.0,
            2048.0
        ));
        // The code of the whole range is 2^31.
        let bits = self.adc_counts.saturating_sub(1).ilog2().saturating_add(1);
        let code_shift = 31u32.saturating_sub(bits);
        let per_code = self.amps_per_count / power_of_two(code_shift);
        // As many fraction bits as the largest factor has room for: sqrt(2) of b in beta.
        let mut fraction = 30u32;
        while per_code.abs() * largest * SQRT_2 * power_of_two(fraction) * 8_589_934_592.0
            >= 2_147_483_647.0
            && fraction > 0
        {
            fraction = fraction.saturating_sub(1);
        }
        // Amperes of a code in 2^-32 of the unit of currents in the rotor's frame; of the vector's, twice that.
        let unit = per_code * power_of_two(fraction) * 4_294_967_296.0;
        attempt!(within(
            "current of a count",
            "A",
            unit.abs(),
            1.0e6,
            2_147_483_648.0
        ));
        let [a, b, c] = [unit * ga, unit * gb, unit * gc];
        let clarke = clarke(self.shunts, [a, b, c]);
        let zero = (self.zero_counts * power_of_two(code_shift)) as i32;
        Ok(CurrentSense {
            shunts: self.shunts,
            code_shift,
            zeros: [zero; 3],
            clarke: AlphaBeta {
                alpha: rounded(clarke.alpha),
                beta: rounded(clarke.beta),
            },
            amperes: rounded([a, b, c]),
            scale: CurrentScale { fraction },
        })
    }

    pub(super) const fn bus_sense(&self) -> Result<BusSense, Misfit> {
        attempt!(within(
            "bus full scale",
            "V",
            self.adc_counts as f64 * self.bus_volts_per_count,
            0.0,
            1024.0
        ));
        let bits = attempt!(quantise(
            "bus gain",
            "V/count",
            self.bus_volts_per_count,
            28
        ));
        Ok(BusSense {
            gain: TableVelocity::from_bits(bits),
        })
    }
}

const fn largest([a, b, c]: [f64; 3]) -> f64 {
    if a > b && a > c {
        a
    } else if b > c {
        b
    } else {
        c
    }
}

/// The vector of the phases' currents, of codes by `a`, `b` and `c`.
const fn clarke(shunts: Shunts, [a, b, c]: [f64; 3]) -> AlphaBeta<[f64; 3]> {
    match shunts {
        Shunts::Two => AlphaBeta {
            alpha: [a * SQRT_2 * SQRT_3, 0.0, 0.0],
            beta: [a * SQRT_2, b * 2.0 * SQRT_2, 0.0],
        },
        Shunts::Three => AlphaBeta {
            alpha: [
                a * 2.0 * SQRT_2 / SQRT_3,
                -b * SQRT_2 / SQRT_3,
                -c * SQRT_2 / SQRT_3,
            ],
            beta: [0.0, b * SQRT_2, -c * SQRT_2],
        },
    }
}

impl BridgePlate {
    /// Codes to 2^-16 of the full compensation; the cast saturates where the current fades in within a count or two.
    #[allow(clippy::cast_possible_truncation)]
    const fn dead_time_slope(&self, amperes: i32, scale: CurrentScale) -> i32 {
        let ampere = power_of_two(scale.fraction);
        let slope = amperes as f64 / ampere * 65_536.0 / self.dead_time_fade_a;
        slope.clamp(-1_073_741_824.0, 1_073_741_824.0) as i32
    }

    /// Whole periods, rounded up; a low side that is closed for longer than a second is a mistake of units.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    pub(super) const fn bootstrap_periods(&self, sample_time: f64) -> Result<u32, Misfit> {
        attempt!(within(
            "time to charge the bootstrap capacitors",
            "s",
            self.bootstrap_s,
            -1e-9,
            1.0
        ));
        Ok((self.bootstrap_s / sample_time + 0.999) as u32)
    }
}
