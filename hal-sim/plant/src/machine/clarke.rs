//! Power-invariant Clarke transform: `x_a = sqrt(2/3) * x_alpha`.

const SQRT_2_3: f64 = 0.816_496_580_927_726;
const SQRT_1_2: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Three phases to alpha and beta; what they have in common drops out.
#[inline]
pub(super) fn clarke([a, b, c]: [f64; 3]) -> [f64; 2] {
    [SQRT_2_3 * (a - 0.5 * (b + c)), SQRT_1_2 * (b - c)]
}

/// Alpha and beta to three phases of sum 0.
#[inline]
pub(super) fn inverse_clarke([alpha, beta]: [f64; 2]) -> [f64; 3] {
    let a = SQRT_2_3 * alpha;
    let half = SQRT_1_2 * beta;
    [a, half - 0.5 * a, -half - 0.5 * a]
}
