//! The benchmark's zero-phase filters, by their magnitude over frequency.

use crate::signal::fourier::{curvature, inverse, smooth_length, transform};
use fft::{Complex64, ComplexToReal, RealToComplex};
use std::f64::consts::{PI, TAU};
use std::ops::Range;
use std::sync::Arc;

/// Rows that are mirrored at either end, so that the filters see no step there.
const MIRROR: usize = 400;

/// A gain that is as good as 0.
const NOTHING: f64 = 1e-12;

/// Tangent of half the digital frequency, which is in that of the rows: what the bilinear transform makes of it.
fn warped(hz: f64) -> f64 {
    (PI * hz).tan()
}

/// A zero-phase filter for signals of one length.
pub(crate) struct ZeroPhase {
    rows: Range<usize>,
    step: usize,
    length: usize,
    mirror: usize,
    /// By bin up to the last one that is not 0, with the shift to the first row.
    gain: Vec<Complex64>,
    forward: Arc<dyn RealToComplex<f64>>,
    backward: Arc<dyn ComplexToReal<f64>>,
}

impl ZeroPhase {
    /// For signals of `length` rows: keeps every `step`-th of `rows`. The gain is over the frequency in that of the rows.
    pub(crate) fn new(
        length: usize,
        rows: Range<usize>,
        step: usize,
        gain: impl Fn(f64) -> f64,
    ) -> Self {
        let mirror = MIRROR.min(length.saturating_sub(1));
        let long = smooth_length((length + 2 * mirror).max(2), step);
        let first = (mirror + rows.start) as f64;
        let of_bin = |bin: usize| {
            let part = bin as f64 / long as f64;
            Complex64::from_polar(gain(part) / long as f64, TAU * (part * first).fract())
        };
        let mut gain: Vec<Complex64> = (0..=long / 2).map(of_bin).collect();
        let least = NOTHING / long as f64;
        let bins = gain
            .iter()
            .rposition(|value| value.norm_sqr() > least * least);
        gain.truncate(bins.map_or(0, |last| last + 1));
        ZeroPhase {
            rows,
            step,
            length,
            mirror,
            gain,
            forward: transform(long),
            backward: inverse(long / step),
        }
    }

    /// The rows that are kept, filtered.
    ///
    /// # Panics
    ///
    /// Where the signal has another length.
    pub(crate) fn of(&self, signal: &[f64]) -> Vec<f64> {
        assert_eq!(signal.len(), self.length, "rows of a filtered signal");
        let (mut long, [start, slope]) = self.reflected(signal);
        let mut spectrum = self.forward.make_output_vec();
        self.forward
            .process(&mut long, &mut spectrum)
            .expect("lengths of the plan");
        let mut folded = self.folded(&spectrum);
        let mut out = self.backward.make_output_vec();
        self.backward
            .process(&mut folded, &mut out)
            .expect("lengths of the plan");
        let rows = self.rows.clone().step_by(self.step);
        let ramp = rows.map(|row| start + slope * (self.mirror + row) as f64);
        ramp.zip(out).map(|(ramp, x)| ramp + x).collect()
    }

    /// A signal with its ends reflected, less a ramp: the ramp's first value and its slope a row.
    fn reflected(&self, signal: &[f64]) -> (Vec<f64>, [f64; 2]) {
        let (n, mirror) = (self.length, self.mirror);
        let mut long = self.forward.make_input_vec();
        if n == 0 {
            return (long, [0.0; 2]);
        }
        let behind = (long.len() - n - mirror).min(n - 1);
        // Odd reflection keeps value and slope.
        for k in 1..=mirror {
            long[mirror - k] = 2.0 * signal[0] - signal[k];
        }
        long[mirror..mirror + n].copy_from_slice(signal);
        for k in 1..=behind {
            long[mirror + n - 1 + k] = 2.0 * signal[n - 1] - signal[n - 1 - k];
        }
        let last = long[mirror + n - 1 + behind];
        long[mirror + n + behind..].fill(last);
        // The rest of a step from end to start is a ramp, which filters leave alone.
        let (start, slope) = (long[0], (last - long[0]) / (long.len() - 1) as f64);
        let ramp = (0..).map(|k| start + slope * f64::from(k));
        long.iter_mut().zip(ramp).for_each(|(x, ramp)| *x -= ramp);
        (long, [start, slope])
    }

    /// The spectrum times the gain, of every `step`-th row: what is above half its rate folds.
    fn folded(&self, spectrum: &[Complex64]) -> Vec<Complex64> {
        let mut folded = self.backward.make_input_vec();
        let (last, bins) = (folded.len() - 1, 2 * (folded.len() - 1));
        for (bin, (value, gain)) in spectrum.iter().zip(&self.gain).enumerate() {
            let value = value * gain;
            let at = bin % bins;
            if at <= last {
                folded[at] += value;
            }
            // The other half of the spectrum is the conjugate.
            let at = (bins - at) % bins;
            if at <= last && bin > 0 && bin + 1 < spectrum.len() {
                folded[at] += value.conj();
            }
        }
        folded[0].im = 0.0;
        folded[last].im = 0.0;
        folded
    }
}

