//! Phase voltages -> timer compare values, by space-vector modulation.
//!
//! The common mode is shifted so that the highest and the lowest phase lie symmetrically, which uses the bus up to
//! a phase-to-phase voltage of the whole bus: a d/q vector of `bus / sqrt(2)` in the power-invariant frame. The
//! timer counts up and down; a phase's high side is on while the counter is below its compare value, so the low
//! sides are on around the counter's top, where the shunts are sampled. A minimum on-time of the low sides keeps
//! that window open: it bounds the compare value from above, and the voltage circle is made smaller to match.

use crate::format::{CountsPerVolt, Current, Ratio, Voltage, narrow, narrow_bits};

/// Configuration of the modulator of one bridge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModulationConfig {
    /// Counter's top: a compare value of `period` is always on, 0 never.
    pub period: u16,
    /// Largest compare value that leaves the low sides their minimum on-time.
    pub compare_max: u16,
    /// `period` divided by the volts of one ADC count of the bus, in 2^-8: turns a bus count into counts per volt.
    pub period_per_bus_count: u32,
    /// Bus counts below this are taken as this: the division's floor.
    pub bus_counts_min: u16,
    /// Radius of the voltage circle as a part of the bus: `(1 - min_on / T) / sqrt(2)`.
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
    fn full(&self, bus: Voltage) -> Voltage {
        narrow(bus.wide_mul(self.bus_part))
    }

    fn compensation(&self, current: Current, full: Voltage) -> Voltage {
        let part: Ratio = narrow_bits(
            i64::from(current.to_bits()).saturating_mul(i64::from(self.slope.to_bits())),
            14,
        );
        narrow(full.wide_mul(part.clamp(Ratio::NEG_ONE, Ratio::ONE)))
    }
}

impl ModulationConfig {
    /// The longest d/q vector that can be realised without touching a limit, at bus voltage `bus`.
    #[must_use]
    pub fn v_max(&self, bus: Voltage) -> Voltage {
        // The compensation lifts the two outer phases apart by twice its voltage: sqrt(2) of it in the d/q frame,
        // and 2 is safe.
        let reserve = self.dead_time.full(bus);
        let circle: Voltage = narrow(bus.wide_mul(self.circle));
        circle
            .saturating_sub(reserve)
            .saturating_sub(reserve)
            .max(Voltage::ZERO)
    }

    /// Compare values of phases a, b, c for the phase voltages `v`, with the phase currents' signs for the dead
    /// time, on the bus of `bus` V measured as `bus_counts`.
    #[must_use]
    pub fn compare(
        &self,
        v: [Voltage; 3],
        currents: [Current; 3],
        bus: Voltage,
        bus_counts: u16,
    ) -> [u16; 3] {
        let full = self.dead_time.full(bus);
        let ([va, vb, vc], [ia, ib, ic]) = (v, currents);
        let a = va.saturating_add(self.dead_time.compensation(ia, full));
        let b = vb.saturating_add(self.dead_time.compensation(ib, full));
        let c = vc.saturating_add(self.dead_time.compensation(ic, full));

        let middle = half(a.max(b).max(c)).saturating_add(half(a.min(b).min(c)));
        let scale = self.counts_per_volt(bus_counts);
        [a, b, c].map(|phase| self.counts(phase.saturating_sub(middle), scale))
    }

    fn counts(&self, v: Voltage, scale: CountsPerVolt) -> u16 {
        // Half a count of rounding, then the middle of the permitted range: voltage zero.
        let product = i64::from(v.to_bits()).saturating_mul(i64::from(scale.to_bits()));
        let counts: fixed::FixedI32<fixed::types::extra::U8> = narrow_bits(product, 29);
        let centred = counts
            .saturating_add(fixed::FixedI32::from_bits(i32::from(self.compare_max) << 7))
            .saturating_add(fixed::FixedI32::from_bits(128));
        let compare = (centred.to_bits() >> 8).clamp(0, i32::from(self.compare_max));
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let compare = compare as u16;
        compare
    }

    /// Timer counts per volt: the bus voltage compensation. One 32-bit division.
    fn counts_per_volt(&self, bus_counts: u16) -> CountsPerVolt {
        let counts = u32::from(bus_counts.max(self.bus_counts_min).max(1));
        let reciprocal = u32::MAX.checked_div(counts).unwrap_or(u32::MAX);
        let wide = u64::from(reciprocal).saturating_mul(u64::from(self.period_per_bus_count));
        narrow_bits((wide >> 1).cast_signed(), 23)
    }
}

fn half(v: Voltage) -> Voltage {
    Voltage::from_bits(v.to_bits() >> 1)
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
            let compare = config.compare(volts.map(Voltage::from_num), [Current::ZERO; 3], bus, counts);
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
            let compare = config.compare([Voltage::ZERO; 3], amps, volts, 3000);
            let lsb = volts.to_num::<f64>() / f64::from(config.period);
            let lost = volts.to_num::<f64>() * 1e-6 / 50e-6;
            let part = (i / test_plate().board.dead_time_fade_a).clamp(-1.0, 1.0);
            let realised = (f64::from(compare[0]) - f64::from(compare[1])) * lsb;
            prop_assert!((realised - 2.0 * lost * part).abs() < 1.1 * lsb + 1e-3);
        }

        #[test]
        fn any_input_gives_a_compare_within_the_range(
            v in any::<[i32; 3]>(), i in any::<[i32; 3]>(), volts in any::<i32>(), counts in any::<u16>(),
        ) {
            let config = config(1e-6, 1e-6);
            let compare = config.compare(
                v.map(Voltage::from_bits), i.map(Current::from_bits), Voltage::from_bits(volts), counts);
            prop_assert!(compare.iter().all(|&c| c <= config.compare_max));
            prop_assert!(config.v_max(Voltage::from_bits(volts)) >= 0);
        }
    }
}
