//! White noise of a signal, beside what moves slowly.

/// Standard deviation of a signal's white noise by its fourth differences, which what moves slowly has not.
pub(crate) fn white_noise(values: &[f64]) -> f64 {
    let fourth = values
        .windows(5)
        .map(|x| x[0] - 4.0 * x[1] + 6.0 * x[2] - 4.0 * x[3] + x[4]);
    let square: f64 = fourth.map(|x| x * x).sum();
    (square / 70.0 / values.len().saturating_sub(4).max(1) as f64).sqrt()
}

/// The same, of what the 100 Hz filter leaves of it.
pub(crate) fn white_below_100(values: &[f64], rate: f64) -> f64 {
    white_noise(values) * (200.0 / rate).min(0.8).sqrt()
}
