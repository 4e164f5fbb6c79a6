//! PI in d and q, with feed-forward, a voltage circle that serves d first, and integrators that follow the voltage
//! that was realised.

use crate::format::{
    Current, Flux, Impedance, Inductance, Speed, Voltage, VoltageState, cut, cut_upper,
    multiply_upper, narrow, square_root,
};
use crate::transform::DirectQuadrature;
use fixed::FixedI32;
use fixed::types::extra::LeEqU32;

/// Gains of a current regulator and the motor constants of its feed-forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegulatorConfig {
    /// Eq 9, V/A.
    pub k_pc: Impedance,
    /// Eq 10 times the sample time, V/A per sample.
    pub k_ic_step: Impedance,
    /// Stator inductance, H: the cross-coupling `omega_e * L` of Eqs 1 and 2.
    pub inductance: Inductance,
    /// Magnet flux, Wb, below 64: the back-EMF `omega_e * flux` of Eq 2.
    pub flux: Flux,
}

/// State of a current regulator.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Regulator {
    integral: DirectQuadrature<VoltageState>,
}

/// What a regulator asks of the bridge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RegulatorOutput {
    /// Voltage within the circle.
    pub voltage: DirectQuadrature<Voltage>,
    /// The circle cut it.
    pub limited: bool,
}

impl Regulator {
    /// A regulator with empty integrators.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            integral: DirectQuadrature {
                d: VoltageState::ZERO,
                q: VoltageState::ZERO,
            },
        }
    }

    /// One step: currents and their references at electrical speed `omega_e` -> voltages of at most `v_max`.
    #[inline(always)]
    pub fn step(
        &mut self,
        config: &RegulatorConfig,
        reference: DirectQuadrature<Current>,
        current: DirectQuadrature<Current>,
        omega_e: Speed,
        v_max: Voltage,
    ) -> RegulatorOutput {
        let error = DirectQuadrature {
            d: reference.d.saturating_sub(current.d),
            q: reference.q.saturating_sub(current.q),
        };
        // The flux linkages of Eqs 1 and 2; times the speed they are what the axes induce in each other.
        let linkage = DirectQuadrature {
            d: inductive(config.inductance, current.d).saturating_add(config.flux),
            q: inductive(config.inductance, current.q),
        };
        // All products have the fraction bits of the integrators, so that they are summed in full width and narrowed
        // once: |k_pc * error| <= 2^62, |omega_e * linkage| <= 2^31 * 1.5 * 2^30, a held state is within 2^50.
        #[allow(clippy::arithmetic_side_effects)]
        let wanted = DirectQuadrature {
            d: narrow(self.integral.d + wide(config.k_pc, error.d) - wide(omega_e, linkage.q)),
            q: narrow(self.integral.q + wide(config.k_pc, error.q) + wide(omega_e, linkage.d)),
        };
        self.integral = DirectQuadrature {
            d: integrate(self.integral.d, config.k_ic_step, error.d),
            q: integrate(self.integral.q, config.k_ic_step, error.q),
        };
        if within(wanted, v_max) {
            return RegulatorOutput {
                voltage: wanted,
                limited: false,
            };
        }
        RegulatorOutput {
            voltage: self.follow_limit(wanted, v_max),
            limited: true,
        }
    }

    /// What the circle leaves of `wanted`. What it takes is taken from the integrators too: proportional part plus
    /// integral is then the voltage that was realised, so that nothing is left to unwind.
    #[cold]
    #[inline(never)]
    fn follow_limit(
        &mut self,
        wanted: DirectQuadrature<Voltage>,
        v_max: Voltage,
    ) -> DirectQuadrature<Voltage> {
        let realised = limit(wanted, v_max);
        let follow = |integral: VoltageState, realised, wanted| {
            // A held state is within 2^50 and what was cut within 2^51: the sum fits.
            #[allow(clippy::arithmetic_side_effects)]
            let sum = integral + (VoltageState::from(realised) - VoltageState::from(wanted));
            hold(sum)
        };
        self.integral = DirectQuadrature {
            d: follow(self.integral.d, realised.d, wanted.d),
            q: follow(self.integral.q, realised.q, wanted.q),
        };
        realised
    }
}

