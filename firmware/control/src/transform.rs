//! Clarke and Park, power invariant: torque is `p * flux * i_q` with no 3/2 (Eqs 5 and 6).

use crate::format::{
    Angle, Current, PhaseVoltage, Ratio, StatorCurrent, StatorVoltage, Unit, Voltage,
    multiply_upper,
};
use fixed::FixedI32;
use fixed::types::extra::LeEqU32;

const SQRT_3_2: Ratio = Ratio::lit("1.224744871391589");
const SQRT_2: Ratio = Ratio::lit("1.414213562373095");
const SQRT_2_3: Ratio = Ratio::lit("0.816496580927726");
const SQRT_1_2: Ratio = Ratio::lit("0.7071067811865475");
const SQRT_1_6: Ratio = Ratio::lit("0.408248290463863");

/// A two-phase vector in the stator's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AlphaBeta<T> {
    /// Along phase a.
    pub alpha: T,
    /// 90 electrical degrees ahead of phase a.
    pub beta: T,
}

/// A two-phase vector in the rotor's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DirectQuadrature<T> {
    /// Along the magnets' flux.
    pub d: T,
    /// 90 electrical degrees ahead of the flux: makes torque.
    pub q: T,
}

/// The cosine and sine of one electrical angle, taken once and used by both Park transforms of it.
#[derive(Clone, Copy, Debug)]
pub struct Rotation {
    cos: Unit,
    sin: Unit,
}

impl Rotation {
    /// The rotation by `theta_e`.
    #[must_use]
    pub fn new(theta_e: Angle) -> Self {
        let (cos, sin) = theta_e.cos_sin();
        Self { cos, sin }
    }

    /// Park: stator frame to rotor frame.
    #[must_use]
    #[inline(always)]
    pub fn park(self, x: AlphaBeta<StatorCurrent>) -> DirectQuadrature<Current> {
        let Self { cos, sin } = self;
        // The upper words are in 2^-17 A.
        DirectQuadrature {
            d: current(row(x.alpha, cos, x.beta, sin)),
            q: current(row_minus(x.beta, cos, x.alpha, sin)),
        }
    }

    /// Inverse Park: rotor frame to stator frame.
    #[must_use]
    #[inline(always)]
    pub fn inverse_park(self, x: DirectQuadrature<Voltage>) -> AlphaBeta<StatorVoltage> {
        let Self { cos, sin } = self;
        // The upper words are in 2^-20 V.
        AlphaBeta {
            alpha: StatorVoltage::from_bits(row_minus(x.d, cos, x.q, sin)),
            beta: StatorVoltage::from_bits(row(x.q, cos, x.d, sin)),
        }
    }
}

/// The upper words of `a*cos + b*sin`: one row of a rotation, in half of the last steps of `a`.
///
/// Cannot overflow: cosine and sine of one angle never have |cos| + |sin| above sqrt(2), so the sum of the upper words
/// of their products with 32-bit values stays below 1.42 * 2^30.
#[inline(always)]
#[allow(clippy::arithmetic_side_effects)]
fn row<F: LeEqU32>(a: FixedI32<F>, cos: Unit, b: FixedI32<F>, sin: Unit) -> i32 {
    upper(a, cos) + upper(b, sin)
}

/// The upper words of `a*cos - b*sin`, as [`row`].
#[inline(always)]
#[allow(clippy::arithmetic_side_effects)]
fn row_minus<F: LeEqU32>(a: FixedI32<F>, cos: Unit, b: FixedI32<F>, sin: Unit) -> i32 {
    upper(a, cos) - upper(b, sin)
}

/// The upper word of a product.
#[inline(always)]
fn upper<A: LeEqU32, B: LeEqU32>(a: FixedI32<A>, b: FixedI32<B>) -> i32 {
    multiply_upper(a.to_bits(), b.to_bits())
}

/// A current in 2^-17 A, saturated to its format.
#[inline(always)]
fn current(bits: i32) -> Current {
    const END: i32 = 1 << 28;
    Current::from_bits(bits.clamp(-END, END - 1) << 3)
}

/// Clarke from two measured phases, the third being minus their sum.
///
/// Cannot overflow: |a|, |b| <= 2048 A give at most 4345 A.
#[must_use]
#[inline(always)]
#[allow(clippy::arithmetic_side_effects)]
pub fn clarke_two(a: Current, b: Current) -> AlphaBeta<StatorCurrent> {
    AlphaBeta {
        alpha: StatorCurrent::from_bits(upper(a, SQRT_3_2)),
        beta: StatorCurrent::from_bits(upper(a, SQRT_1_2) + upper(b, SQRT_2)),
    }
}

/// Clarke from three measured phases; what is common to all three drops out.
///
/// Cannot overflow: three times 2048 A give at most 3345 A.
#[must_use]
#[inline(always)]
#[allow(clippy::arithmetic_side_effects)]
pub fn clarke_three(a: Current, b: Current, c: Current) -> AlphaBeta<StatorCurrent> {
    AlphaBeta {
        alpha: StatorCurrent::from_bits(
            upper(a, SQRT_2_3) - upper(b, SQRT_1_6) - upper(c, SQRT_1_6),
        ),
        beta: StatorCurrent::from_bits(upper(b, SQRT_1_2) - upper(c, SQRT_1_2)),
    }
}

