//! The velocity ripple factor (Eq 19) and what velocity is made of.

use fft::Complex64;

/// Eq 19: peak to peak of the velocities over the reference velocity, %.
#[must_use]
pub fn vrf_percent(velocities: &[f64], reference: f64) -> f64 {
    let (low, high) = velocities
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| {
            (low.min(v), high.max(v))
        });
    100.0 * (high - low) / reference.abs()
}

/// Velocities from positions sampled every `interval_s`, each over `window` intervals: a mean over the window, which
/// is what makes a noisy scale's velocity readable.
#[must_use]
pub fn velocities(positions: &[f64], interval_s: f64, window: usize) -> Vec<f64> {
    let window = window.max(1);
    let span = interval_s * window as f64;
    positions
        .iter()
        .zip(positions.iter().skip(window))
        .map(|(a, b)| (b - a) / span)
        .collect()
}

/// Amplitude spectrum of `values` sampled at `rate_hz`: (frequency in Hz, amplitude in the values' unit), the mean
/// left out. Hann window, scaled so that a sine's line shows its amplitude.
#[must_use]
pub fn spectrum(values: &[f64], rate_hz: f64) -> Vec<(f64, f64)> {
    let n = values.len();
    if n < 2 {
        return Vec::new();
    }
    let mean = values.iter().sum::<f64>() / n as f64;
    let mut buffer: Vec<Complex64> = values
        .iter()
        .enumerate()
        .map(|(k, v)| {
            let hann = 0.5 - 0.5 * (std::f64::consts::TAU * k as f64 / n as f64).cos();
            Complex64::new((v - mean) * hann, 0.0)
        })
        .collect();
    fft::forward(&mut buffer);
    let scale = 4.0 / n as f64;
    (1..n / 2)
        .map(|k| (k as f64 * rate_hz / n as f64, buffer[k].norm() * scale))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ripple_is_peak_to_peak_over_the_reference() {
        assert!(
            (vrf_percent(&[2.4, 2.5, 2.75], -2.5) - 14.0).abs() < 1e-9,
            "measured {}, expected {} within {:e}",
            vrf_percent(&[2.4, 2.5, 2.75], -2.5),
            14.0,
            1e-9
        );
    }

    #[test]
    fn a_sine_shows_its_amplitude_and_frequency() {
        let values: Vec<f64> = (0..10_000)
            .map(|k| 7.0 + 0.3 * (std::f64::consts::TAU * 41.5 * k as f64 / 1e4).sin())
            .collect();
        let (hz, amplitude) = spectrum(&values, 1e4)
            .into_iter()
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap();
        assert!(
            (hz - 41.5).abs() <= 0.5 && (amplitude - 0.3).abs() < 0.05,
            "{hz} {amplitude}"
        );
    }

    #[test]
    fn velocities_are_means_over_the_window() {
        let positions: Vec<f64> = (0..10).map(|k| 1e-3 * f64::from(k)).collect();
        let v = velocities(&positions, 1e-3, 3);
        assert_eq!(v.len(), 7);
        assert!(
            v.iter().all(|v| (v - 1.0).abs() < 1e-12),
            "expected 1 within 1e-12 everywhere: {v:?}"
        );
    }
}