/// `inductance * current`, cut to ±32 Wb.
#[inline(always)]
fn inductive(inductance: Inductance, current: Current) -> Flux {
    // In 2^-22 Wb.
    const END: i32 = 1 << 27;
    let flux = multiply_upper(inductance.0, current.to_bits()).clamp(-END, END - 1);
    Flux::from_bits(flux << 2)
}

/// A product with the fraction bits of an integrator.
#[inline(always)]
fn wide<A: LeEqU32, B: LeEqU32>(a: FixedI32<A>, b: FixedI32<B>) -> VoltageState {
    const { assert!(A::U32 + B::U32 == 40) };
    VoltageState::from_bits(i64::from(a.to_bits()).wrapping_mul(i64::from(b.to_bits())))
}

/// Adds this sample's error.
#[inline(always)]
fn integrate(state: VoltageState, k_i: Impedance, error: Current) -> VoltageState {
    // A held state is within 2^50 and a product within 2^62: the sum fits.
    #[allow(clippy::arithmetic_side_effects)]
    let sum = state + wide(k_i, error);
    hold(sum)
}

/// Holds a state to the format of a voltage, ±1024 V: where a sum left it, the circle's cut is not all there is.
#[inline(always)]
fn hold(state: VoltageState) -> VoltageState {
    // ±1024 V is 2^50: 18 bits of the upper word.
    VoltageState::from_bits(cut_upper(state.to_bits(), 18))
}

/// A voltage lies within the circle of radius `v_max`, which is not negative, to 2 uV.
#[inline(always)]
fn within(v: DirectQuadrature<Voltage>, v_max: Voltage) -> bool {
    // In 2^-19 V. Not only do the squares fit more easily: the compiler would pass the 64-bit forms of whole voltages on
    // to the inverse Park, which then multiplies them in 64 bits.
    let quarter = |v: Voltage| square(Voltage::from_bits(v.to_bits() >> 2));
    // Each square is at most 2^58, so their sum fits.
    quarter(v.d).wrapping_add(quarter(v.q)) <= quarter(v_max)
}

/// Cuts a voltage to the circle of radius `v_max`, d first: it may have all of it, q gets what the circle leaves.
#[must_use]
pub fn limit(wanted: DirectQuadrature<Voltage>, v_max: Voltage) -> DirectQuadrature<Voltage> {
    let v_max = v_max.max(Voltage::ZERO);
    let room = square(v_max);
    let d = cut(wanted.d, v_max);
    // The root of a number below 2^62 is below 2^31.
    let q_max = Voltage::from_bits(square_root(room.saturating_sub(square(d))).cast_signed());
    let q = cut(wanted.q, q_max);
    DirectQuadrature { d, q }
}

