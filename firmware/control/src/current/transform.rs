//! Park, power invariant: torque is `p * flux * i_q` with no 3/2 (Eqs 5 and 6). Clarke is part of what
//! [`sense`](crate::sense) and [`modulation`](crate::modulation) scale with.

use crate::base::format::{Angle, ScaledCurrent, StatorVoltage, Unit, Voltage, multiply_upper};

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

/// The cosine and sine of one electrical angle.
#[derive(Clone, Copy, Debug)]
pub struct Rotation {
    cos: Unit,
    sin: Unit,
}

impl Rotation {
    /// The rotation by `theta_e`.
    #[must_use]
    #[inline(always)]
    pub fn new(theta_e: Angle) -> Self {
        let (cos, sin) = theta_e.cos_sin();
        Self { cos, sin }
    }

    /// The same, for the second angle of a period: see [`Angle::second_cos_sin`].
    #[must_use]
    #[inline(always)]
    pub fn second(theta_e: Angle) -> Self {
        let (cos, sin) = theta_e.second_cos_sin();
        Self { cos, sin }
    }

    /// Park: stator frame to rotor frame. `x` is in half of a [`ScaledCurrent`]'s unit.
    #[must_use]
    #[inline(always)]
    pub fn park(self, x: AlphaBeta<i32>) -> DirectQuadrature<ScaledCurrent> {
        let Self { cos, sin } = self;
        DirectQuadrature {
            d: ScaledCurrent(row(x.alpha, cos, x.beta, sin)),
            q: ScaledCurrent(row_minus(x.beta, cos, x.alpha, sin)),
        }
    }

    /// Inverse Park: rotor frame to stator frame.
    #[must_use]
    #[inline(always)]
    pub fn inverse_park(self, x: DirectQuadrature<Voltage>) -> AlphaBeta<StatorVoltage> {
        let Self { cos, sin } = self;
        let (d, q) = (x.d.to_bits(), x.q.to_bits());
        // The upper words are in 2^-17 V.
        AlphaBeta {
            alpha: StatorVoltage::from_bits(row_minus(d, cos, q, sin)),
            beta: StatorVoltage::from_bits(row(q, cos, d, sin)),
        }
    }
}

/// The upper words of `a*cos + b*sin`: one row of a rotation, in twice the last steps of `a`.
///
/// Cannot overflow: cosine and sine of one angle never have |cos| + |sin| above sqrt(2), so the sum of the upper words
/// of their products with 32-bit values stays below 1.42 * 2^30.
#[inline(always)]
#[allow(clippy::arithmetic_side_effects)]
fn row(a: i32, cos: Unit, b: i32, sin: Unit) -> i32 {
    multiply_upper(a, cos.to_bits()) + multiply_upper(b, sin.to_bits())
}

/// The upper words of `a*cos - b*sin`, as [`row`].
#[inline(always)]
#[allow(clippy::arithmetic_side_effects)]
fn row_minus(a: i32, cos: Unit, b: i32, sin: Unit) -> i32 {
    multiply_upper(a, cos.to_bits()) - multiply_upper(b, sin.to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn park_turns_back(alpha in -1400.0..1400.0f64, beta in -1400.0..1400.0f64, turn in any::<u32>()) {
            let (sin, cos) = (f64::from(turn) / 2f64.powi(32) * core::f64::consts::TAU).sin_cos();
            let rotation = Rotation::new(Angle(turn));
            let bits = |x: f64| (x * 2f64.powi(18)) as i32;
            let got = rotation.park(AlphaBeta { alpha: bits(alpha), beta: bits(beta) });
            let exact = [alpha * cos + beta * sin, beta * cos - alpha * sin];
            let amps = |x: ScaledCurrent| f64::from(x.0) / 2f64.powi(17);
            // Cosine and sine are right to 1e-5, each, and the vector is up to 1980 A.
            prop_assert!((amps(got.d) - exact[0]).abs() < 0.03, "{got:?} for {exact:?}");
            prop_assert!((amps(got.q) - exact[1]).abs() < 0.03, "{got:?} for {exact:?}");
        }

        #[test]
        fn inverse_park_turns_forward(d in -1000.0..1000.0f64, q in -1000.0..1000.0f64, turn in any::<u32>()) {
            let (sin, cos) = (f64::from(turn) / 2f64.powi(32) * core::f64::consts::TAU).sin_cos();
            let x = DirectQuadrature { d: Voltage::from_num(d), q: Voltage::from_num(q) };
            let got = Rotation::new(Angle(turn)).inverse_park(x);
            let exact = [d * cos - q * sin, q * cos + d * sin];
            prop_assert!((got.alpha.to_num::<f64>() - exact[0]).abs() < 0.03, "{got:?} for {exact:?}");
            prop_assert!((got.beta.to_num::<f64>() - exact[1]).abs() < 0.03, "{got:?} for {exact:?}");
        }

        /// Debug builds panic where a sum would leave its format.
        #[test]
        fn no_end_overflows(
            x in prop::array::uniform2(prop_oneof![any::<i32>(), Just(i32::MIN), Just(i32::MAX)]),
            turn in prop_oneof![any::<u32>(), (0u32..8).prop_map(|k| k << 29)],
        ) {
            let [a, b] = x;
            let rotation = Rotation::new(Angle(turn));
            let _ = rotation.park(AlphaBeta { alpha: a, beta: b });
            let _ = rotation.inverse_park(DirectQuadrature { d: Voltage::from_bits(a), q: Voltage::from_bits(b) });
        }
    }
}
