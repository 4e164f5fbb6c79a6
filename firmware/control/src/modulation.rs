//! Phase voltages -> timer compare values, by space-vector modulation.
//!
//! The common mode is shifted so that the highest and the lowest phase lie symmetrically, which uses the bus up to
//! a phase-to-phase voltage of the whole bus: a d/q vector of `bus / sqrt(2)` in the power-invariant frame. The
//! timer counts up and down; a phase's high side is on while the counter is below its compare value, so the low
//! sides are on around the counter's top, where the shunts are sampled. A minimum on-time of the low sides keeps
//! that window open: it bounds the compare value from above, and the voltage circle is made smaller to match.

use crate::format::{CountsPerVolt, Current, PhaseVoltage, Ratio, Voltage, multiply_upper};

/// Configuration of the modulator of one bridge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModulationConfig {
    /// Counter's top: a compare value of `period` is always on, 0 never.
    pub period: u16,
    /// Largest compare value that leaves the low sides their minimum on-time.
    pub compare_max: u16,
    /// `period` divided by the volts of one ADC count of the bus, times `2^(21 - counts_shift)`: divided by a bus count
    /// and shifted left by `counts_shift` it is [`CountsPerVolt`]. At least 2^31, so that the quotient has its bits.
    pub period_per_bus_count: u32,
    /// See `period_per_bus_count`.
    pub counts_shift: u32,
    /// Bus counts below this are taken as this: the division's floor, which keeps its result below 1024 counts per volt.
    pub bus_counts_min: u16,
    /// Radius of the voltage circle as a part of the bus, in [0, 1): `(1 - min_on / T) / sqrt(2)`, less twice the part
    /// that the dead time takes. The compensation lifts the two outer phases apart by twice its voltage: sqrt(2) of it in
    /// the d/q frame, and 2 is safe.
    pub circle: Ratio,
    /// Mean voltage that the dead time takes from a phase, against the sign of its current.
    pub dead_time: DeadTime,
}

/// Dead-time compensation: `v = v_full * clamp(i / i_full, -1, 1)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeadTime {
    /// Dead time divided by the PWM period: the part of the bus that a phase loses.
    pub bus_part: Ratio,
    /// 1 / `i_full`, 1/A: within `i_full` of zero a current's sign is noise and the voltage fades in.
    pub slope: crate::format::SpeedGain,
}

impl DeadTime {
    /// What is added to a phase with `current` on the bus of `bus` V: within ±1024 V.
    #[inline(always)]
    fn compensation(&self, current: Current, bus: Voltage) -> PhaseVoltage {
        // In 2^-19 V.
        let full = multiply_upper(bus.to_bits(), self.bus_part.to_bits());
        // Part of the full voltage in 2^-12, cut to ±1: a few millivolts of a phase.
        let part = multiply_upper(current.to_bits(), self.slope.to_bits()).clamp(-4096, 4095);
        PhaseVoltage::from_bits(multiply_upper(full, part << 19))
    }
}

impl ModulationConfig {
    /// The longest d/q vector that can be realised without touching a limit, at bus voltage `bus`.
    #[must_use]
    #[inline(always)]
    pub fn v_max(&self, bus: Voltage) -> Voltage {
        // A part below 1, so that a quarter of the voltage, which the upper word is, is below a quarter of the format.
        let quarter = multiply_upper(bus.to_bits().max(0), self.circle.to_bits());
        Voltage::from_bits(quarter << 2)
    }

    /// Compare values of phases a, b, c for the phase voltages `v`, each within ±2294 V as the inverse Clarke gives
    /// them, with the phase currents' signs for the dead time, on the bus of `bus` V measured as `bus_counts`.
    #[must_use]
    #[inline(always)]
    pub fn compare(
        &self,
        v: [PhaseVoltage; 3],
        currents: [Current; 3],
        bus: Voltage,
        bus_counts: u16,
    ) -> [u16; 3] {
        let ([va, vb, vc], [ia, ib, ic]) = (v, currents);
        // With the compensation within ±3318 V; the sum of two, and a phase less half of it, stay within ±6636 V of the
        // format's ±8192 V.
        #[allow(clippy::arithmetic_side_effects)]
        let phases = {
            let a = va + self.dead_time.compensation(ia, bus);
            let b = vb + self.dead_time.compensation(ib, bus);
            let c = vc + self.dead_time.compensation(ic, bus);
            let middle = (a.max(b).max(c) + a.min(b).min(c)).to_bits() >> 1;
            let middle = PhaseVoltage::from_bits(middle);
            [a - middle, b - middle, c - middle]
        };
        let scale = self.counts_per_volt(bus_counts);
        phases.map(|phase| self.counts(phase, scale))
    }

