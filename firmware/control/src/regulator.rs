//! PI in d and q, with feed-forward, a voltage circle that serves d first, and integrators that follow the voltage
//! that was realised.

use crate::format::{Current, Impedance, Ratio, Speed, Voltage, VoltageState, narrow, square_root};
use crate::transform::DirectQuadrature;

/// Gains of a current regulator and the motor constants of its feed-forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegulatorConfig {
    /// Eq 9, V/A.
    pub k_pc: Impedance,
    /// Eq 10 times the sample time, V/A per sample.
    pub k_ic_step: Impedance,
    /// Stator inductance, H: the cross-coupling `omega_e * L` of Eqs 1 and 2.
    pub inductance: Ratio,
    /// Magnet flux, Wb: the back-EMF `omega_e * flux` of Eq 2.
    pub flux: Ratio,
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
        let reactance: Impedance = narrow(omega_e.wide_mul(config.inductance));
        let coupled_d: Voltage = narrow(reactance.wide_mul(current.q));
        let coupled_q: Voltage = narrow(reactance.wide_mul(current.d));
        let back_emf: Voltage = narrow(omega_e.wide_mul(config.flux));

        let wanted = DirectQuadrature {
            d: pi(config.k_pc, error.d, self.integral.d).saturating_sub(coupled_d),
            q: pi(config.k_pc, error.q, self.integral.q)
                .saturating_add(coupled_q)
                .saturating_add(back_emf),
        };
        let voltage = limit(wanted, v_max);
        self.integral = DirectQuadrature {
            d: integrate(
                self.integral.d,
                config.k_ic_step,
                error.d,
                wanted.d,
                voltage.d,
            ),
            q: integrate(
                self.integral.q,
                config.k_ic_step,
                error.q,
                wanted.q,
                voltage.q,
            ),
        };
        RegulatorOutput {
            voltage,
            limited: voltage != wanted,
        }
    }
}

fn pi(k_p: Impedance, error: Current, integral: VoltageState) -> Voltage {
    let proportional: Voltage = narrow(k_p.wide_mul(error));
    proportional.saturating_add(narrow(integral))
}

/// Adds this sample's error and takes away what the limit took: after a cut, proportional part plus integral is the
/// voltage that was realised, so that nothing is left to unwind.
fn integrate(
    state: VoltageState,
    k_i: Impedance,
    error: Current,
    wanted: Voltage,
    realised: Voltage,
) -> VoltageState {
    let cut = VoltageState::from(realised).saturating_sub(VoltageState::from(wanted));
    state
        .saturating_add(k_i.wide_mul(error))
        .saturating_add(cut)
}

/// Cuts a voltage to the circle of radius `v_max`, d first: it may have all of it, q gets what the circle leaves.
#[must_use]
pub fn limit(wanted: DirectQuadrature<Voltage>, v_max: Voltage) -> DirectQuadrature<Voltage> {
    let v_max = v_max.max(Voltage::ZERO);
    let room = square(v_max);
    // Each square is at most 2^62, so their sum fits.
    if square(wanted.d).saturating_add(square(wanted.q)) <= room {
        return wanted;
    }
    let d = wanted.d.clamp(v_max.saturating_neg(), v_max);
    // The root of a number below 2^62 is below 2^31.
    let q_max = Voltage::from_bits(square_root(room.saturating_sub(square(d))).cast_signed());
    DirectQuadrature {
        d,
        q: wanted.q.clamp(q_max.saturating_neg(), q_max),
    }
}

fn square(v: Voltage) -> u64 {
    let bits = u64::from(v.to_bits().unsigned_abs());
    bits.saturating_mul(bits)
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
            config.inductance.to_num::<f64>(),
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
        ) {
            let config = config();
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
                prop_assert!(d.hypot(q) <= v_max.to_num::<f64>() * (1.0 + 1e-9));
                // Each integrator stays within what its voltage, feed-forward and one sample's error can hold.
                prop_assert!(regulator.integral.d.abs() < VoltageState::from_num(100_000));
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
