//! PI in d and q, with feed-forward, a voltage circle that serves d first, and integrators that follow the voltage
//! that was realised.

use crate::base::format::{
    Gain, ScaledCurrent, Voltage, cut, multiply_upper, shift_up, square_root,
};
use crate::current::transform::DirectQuadrature;

/// Gains of a current regulator and the motor constants of its feed-forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegulatorConfig {
    /// Eq 9: [`ScaledCurrent`] to [`Voltage`].
    pub k_pc: Gain,
    /// Eq 10 times the sample time: [`ScaledCurrent`] to [`Voltage`] per sample.
    pub k_ic_step: Gain,
    /// What the axes induce in each other (Eqs 1 and 2).
    pub induced: Induced,
}

impl RegulatorConfig {
    /// What both gains make of a current error: each within ±2^30.
    #[inline(always)]
    fn parts(&self, error: DirectQuadrature<i32>) -> [DirectQuadrature<i32>; 2] {
        // All four products before a branch: after it the compiler would no longer know that the errors are 32 bits.
        let (k_p, k_i) = (self.k_pc, self.k_ic_step);
        let (p_d, p_q) = (k_p.product(error.d), k_p.product(error.q));
        let (i_d, i_q) = (k_i.product(error.d), k_i.product(error.q));
        if k_p.shift | k_i.shift == 0 {
            return [
                DirectQuadrature { d: p_d, q: p_q },
                DirectQuadrature { d: i_d, q: i_q },
            ];
        }
        let parts = |gain: Gain, d, q| {
            let (d, q) = Gain::shifted_seldom(gain.shift, d, q);
            DirectQuadrature { d, q }
        };
        [parts(k_p, p_d, p_q), parts(k_i, i_d, i_q)]
    }
}

/// The induced voltage `omega_e * linkage` with the flux linkages `L*i_d + flux` and `L*i_q` of Eqs 1 and 2.
///
/// A linkage is in such a unit that the upper word of its product with the electrical angle of a sample, 2^-32 turn, is in
/// 2^shift of a [`Voltage`]'s steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Induced {
    /// [`ScaledCurrent`] to linkage, at most 2^30.
    pub inductance: i32,
    /// Linkage of the magnets, at most 2^29.
    pub flux: i32,
    /// See above; 0 to 16.
    pub shift: u32,
}

impl Induced {
    /// What the q current induces in d, and the d current and the magnets in q, each cut to ±2048 V, while the rotor turns
    /// by `theta_e_step` a sample, a quarter turn at most.
    #[inline(always)]
    pub(crate) fn voltage(
        &self,
        current: DirectQuadrature<ScaledCurrent>,
        theta_e_step: i32,
    ) -> DirectQuadrature<i32> {
        let inductive = |current: ScaledCurrent| multiply_upper(self.inductance, current.0);
        // Each within 2^29.
        #[allow(clippy::arithmetic_side_effects)]
        let linkage = DirectQuadrature {
            d: inductive(current.d) + self.flux,
            q: inductive(current.q),
        };
        let volts = |linkage| shift_up(multiply_upper(theta_e_step, linkage), self.shift, 29);
        DirectQuadrature {
            d: volts(linkage.q),
            q: volts(linkage.d),
        }
    }

    /// What the magnets alone induce in q, cut to ±2048 V.
    #[inline(always)]
    pub(crate) fn back_emf(&self, theta_e_step: i32) -> i32 {
        shift_up(multiply_upper(theta_e_step, self.flux), self.shift, 29)
    }
}

/// The circle that a voltage must not leave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Circle {
    /// Its radius.
    pub radius: Voltage,
    /// The upper word of the square of half of it, 2^-2 V^2.
    pub square: u32,
}