    #[inline(always)]
    fn counts(&self, v: PhaseVoltage, scale: CountsPerVolt) -> u16 {
        // In 2^-7 of a count: the middle of the permitted range, which is voltage zero, and half a count of rounding.
        // |v| < 2^31 and scale < 2^31 make the product at most 2^30; what is added is below 2^23.
        let product = multiply_upper(v.to_bits(), scale.to_bits());
        #[allow(clippy::arithmetic_side_effects)]
        let centred = product + ((i32::from(self.compare_max) << 6) + 64);
        let compare = (centred >> 7).max(0).min(i32::from(self.compare_max));
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let compare = compare as u16;
        compare
    }

    /// Timer counts per volt: the bus voltage compensation. One 32-bit division.
    #[inline(always)]
    fn counts_per_volt(&self, bus_counts: u16) -> CountsPerVolt {
        let counts = u32::from(bus_counts.max(self.bus_counts_min));
        let quotient = self.period_per_bus_count.checked_div(counts).unwrap_or(0);
        // Below 2^31: `bus_counts_min` is chosen so.
        #[allow(clippy::arithmetic_side_effects)]
        let bits = quotient << self.counts_shift;
        CountsPerVolt::from_bits(bits.cast_signed())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plate::test_plate;
    use proptest::prelude::*;

    fn config(dead_time_s: f64, min_on_s: f64) -> ModulationConfig {
        let mut plate = test_plate();
        plate.board.dead_time_s = dead_time_s;
        plate.board.min_on_time_s = min_on_s;
        plate.motors[0].current_loop(&plate).unwrap().modulation
    }

    fn bus(counts: u16) -> Voltage {
        let plate = test_plate();
        plate.motors[0]
            .current_loop(&plate)
            .unwrap()
            .bus
            .voltage(counts)
    }

    proptest! {
        #[test]
        fn phase_to_phase_voltages_are_realised(
            angle in 0.0..core::f64::consts::TAU, part in 0.0..1.0f64, counts in 800u16..4095, min_on in 0.0..3e-6f64,
        ) {
            let config = config(0.0, min_on);
            let bus = bus(counts);
            let length = config.v_max(bus).to_num::<f64>() * part * (2f64 / 3.0).sqrt();
            let volts = [0.0, 1.0, 2.0].map(|k| length * (angle - k * core::f64::consts::TAU / 3.0).cos());
            let compare = config.compare(volts.map(PhaseVoltage::from_num), [Current::ZERO; 3], bus, counts);
            let lsb = bus.to_num::<f64>() / f64::from(config.period);
            for (j, k) in [(0, 1), (1, 2), (2, 0)] {
                let realised = (f64::from(compare[j]) - f64::from(compare[k])) * lsb;
                prop_assert!((realised - (volts[j] - volts[k])).abs() < 1.1 * lsb, "{realised} for {}", volts[j] - volts[k]);
            }
            prop_assert!(compare.iter().all(|&c| c <= config.compare_max));
        }

        #[test]
        fn dead_time_is_added_with_the_current(i in -5.0..5.0f64) {
            let config = config(1e-6, 0.0);
            let volts = bus(3000);
            let amps = [i, -i, 0.0].map(Current::from_num);
            let compare = config.compare([PhaseVoltage::ZERO; 3], amps, volts, 3000);
            let lsb = volts.to_num::<f64>() / f64::from(config.period);
            let lost = volts.to_num::<f64>() * 1e-6 / 50e-6;
            let part = (i / test_plate().board.dead_time_fade_a).clamp(-1.0, 1.0);
            let realised = (f64::from(compare[0]) - f64::from(compare[1])) * lsb;
            prop_assert!((realised - 2.0 * lost * part).abs() < 1.1 * lsb + 1e-3);
        }

        #[test]
        fn any_input_gives_a_compare_within_the_range(
            v in prop::array::uniform3(prop_oneof![-2294..=2294i32, Just(-2294), Just(2294)]), i in any::<[i32; 3]>(), volts in any::<i32>(), counts in any::<u16>(),
        ) {
            let config = config(1e-6, 1e-6);
            let compare = config.compare(
                v.map(PhaseVoltage::from_num), i.map(Current::from_bits), Voltage::from_bits(volts), counts);
            prop_assert!(compare.iter().all(|&c| c <= config.compare_max));
            prop_assert!(config.v_max(Voltage::from_bits(volts)) >= 0);
            prop_assert!(config.counts_per_volt(counts) > 0);
        }
    }
}
