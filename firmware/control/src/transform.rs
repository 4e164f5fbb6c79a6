//! Clarke and Park, power invariant: torque is `p * flux * i_q` with no 3/2 (Eqs 5 and 6).

use crate::format::{Angle, Ratio, Unit, Voltage, narrow_bits, rotate};
use fixed::FixedI32;
use fixed::types::extra::LeEqU32;

const SQRT_3_2: Ratio = Ratio::lit("1.224744871391589");
const SQRT_2_3: Ratio = Ratio::lit("0.816496580927726");
const SQRT_1_2: Ratio = Ratio::lit("0.7071067811865475");

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
    pub fn park<F: LeEqU32>(self, x: AlphaBeta<FixedI32<F>>) -> DirectQuadrature<FixedI32<F>> {
        let back = self.sin.saturating_neg();
        DirectQuadrature {
            d: rotate(x.alpha, self.cos, x.beta, self.sin),
            q: rotate(x.beta, self.cos, x.alpha, back),
        }
    }

    /// Inverse Park: rotor frame to stator frame.
    #[must_use]
    pub fn inverse_park<F: LeEqU32>(
        self,
        x: DirectQuadrature<FixedI32<F>>,
    ) -> AlphaBeta<FixedI32<F>> {
        let back = self.sin.saturating_neg();
        AlphaBeta {
            alpha: rotate(x.d, self.cos, x.q, back),
            beta: rotate(x.q, self.cos, x.d, self.sin),
        }
    }
}

/// Clarke from two measured phases, the third being minus their sum.
#[must_use]
pub fn clarke_two<F: LeEqU32>(a: FixedI32<F>, b: FixedI32<F>) -> AlphaBeta<FixedI32<F>> {
    AlphaBeta {
        alpha: scale(a, SQRT_3_2),
        beta: scale(a.saturating_add(b).saturating_add(b), SQRT_1_2),
    }
}

/// Clarke from three measured phases; what is common to all three drops out.
#[must_use]
pub fn clarke_three<F: LeEqU32>(
    a: FixedI32<F>,
    b: FixedI32<F>,
    c: FixedI32<F>,
) -> AlphaBeta<FixedI32<F>> {
    let mean_of_others = half(b).saturating_add(half(c));
    AlphaBeta {
        alpha: scale(a.saturating_sub(mean_of_others), SQRT_2_3),
        beta: scale(b.saturating_sub(c), SQRT_1_2),
    }
}

/// Inverse Clarke: three phase voltages whose sum is zero.
#[must_use]
pub fn inverse_clarke(v: AlphaBeta<Voltage>) -> [Voltage; 3] {
    let a = scale(v.alpha, SQRT_2_3);
    let beta = scale(v.beta, SQRT_1_2);
    let mean = half(a).saturating_neg();
    [a, mean.saturating_add(beta), mean.saturating_sub(beta)]
}

fn scale<F: LeEqU32>(x: FixedI32<F>, factor: Ratio) -> FixedI32<F> {
    // |x| <= 2^31 and |factor| < 2^31: the product fits 63 bits.
    narrow_bits(
        i64::from(x.to_bits()).saturating_mul(i64::from(factor.to_bits())),
        30,
    )
}

fn half<F: LeEqU32>(x: FixedI32<F>) -> FixedI32<F> {
    FixedI32::from_bits(x.to_bits() >> 1)
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
            prop_assert!((two.alpha.to_num::<f64>() - expected.0.clamp(-2048.0, 2048.0)).abs() < 1e-4);
            prop_assert!((two.beta.to_num::<f64>() - expected.1.clamp(-1450.0, 1450.0)).abs() < 1e-4
                || (a + 2.0 * b).abs() > 2047.0);
            let (third, common) = (-a - b, 20.0);
            if third.abs() < 2000.0 && (b - third).abs() < 2047.0 {
                let three = clarke_three(amps(a + common), amps(b + common), amps(third + common));
                prop_assert!((three.alpha - two.alpha).abs() < amps(1e-4));
                prop_assert!((three.beta - two.beta).abs() < amps(1e-4));
            }
        }

        #[test]
        fn park_and_back_is_the_vector(alpha in -900.0..900.0f64, beta in -900.0..900.0f64, turn in any::<u32>()) {
            let rotation = Rotation::new(Angle(turn));
            let back = rotation.inverse_park(rotation.park(AlphaBeta { alpha: amps(alpha), beta: amps(beta) }));
            prop_assert!((back.alpha.to_num::<f64>() - alpha).abs() < 0.05);
            prop_assert!((back.beta.to_num::<f64>() - beta).abs() < 0.05);
        }

        #[test]
        fn the_ends_saturate(a in any::<i32>(), b in any::<i32>(), c in any::<i32>(), turn in any::<u32>()) {
            let [a, b, c] = [a, b, c].map(Current::from_bits);
            let rotation = Rotation::new(Angle(turn));
            let _ = rotation.park(clarke_two(a, b));
            let dq = rotation.park(clarke_three(a, b, c));
            let _ = rotation.inverse_park(dq);
            let [va, vb, vc] = inverse_clarke(AlphaBeta {
                alpha: Voltage::from_bits(a.to_bits() / 2),
                beta: Voltage::from_bits(b.to_bits() / 2),
            });
            let sum = va.to_num::<f64>() + vb.to_num::<f64>() + vc.to_num::<f64>();
            prop_assert!(sum.abs() < 1e-5, "phase voltages sum to {}", sum);
        }
    }
}