/// State of a current regulator.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Regulator {
    integral: DirectQuadrature<Voltage>,
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
                d: Voltage::ZERO,
                q: Voltage::ZERO,
            },
        }
    }

    /// One step: currents and their reference, which are within half of their word, while the frame turns by
    /// `theta_e_step` a sample -> voltages in the circle. In the rotor's frame `i_d` is asked to be 0 (Eq 6).
    #[inline(always)]
    pub fn step(
        &mut self,
        config: &RegulatorConfig,
        reference: DirectQuadrature<ScaledCurrent>,
        current: DirectQuadrature<ScaledCurrent>,
        theta_e_step: i32,
        circle: impl FnOnce() -> Circle,
    ) -> RegulatorOutput {
        let induced = config.induced.voltage(current, theta_e_step);
        // The currents are within 0.87 * 2^30 and the references within 2^30. Integral within 2^28, proportional part
        // within 2^30, induced within 2^29: their sums fit.
        #[allow(clippy::arithmetic_side_effects)]
        let wanted = {
            let (d, q) = (self.integral.d.to_bits(), self.integral.q.to_bits());
            let error = DirectQuadrature {
                d: reference.d.0 - current.d.0,
                q: reference.q.0 - current.q.0,
            };
            let [proportional, integral] = config.parts(error);
            self.integral = DirectQuadrature {
                d: hold(d + integral.d),
                q: hold(q + integral.q),
            };
            DirectQuadrature {
                d: d + proportional.d - induced.d,
                q: q + proportional.q + induced.q,
            }
        };
        let voltage = DirectQuadrature {
            d: Voltage::from_bits(wanted.d),
            q: Voltage::from_bits(wanted.q),
        };
        let circle = circle();
        if upper_square(voltage) <= circle.square {
            return RegulatorOutput {
                voltage,
                limited: false,
            };
        }
        RegulatorOutput {
            voltage: self.follow_limit(voltage, circle.radius),
            limited: true,
        }
    }

    /// What the circle leaves of `wanted`. What it takes is taken from the integrators too: proportional part plus
    /// integral is then the voltage that was realised, so that nothing is left to unwind.
    #[cold]
    #[inline(never)]
    #[cfg_attr(target_os = "none", allow(unsafe_code), unsafe(link_section = ".ccm"))]
    fn follow_limit(
        &mut self,
        wanted: DirectQuadrature<Voltage>,
        radius: Voltage,
    ) -> DirectQuadrature<Voltage> {
        let realised = limit(wanted, radius);
        let follow = |integral: Voltage, realised: Voltage, wanted: Voltage| {
            hold(
                integral
                    .saturating_add(realised.saturating_sub(wanted))
                    .to_bits(),
            )
        };
        self.integral = DirectQuadrature {
            d: follow(self.integral.d, realised.d, wanted.d),
            q: follow(self.integral.q, realised.q, wanted.q),
        };
        realised
    }
}

/// Holds an integral to ±1024 V: where a sum left it, the circle's cut is not all there is.
#[inline(always)]
fn hold(integral: i32) -> Voltage {
    const END: i32 = 1 << 28;
    Voltage::from_bits(integral.clamp(-END, END - 1))
}

/// The upper word of the square of half a voltage, 2^-2 V^2.
///
/// Not of the whole one: the compiler would then keep its 64-bit form for the inverse Park, which would multiply that.
#[inline(always)]
#[allow(clippy::arithmetic_side_effects)]
fn upper_square(v: DirectQuadrature<Voltage>) -> u32 {
    let square = |v: Voltage| multiply_upper(v.to_bits() >> 1, v.to_bits() >> 1).cast_unsigned();
    // Each at most 2^28.
    square(v.d) + square(v.q)
}

/// Cuts a voltage to the circle of radius `v_max`, d first: it may have all of it, q gets what the circle leaves.
#[must_use]
pub fn limit(wanted: DirectQuadrature<Voltage>, v_max: Voltage) -> DirectQuadrature<Voltage> {
    let v_max = v_max.max(Voltage::ZERO);
    let d = cut(wanted.d, v_max);
    // The root of a number below 2^62 is below 2^31.
    let room = square(v_max).saturating_sub(square(d));
    let q_max = Voltage::from_bits(square_root(room).cast_signed());
    let q = cut(wanted.q, q_max);
    DirectQuadrature { d, q }
}