#[allow(clippy::cast_sign_loss)]
fn square(v: Voltage) -> u64 {
    let bits = i64::from(v.to_bits());
    bits.wrapping_mul(bits) as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plate::test_plate;
    use proptest::prelude::*;

    fn config() -> RegulatorConfig {
        let plate = test_plate();
        plate.motors[0].current_loop(&plate).unwrap().regulator
    }

    /// The same law in f64. The inputs below keep every sum within the formats, so that saturation is no part of it.
    fn reference_step(
        state: &mut [f64; 2],
        config: &RegulatorConfig,
        (r, i): ([f64; 2], [f64; 2]),
        omega: f64,
        v_max: f64,
    ) -> [f64; 2] {
        let (kp, ki) = (
            config.k_pc.to_num::<f64>(),
            config.k_ic_step.to_num::<f64>(),
        );
        let (l, psi) = (
            f64::from(config.inductance.0) / 2f64.powi(34),
            config.flux.to_num::<f64>(),
        );
        let e = [r[0] - i[0], r[1] - i[1]];
        let wanted = [
            kp * e[0] + state[0] - omega * l * i[1],
            kp * e[1] + state[1] + omega * l * i[0] + omega * psi,
        ];
        let d = wanted[0].clamp(-v_max, v_max);
        let q_max = (v_max * v_max - d * d).max(0.0).sqrt();
        let v = [d, wanted[1].clamp(-q_max, q_max)];
        for k in 0..2 {
            state[k] += ki * e[k] + v[k] - wanted[k];
        }
        v
    }

    proptest! {
        #[test]
        fn agrees_with_the_law_in_floats(
            samples in prop::collection::vec(
                ([-5.0..5.0f64, -5.0..5.0f64], [-5.0..5.0f64, -5.0..5.0f64]), 1..60),
            omega in -3000.0..3000.0f64,
            v_max in 1.0..400.0f64,
        ) {
            let config = config();
            let mut regulator = Regulator::default();
            let mut state = [0.0; 2];
            let pair = |x: [f64; 2]| DirectQuadrature { d: Current::from_num(x[0]), q: Current::from_num(x[1]) };
            for (r, i) in samples {
                let out = regulator.step(&config, pair(r), pair(i), Speed::from_num(omega), Voltage::from_num(v_max));
                let exact = reference_step(&mut state, &config, (r, i), omega, v_max);
                prop_assert!((out.voltage.d.to_num::<f64>() - exact[0]).abs() < 0.02);
                // Where d takes all of the circle, the leg left for q is the root of a difference of nearly
                // equal squares: there only the circle itself can be compared.
                if exact[0].abs() < 0.99 * v_max {
                    prop_assert!((out.voltage.q.to_num::<f64>() - exact[1]).abs() < 0.02);
                }
                state = [regulator.integral.d.to_num(), regulator.integral.q.to_num()];
            }
        }

        #[test]
        fn never_leaves_the_circle_nor_winds_up(
            bits in prop::collection::vec(any::<[i32; 5]>(), 1..50),
            v_max in 0..i32::MAX,
            gains in any::<[i32; 3]>(),
            flux in -64..=64i32,
        ) {
            // Any gains, so that the ends of every sum are driven.
            let config = RegulatorConfig {
                k_pc: Impedance::from_bits(gains[0]),
                k_ic_step: Impedance::from_bits(gains[1]),
                inductance: Inductance(gains[2]),
                flux: Flux::from_num(flux),
            };
            let mut regulator = Regulator::default();
            let v_max = Voltage::from_bits(v_max);
            for [rd, rq, id, iq, omega] in bits {
                let [rd, rq, id, iq] = [rd, rq, id, iq].map(Current::from_bits);
                let out = regulator.step(
                    &config,
                    DirectQuadrature { d: rd, q: rq },
                    DirectQuadrature { d: id, q: iq },
                    Speed::from_bits(omega),
                    v_max,
                );
                let (d, q) = (out.voltage.d.to_num::<f64>(), out.voltage.q.to_num::<f64>());
                prop_assert!(d.hypot(q) <= v_max.to_num::<f64>() * (1.0 + 1e-9) + 3e-6);
                for integral in [regulator.integral.d, regulator.integral.q] {
                    prop_assert!(integral.abs() <= VoltageState::from_num(1024));
                }
            }
        }

        #[test]
        fn recovers_at_once_from_saturation(push in 20.0..200.0f64) {
            let config = config();
            let mut regulator = Regulator::default();
            let at = |q: f64| DirectQuadrature { d: Current::ZERO, q: Current::from_num(q) };
            for _ in 0..10_000 {
                regulator.step(&config, at(push), at(0.0), Speed::ZERO, Voltage::from_num(50));
            }
            // One sample after the error turns round, so does the voltage: nothing had been wound up.
            regulator.step(&config, at(-10.0), at(0.0), Speed::ZERO, Voltage::from_num(50));
            let out = regulator.step(&config, at(-10.0), at(0.0), Speed::ZERO, Voltage::from_num(50));
            prop_assert!(out.voltage.q < 0);
        }
    }
}
