//! The angle of a vector, in integers.

use crate::base::format::Angle;

/// Angle of the vector `(x, y)` to the first axis; 0 of no vector. Within 2e-5 turn (CORDIC in vectoring mode,
/// Volder 1959: each step turns by `atan(2^-k)`, of which sixteen are enough).
#[must_use]
#[allow(clippy::arithmetic_side_effects)]
pub(super) fn angle(x: i64, y: i64) -> Angle {
    /// `atan(2^-k)`, 2^-32 turn.
    const STEPS: [u32; 16] = [
        536_870_912,
        316_933_406,
        167_458_907,
        85_004_756,
        42_667_331,
        21_354_465,
        10_679_838,
        5_340_245,
        2_670_163,
        1_335_087,
        667_544,
        333_772,
        166_886,
        83_443,
        41_722,
        20_861,
    ];
    // To 40 bits, so that the sums below have room and small vectors keep their direction.
    let size = x.unsigned_abs().max(y.unsigned_abs());
    if size == 0 {
        return Angle(0);
    }
    let zeros = size.leading_zeros();
    let fit = |v: i64| {
        if zeros >= 24 {
            v << (zeros - 24)
        } else {
            v >> (24 - zeros)
        }
    };
    let (mut x, mut y) = (fit(x), fit(y));
    let mut angle = 0u32;
    if x < 0 {
        (x, y, angle) = (-x, -y, 1 << 31);
    }
    for (k, step) in STEPS.into_iter().enumerate() {
        // The vector grows by 1.65 in all: 41 bits.
        let (dx, dy) = (y >> k, x >> k);
        if y > 0 {
            (x, y, angle) = (x + dx, y - dy, angle.wrapping_add(step));
        } else {
            (x, y, angle) = (x - dx, y + dy, angle.wrapping_sub(step));
        }
    }
    Angle(angle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn an_angle_is_that_of_its_vector(turns in 0.0..1.0f64, length in 100.0..9e18f64) {
            let (sin, cos) = (turns * core::f64::consts::TAU).sin_cos();
            let got = angle((length * cos) as i64, (length * sin) as i64);
            let off = got.minus(Angle::from_turns(turns)).unsigned_abs();
            prop_assert!(f64::from(off) < (2e-5 + 1.0 / length) * 2f64.powi(32), "{off}");
        }

        #[test]
        fn no_vector_overflows(x in any::<i64>(), y in any::<i64>()) {
            let _ = angle(x, y);
        }
    }
}