fn square(v: Voltage) -> u64 {
    let bits = u64::from(v.to_bits().unsigned_abs());
    bits.wrapping_mul(bits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plate::test_plate;
    use proptest::prelude::*;
    use std::f64::consts::TAU;
    use std::sync::LazyLock;

    fn config() -> RegulatorConfig {
        let plate = test_plate();
        plate.motors[0].current_loop(&plate).unwrap().regulator
    }

    /// One ampere. A configuration takes 7 us, and the tests ask millions of times.
    fn ampere() -> f64 {
        static AMPERE: LazyLock<f64> = LazyLock::new(|| {
            let plate = test_plate();
            let scale = plate.motors[0].current_loop(&plate).unwrap().sense.scale;
            2f64.powi(scale.fraction as i32)
        });
        *AMPERE
    }

    fn amperes(d: f64, q: f64) -> DirectQuadrature<ScaledCurrent> {
        let scaled = |x: f64| ScaledCurrent((x * ampere()) as i32);
        DirectQuadrature {
            d: scaled(d),
            q: scaled(q),
        }
    }

    fn circle(radius: Voltage) -> Circle {
        let bits = u64::from(radius.to_bits().unsigned_abs());
        Circle {
            radius,
            square: ((bits * bits) >> 34) as u32,
        }
    }

    /// 2^-32 turn a sample at `omega` rad/s.
    fn step(omega: f64) -> i32 {
        (omega / TAU * test_plate().board.sample_time() * 2f64.powi(32)).round() as i32
    }

    /// The same law in f64, by the plate's own numbers. The inputs below keep every sum within the formats, so that
    /// saturation is no part of it.
    fn reference_step(
        state: &mut [f64; 2],
        (r, i): ([f64; 2], [f64; 2]),
        omega: f64,
        v_max: f64,
    ) -> [f64; 2] {
        let plate = test_plate();
        let gains = plate.motors[0].gains(&plate.tuning);
        let (kp, ki) = (gains.k_pc, gains.k_ic * plate.board.sample_time());
        let (l, psi) = (plate.motors[0].inductance_h, plate.motors[0].flux_wb);
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
            for (r, i) in samples {
                let out = regulator.step(
                    &config, amperes(r[0], r[1]), amperes(i[0], i[1]), step(omega), || circle(Voltage::from_num(v_max)));
                let exact = reference_step(&mut state, (r, i), omega, v_max);
                prop_assert!((out.voltage.d.to_num::<f64>() - exact[0]).abs() < 0.02);
                // Where d takes all of the circle, the leg left for q is the root of a difference of nearly
                // equal squares: there only the circle itself can be compared.
                if exact[0].abs() < 0.99 * v_max {
                    prop_assert!((out.voltage.q.to_num::<f64>() - exact[1]).abs() < 0.02, "{} {}", out.voltage.q, exact[1]);
                }
                state = [regulator.integral.d.to_num(), regulator.integral.q.to_num()];
            }
        }

        /// Debug builds panic where a sum would leave its format.
        #[test]
        fn never_leaves_the_circle_nor_winds_up(
            bits in prop::collection::vec(prop::array::uniform5(prop_oneof![any::<i32>(), Just(i32::MIN), Just(i32::MAX)]), 1..50),
            v_max in 0..i32::MAX,
            gains in prop::array::uniform2((any::<i32>(), 0..=16u32)),
            induced in (-(1 << 30)..=1 << 30i32, -(1 << 29)..=1 << 29i32, 0..=16u32),
        ) {
            // Any gains, so that the ends of every sum are driven.
            let [k_pc, k_ic_step] = gains.map(|(multiplier, shift)| Gain { multiplier, shift });
            let (inductance, flux, shift) = induced;
            let config = RegulatorConfig { k_pc, k_ic_step, induced: Induced { inductance, flux, shift } };
            let mut regulator = Regulator::default();
            let v_max = Voltage::from_bits(v_max);
            for [rd, rq, id, iq, theta_e_step] in bits {
                let [rd, rq, id, iq] = [rd, rq, id, iq].map(|x| ScaledCurrent(x >> 1));
                let out = regulator.step(
                    &config,
                    DirectQuadrature { d: rd, q: rq },
                    DirectQuadrature { d: id, q: iq },
                    theta_e_step >> 1,
                    || circle(v_max),
                );
                let (d, q) = (out.voltage.d.to_num::<f64>(), out.voltage.q.to_num::<f64>());
                let (length, radius) = (d.hypot(q), v_max.to_num::<f64>());
                prop_assert!(length * length <= radius * radius * (1.0 + 1e-9) + 0.6, "{length} V in {radius} V");
                for integral in [regulator.integral.d, regulator.integral.q] {
                    prop_assert!(integral.abs() <= 1024);
                }
            }
        }

        #[test]
        fn recovers_at_once_from_saturation(push in 20.0..30.0f64) {
            let config = config();
            let mut regulator = Regulator::default();
            let circle = circle(Voltage::from_num(50));
            let mut step = |q| regulator.step(&config, amperes(0.0, q), amperes(0.0, 0.0), 0, || circle);
            for _ in 0..1000 {
                step(push);
            }
            // One sample after the error turns round, so does the voltage: nothing had been wound up.
            step(-10.0);
            prop_assert!(step(-10.0).voltage.q < 0);
        }
    }
}