/// All rows of a signal through a gain over the frequency, which is in that of the rows.
fn zero_phase(signal: &[f64], gain: impl Fn(f64) -> f64) -> Vec<f64> {
    ZeroPhase::new(signal.len(), 0..signal.len(), 1, gain).of(signal)
}

/// Second derivative, per second squared, exact up to half the rate: the second difference over its own gain.
pub(crate) fn second_derivative(signal: &[f64], rate: f64) -> Vec<f64> {
    zero_phase(&curvature(signal, rate), |hz| match hz > 0.0 {
        true => (PI * hz / (PI * hz).sin()).powi(2),
        false => 1.0,
    })
}

/// Butterworth low-pass of order 4 at 100 Hz, forth and back.
pub(crate) fn butterworth_100(signal: &[f64], rate: f64) -> Vec<f64> {
    butterworth(signal, rate, 100.0)
}

/// Butterworth low-pass of order 4 at `hz`, forth and back.
pub(crate) fn butterworth(signal: &[f64], rate: f64, hz: f64) -> Vec<f64> {
    zero_phase(signal, butterworth_gain(hz / rate))
}

/// Its gain over the frequency, both in that of the rows.
pub(crate) fn butterworth_gain(corner: f64) -> impl Fn(f64) -> f64 {
    let corner = warped(corner);
    move |hz| match hz < 0.5 {
        true => 1.0 / (1.0 + (warped(hz) / corner).powi(8)),
        false => 0.0,
    }
}

/// Every tenth row after a Chebyshev low-pass (order 8, 0.05 dB, 0.8 of half the new rate), forth and back, without the first and last ten.
pub(crate) fn decimated(signal: &[f64]) -> Vec<f64> {
    let corner = warped(0.04);
    let ripple = 10f64.powf(0.005) - 1.0;
    let gain = |hz: f64| {
        if hz >= 0.5 {
            return 0.0;
        }
        let x = warped(hz) / corner;
        let chebyshev = if x <= 1.0 {
            (8.0 * x.acos()).cos()
        } else {
            (8.0 * x.acosh()).cosh()
        };
        1.0 / (1.0 + ripple * chebyshev * chebyshev)
    };
    let rows = signal.len();
    let every = ZeroPhase::new(rows, 0..rows, 10, gain).of(signal);
    every[10..every.len() - 10].to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sum of two lines, one of which is above half the rate of what is kept.
    fn signal(rows: usize) -> Vec<f64> {
        let at = |k: usize| (0.02 * k as f64).sin() + (0.9 * k as f64).cos() + 1e-3 * k as f64;
        (0..rows).map(at).collect()
    }

    #[test]
    fn rows_that_are_kept_are_those_of_the_whole_filter() {
        for (rows, first, step) in [
            (5000, 300, 4),
            (999, 7, 10),
            (20, 3, 3),
            (2, 0, 1),
            (1, 0, 1),
        ] {
            let signal = signal(rows);
            let whole = zero_phase(&signal, butterworth_gain(0.1));
            let every = ZeroPhase::new(rows, first..rows, step, butterworth_gain(0.1)).of(&signal);
            let expected: Vec<f64> = whole.into_iter().skip(first).step_by(step).collect();
            assert_eq!(every.len(), expected.len(), "{rows} rows");
            // Their ends are reflected to another length: near them the filter sees that.
            let inside = every.len() / 10..every.len() - every.len() / 10;
            for (x, y) in every[inside.clone()].iter().zip(&expected[inside]) {
                assert!((x - y).abs() < 1e-6, "{rows} rows: {x}, expected {y}");
            }
        }
        assert!(butterworth(&[], 1000.0, 100.0).is_empty());
    }

    /// A Butterworth filter of order 4, forth and back, halves its corner and leaves what is far below.
    #[test]
    fn a_line_is_as_large_as_the_gain() {
        for (line, gain) in [(0.01, 1.0), (0.1, 0.5), (0.3, 9.64e-6)] {
            let signal: Vec<f64> = (0..4000)
                .map(|k| (TAU * line * f64::from(k)).cos())
                .collect();
            let rms = |x: &[f64]| (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt();
            let seen = rms(&butterworth(&signal, 1.0, 0.1)[1000..3000]) / rms(&signal[1000..3000]);
            // By the bilinear transform: tan(0.1 pi) and tan(0.3 pi), to the eighth power.
            assert!(
                (seen - gain).abs() < 0.01 * gain + 1e-3,
                "{line}: {seen}, expected {gain}"
            );
        }
    }
}
