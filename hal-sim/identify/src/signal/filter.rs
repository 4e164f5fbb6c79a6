//! The benchmark's zero-phase filters, by their magnitude over frequency.

use crate::signal::fourier::{curvature, inverse, smooth_length, transform};
use std::f64::consts::PI;

/// Rows that are mirrored at either end, so that the filters see no step there.
const MIRROR: usize = 400;

/// Tangent of half the digital frequency: what the bilinear transform makes of it.
fn warped(hz: f64, rate: f64) -> f64 {
    (PI * hz / rate).tan()
}

/// A zero-phase filter of a gain over frequency.
fn zero_phase(signal: &[f64], rate: f64, gain: impl Fn(f64) -> f64) -> Vec<f64> {
    let n = signal.len();
    if n < 2 {
        return signal.to_vec();
    }
    let mirror = MIRROR.min(n - 1);
    let behind = (smooth_length(n + 2 * mirror, 1) - n - mirror).min(n - 1);
    // Odd reflection keeps value and slope.
    let before = (1..=mirror).rev().map(|k| 2.0 * signal[0] - signal[k]);
    let after = (1..=behind).map(|k| 2.0 * signal[n - 1] - signal[n - 1 - k]);
    let mut long: Vec<f64> = before.chain(signal.iter().copied()).chain(after).collect();
    // The rest of a step from end to start is a ramp, which filters leave alone.
    let rows = long.len();
    let (start, slope) = (long[0], (long[rows - 1] - long[0]) / (rows - 1) as f64);
    long.iter_mut()
        .enumerate()
        .for_each(|(k, x)| *x -= start + slope * k as f64);
    let (forward, backward) = (transform(rows), inverse(rows));
    let mut spectrum = forward.make_output_vec();
    forward
        .process(&mut long, &mut spectrum)
        .expect("lengths of the plan");
    for (bin, value) in spectrum.iter_mut().enumerate() {
        *value *= gain(bin as f64 * rate / rows as f64) / rows as f64;
    }
    backward
        .process(&mut spectrum, &mut long)
        .expect("lengths of the plan");
    (0..n)
        .map(|k| long[mirror + k] + start + slope * (mirror + k) as f64)
        .collect()
}

/// Second derivative, per second squared, exact up to half the rate: the second difference over its own gain.
pub(crate) fn second_derivative(signal: &[f64], rate: f64) -> Vec<f64> {
    zero_phase(&curvature(signal, rate), rate, |hz| {
        let half = PI * hz / rate;
        match half > 0.0 {
            true => (half / half.sin()).powi(2),
            false => 1.0,
        }
    })
}

/// Butterworth low-pass of order 4 at 100 Hz, forth and back.
pub(crate) fn butterworth_100(signal: &[f64], rate: f64) -> Vec<f64> {
    butterworth(signal, rate, 100.0)
}

/// Butterworth low-pass of order 4 at `hz`, forth and back.
pub(crate) fn butterworth(signal: &[f64], rate: f64, hz: f64) -> Vec<f64> {
    let corner = warped(hz, rate);
    zero_phase(signal, rate, |hz| {
        if hz >= 0.5 * rate {
            0.0
        } else {
            1.0 / (1.0 + (warped(hz, rate) / corner).powi(8))
        }
    })
}

/// Every tenth row after a Chebyshev low-pass (order 8, 0.05 dB, 0.8 of half the new rate), forth and back, without the first and last ten.
pub(crate) fn decimated(signal: &[f64], rate: f64) -> Vec<f64> {
    let corner = warped(0.04 * rate, rate);
    let ripple = 10f64.powf(0.005) - 1.0;
    let filtered = zero_phase(signal, rate, |hz| {
        if hz >= 0.5 * rate {
            return 0.0;
        }
        let x = warped(hz, rate) / corner;
        let chebyshev = if x <= 1.0 {
            (8.0 * x.acos()).cos()
        } else {
            (8.0 * x.acosh()).cosh()
        };
        1.0 / (1.0 + ripple * chebyshev * chebyshev)
    });
    let every: Vec<f64> = filtered.into_iter().step_by(10).collect();
    every[10..every.len() - 10].to_vec()
}