/// Inverse Clarke: three phase voltages whose sum is zero, each within ±2294 V.
#[must_use]
#[inline(always)]
#[allow(clippy::arithmetic_side_effects)]
pub fn inverse_clarke(v: AlphaBeta<StatorVoltage>) -> [PhaseVoltage; 3] {
    // |v| <= 2048 V gives |a| <= 1673 V and |beta| <= 1449 V: |mean| + |beta| fits.
    let a = upper(v.alpha, SQRT_2_3);
    let beta = upper(v.beta, SQRT_1_2);
    let mean = -(a >> 1);
    [a, mean + beta, mean - beta].map(PhaseVoltage::from_bits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::Current;
    use proptest::prelude::*;

    fn amps(x: f64) -> Current {
        Current::saturating_from_num(x)
    }

    proptest! {
        #[test]
        fn clarke_agrees_with_its_matrix(a in -900.0..900.0f64, b in -900.0..900.0f64) {
            let expected = ((1.5f64).sqrt() * a, (a + 2.0 * b) / 2f64.sqrt());
            let two = clarke_two(amps(a), amps(b));
            prop_assert!((two.alpha.to_num::<f64>() - expected.0).abs() < 2e-5);
            prop_assert!((two.beta.to_num::<f64>() - expected.1).abs() < 2e-5);
            let (third, common) = (-a - b, 20.0);
            if third.abs() < 2000.0 {
                let three = clarke_three(amps(a + common), amps(b + common), amps(third + common));
                prop_assert!((three.alpha - two.alpha).abs() < 2e-5);
                prop_assert!((three.beta - two.beta).abs() < 2e-5);
            }
        }

        #[test]
        fn park_turns_back(alpha in -1400.0..1400.0f64, beta in -1400.0..1400.0f64, turn in any::<u32>()) {
            let (sin, cos) = (f64::from(turn) / 2f64.powi(32) * core::f64::consts::TAU).sin_cos();
            let rotation = Rotation::new(Angle(turn));
            let x = AlphaBeta { alpha: StatorCurrent::from_num(alpha), beta: StatorCurrent::from_num(beta) };
            let got = rotation.park(x);
            let exact = [alpha * cos + beta * sin, beta * cos - alpha * sin];
            // Cosine and sine are right to 2e-5, each, and the vector is up to 1980 A.
            prop_assert!((got.d.to_num::<f64>() - exact[0]).abs() < 0.06, "{got:?} for {exact:?}");
            prop_assert!((got.q.to_num::<f64>() - exact[1]).abs() < 0.06, "{got:?} for {exact:?}");
        }

        #[test]
        fn inverse_park_turns_forward(d in -1000.0..1000.0f64, q in -1000.0..1000.0f64, turn in any::<u32>()) {
            let (sin, cos) = (f64::from(turn) / 2f64.powi(32) * core::f64::consts::TAU).sin_cos();
            let x = DirectQuadrature { d: Voltage::from_num(d), q: Voltage::from_num(q) };
            let got = Rotation::new(Angle(turn)).inverse_park(x);
            let exact = [d * cos - q * sin, q * cos + d * sin];
            prop_assert!((got.alpha.to_num::<f64>() - exact[0]).abs() < 0.06, "{got:?} for {exact:?}");
            prop_assert!((got.beta.to_num::<f64>() - exact[1]).abs() < 0.06, "{got:?} for {exact:?}");
        }

        /// Debug builds panic where a sum would leave its format.
        #[test]
        fn no_end_overflows(
            x in prop::array::uniform3(prop_oneof![any::<i32>(), Just(i32::MIN), Just(i32::MAX)]),
            turn in prop_oneof![any::<u32>(), (0u32..8).prop_map(|k| k << 29)],
        ) {
            let [a, b, c] = x.map(Current::from_bits);
            let rotation = Rotation::new(Angle(turn));
            let _ = rotation.park(clarke_two(a, b));
            let _ = rotation.park(clarke_three(a, b, c));
            let [d, q, _] = x.map(Voltage::from_bits);
            let [_, alpha, beta] = x.map(StatorVoltage::from_bits);
            for v in [rotation.inverse_park(DirectQuadrature { d, q }), AlphaBeta { alpha, beta }] {
                let phases = inverse_clarke(v);
                let sum: f64 = phases.iter().map(|v| v.to_num::<f64>()).sum();
                prop_assert!(sum.abs() < 1e-5, "phase voltages sum to {sum}");
                prop_assert!(phases.iter().all(|v| v.abs() <= 2294));
            }
        }

        #[test]
        fn phases_are_the_vector(alpha in -1000.0..1000.0f64, beta in -1000.0..1000.0f64) {
            let phases = inverse_clarke(AlphaBeta {
                alpha: StatorVoltage::from_num(alpha),
                beta: StatorVoltage::from_num(beta),
            });
            for (k, v) in phases.into_iter().enumerate() {
                let (sin, cos) = (k as f64 * core::f64::consts::TAU / 3.0).sin_cos();
                let exact = (2f64 / 3.0).sqrt() * (alpha * cos + beta * sin);
                prop_assert!((v.to_num::<f64>() - exact).abs() < 2e-5);
            }
        }
    }
}
