//! Phases, the stator's frame, the rotor's frame: power-invariant.

/// Clarke of two phases whose third is minus their sum: alpha, beta.
pub fn clarke(a: f64, b: f64) -> (f64, f64) {
    (1.5_f64.sqrt() * a, (a + 2.0 * b) * 0.5_f64.sqrt())
}

/// Park, to the rotor's frame: d, q; `rotor` is (cos, sin) of the electrical angle.
pub fn park((alpha, beta): (f64, f64), (cos, sin): (f64, f64)) -> (f64, f64) {
    (alpha * cos + beta * sin, beta * cos - alpha * sin)
}
