//! Zero-phase filtering, exact differentiation and resampling of whole records in the frequency domain.

use fft::{Complex64, ComplexToReal, Planner, RealToComplex};
use std::cell::RefCell;
use std::f64::consts::TAU;
use std::sync::Arc;

/// One-sided spectrum of a padded record, up to the Nyquist frequency of the decimated rate.
pub type Spectrum = Vec<Complex64>;

/// How far a low-pass filter reaches above its bandwidth.
pub(crate) const EDGE: f64 = 1.4;

thread_local! {
    static PLANNER: RefCell<Planner> = RefCell::new(Planner::new());
}

/// The forward transform of a length; planned once on each thread.
pub fn transform(length: usize) -> Arc<dyn RealToComplex<f64>> {
    PLANNER.with(|planner| planner.borrow_mut().forward(length))
}

/// The inverse transform to a length; planned once on each thread.
pub(crate) fn inverse(length: usize) -> Arc<dyn ComplexToReal<f64>> {
    PLANNER.with(|planner| planner.borrow_mut().inverse(length))
}

/// Transforms of records of one length, and back at a lower rate.
pub struct Fourier {
    rows: usize,
    padded: usize,
    step: usize,
    rate: f64,
    /// By stride: of records of which every `stride`-th row is given.
    forward: Vec<(usize, Arc<dyn RealToComplex<f64>>)>,
    backward: Arc<dyn ComplexToReal<f64>>,
    full: Arc<dyn ComplexToReal<f64>>,
}

/// The next length of the form 2^a 3^b 5^c that `step` divides and whose quotient is even.
pub(crate) fn smooth_length(at_least: usize, step: usize) -> usize {
    let smooth = |mut n: usize| {
        for p in [2, 3, 5] {
            while n.is_multiple_of(p) {
                n /= p;
            }
        }
        n == 1
    };
    let mut quotient = at_least.div_ceil(step);
    while !(quotient.is_multiple_of(2) && smooth(quotient)) {
        quotient += 1;
    }
    quotient * step
}

impl Fourier {
    /// For records of `rows` samples at `rate` Hz; results come at `rate / step`. `pad` samples of zeros keep the end of
    /// a record from reaching round to its start.
    pub fn new(rows: usize, rate: f64, step: usize, pad: usize) -> Self {
        let padded = smooth_length(rows + pad, step);
        let mut planner = Planner::new();
        Fourier {
            rows,
            padded,
            step,
            rate,
            forward: (1..=step)
                .filter(|stride| step.is_multiple_of(*stride))
                .map(|stride| (stride, transform(padded / stride)))
                .collect(),
            backward: planner.inverse(padded / step),
            full: planner.inverse(padded),
        }
    }

    /// Rows of a decimated result.
    pub fn decimated_rows(&self) -> usize {
        self.rows.div_ceil(self.step)
    }

    /// Every how many rows a decimated result has one.
    pub fn step(&self) -> usize {
        self.step
    }

    /// Number of frequencies in a [`Spectrum`].
    pub fn bins(&self) -> usize {
        self.padded / self.step / 2
    }

    /// Frequency of a bin, Hz.
    pub fn hz(&self, bin: usize) -> f64 {
        bin as f64 * self.rate / self.padded as f64
    }

    /// The widest stride at which a signal without content above `hz` loses nothing of what is used.
    pub fn stride(&self, hz: f64) -> usize {
        // What is above the Nyquist frequency of a stride's rate folds back from there: it must stay above what is used.
        let fits = |stride: usize| hz + self.hz(self.bins()) <= self.rate / stride as f64;
        self.forward
            .iter()
            .rev()
            .map(|(stride, _)| *stride)
            .find(|&stride| fits(stride))
            .unwrap_or(1)
    }

    /// Spectrum of a record, cut at the decimated Nyquist frequency.
    pub fn spectrum(&self, signal: &[f64]) -> Spectrum {
        self.spectrum_at(1, signal)
    }

    /// As [`Fourier::spectrum`], of every `stride`-th row of a record. A stride that does not divide the step is no
    /// stride.
    pub fn spectrum_at(&self, stride: usize, signal: &[f64]) -> Spectrum {
        let (_, plan) = self
            .forward
            .iter()
            .find(|(known, _)| *known == stride)
            .expect("a stride that divides the step");
        let mut padded = plan.make_input_vec();
        padded[..signal.len()].copy_from_slice(signal);
        let mut spectrum = plan.make_output_vec();
        // Lengths are those of the plan, the only error there is.
        plan.process(&mut padded, &mut spectrum)
            .expect("lengths of the plan");
        spectrum.truncate(self.bins());
        if stride > 1 {
            let scale = stride as f64;
            spectrum.iter_mut().for_each(|c| *c *= scale);
        }
        spectrum
    }

    /// The record of a spectrum times a real gain over frequency, at the decimated rate.
    pub fn filtered(&self, spectrum: &[Complex64], gain: &[f64]) -> Vec<f64> {
        let mut shaped: Vec<Complex64> = spectrum.iter().zip(gain).map(|(c, &g)| c * g).collect();
        shaped.push(Complex64::default());
        shaped[0].im = 0.0;
        let mut signal = self.backward.make_output_vec();
        self.backward
            .process(&mut shaped, &mut signal)
            .expect("lengths of the plan");
        signal.truncate(self.decimated_rows());
        let scale = 1.0 / self.padded as f64;
        signal.iter_mut().for_each(|x| *x *= scale);
        signal
    }

    /// Rms of a record by its spectrum.
    pub(crate) fn rms(&self, spectrum: &[Complex64]) -> f64 {
        let sum: f64 = spectrum.iter().skip(1).map(|c| c.norm_sqr()).sum();
        let whole = 2.0 * sum + spectrum[0].norm_sqr();
        (whole / (self.padded * self.rows) as f64).sqrt()
    }

    /// A decimated record through a real gain over frequency.
    pub fn again(&self, signal: &[f64], gain: &[f64]) -> Vec<f64> {
        let spectrum = self.spectrum_at(self.step, signal);
        self.filtered(&spectrum, gain)
    }

    /// A record without what is above `hz` (a raised-cosine edge from `hz` to [`EDGE`] times that), at the full rate.
    pub fn low_pass(&self, signal: &[f64], hz: f64) -> Vec<f64> {
        self.low_pass_of(&self.spectrum(signal), hz)
    }

    /// The same of a record's spectrum.
    pub(crate) fn low_pass_of(&self, spectrum: &[Complex64], hz: f64) -> Vec<f64> {
        let mut shaped = self.full.make_input_vec();
        for (bin, value) in spectrum.iter().enumerate() {
            shaped[bin] = value * edge(self.hz(bin), hz, EDGE * hz);
        }
        shaped[0].im = 0.0;
        let mut out = self.full.make_output_vec();
        self.full
            .process(&mut shaped, &mut out)
            .expect("lengths of the plan");
        out.truncate(self.rows);
        let scale = 1.0 / self.padded as f64;
        out.iter_mut().for_each(|x| *x *= scale);
        out
    }
}

/// Power in that of noise from which a bin of a spectrum is more than noise: noise alone exceeds it in one bin of a thousand,
/// as its power is distributed exponentially.
pub(crate) const ABOVE_NOISE: f64 = 7.0;
/// The same of a regressor whose bias adds up over its bins. What a screw's compliance makes of the shafts' motion is biased towards the
/// stiffer screw. Of 34 drawn machines (seeds 700018 on, every 19th) the resonance was 2.3 standard deviations too high on average with 7
/// times. With 100 times it was 0.5. With 1000 times it was 0.4, and four times as uncertain. The slope of a voltage answers the currents'
/// noise: with 7 times a flux harmonic was 3 % off.
pub(crate) const CLEAR: f64 = 100.0;

impl Fourier {
    /// What of a record's spectrum is above noise with a variance a row of `density` in each bin. Noise in a regressor
    /// draws its parameter to where it explains the residual's noise, which is the same (errors in variables; Söderström,
    /// *Automatica* 43, 2007): what a record tells of the parameter is in the bins that stand out of it, by so many `times` its power.
    pub fn above_noise(
        &self,
        spectrum: &[Complex64],
        times: f64,
        density: impl Fn(usize) -> f64,
    ) -> Spectrum {
        let rows = self.rows as f64;
        let told = |(bin, value): (usize, &Complex64)| {
            let least = times * rows * density(bin);
            value * f64::from(u8::from(value.norm_sqr() > least))
        };
        spectrum.iter().enumerate().map(told).collect()
    }
}

/// 1 below `from`, 0 above `to`, a raised cosine between.
pub fn edge(hz: f64, from: f64, to: f64) -> f64 {
    if hz <= from {
        1.0
    } else if hz >= to {
        0.0
    } else {
        0.5 + 0.5 * (0.5 * TAU * (hz - from) / (to - from)).cos()
    }
}

/// Central first difference, per second; its gain falls short of a derivative by `sin(x)/x`, `x = omega dt`.
pub fn slope(signal: &[f64], rate: f64) -> Vec<f64> {
    let n = signal.len();
    (0..n)
        .map(|k| {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(n - 1));
            (signal[b] - signal[a]) * rate / (b - a).max(1) as f64
        })
        .collect()
}

/// Second difference, per second squared.
pub fn curvature(signal: &[f64], rate: f64) -> Vec<f64> {
    let n = signal.len();
    (0..n)
        .map(|k| {
            if k == 0 || k + 1 == n {
                0.0
            } else {
                (signal[k + 1] - 2.0 * signal[k] + signal[k - 1]) * rate * rate
            }
        })
        .collect()
}

impl Fourier {
    /// A signal `seconds` later.
    pub fn delayed(&self, spectrum: &[Complex64], seconds: f64) -> Spectrum {
        let turn = |bin: usize| Complex64::from_polar(1.0, -TAU * self.hz(bin) * seconds);
        let bins = spectrum.iter().enumerate();
        bins.map(|(bin, value)| value * turn(bin)).collect()
    }

    /// Spectrum of the first derivative, exact up to the Nyquist frequency of the decimated rate.
    pub fn slope(&self, signal: &[f64]) -> Spectrum {
        self.slope_at(1, signal)
    }

    /// As [`Fourier::slope`], of every `stride`-th row.
    pub fn slope_at(&self, stride: usize, signal: &[f64]) -> Spectrum {
        let rate = self.rate / stride as f64;
        let mut spectrum = self.spectrum_at(stride, &slope(signal, rate));
        for (bin, value) in spectrum.iter_mut().enumerate().skip(1) {
            let x = TAU * self.hz(bin) / rate;
            *value *= x / x.sin();
        }
        spectrum
    }

    /// Spectrum of the second derivative, exact up to the Nyquist frequency of the decimated rate.
    pub fn curvature(&self, signal: &[f64]) -> Spectrum {
        self.curvature_at(1, signal)
    }

    /// As [`Fourier::curvature`], of every `stride`-th row.
    pub fn curvature_at(&self, stride: usize, signal: &[f64]) -> Spectrum {
        let rate = self.rate / stride as f64;
        let mut spectrum = self.spectrum_at(stride, &curvature(signal, rate));
        for (bin, value) in spectrum.iter_mut().enumerate().skip(1) {
            let half = 0.5 * TAU * self.hz(bin) / rate;
            *value *= (half / half.sin()).powi(2);
        }
        spectrum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regression::sandwich::tests::coloured;

    /// A stride is only as wide as the content allows, and then loses nothing of what is used.
    #[test]
    fn a_stride_keeps_what_is_used() {
        let fourier = Fourier::new(20_000, 5000.0, 4, 2000);
        for hz in [40.0, 600.0, 900.0, 1700.0] {
            let signal: Vec<f64> = (0..20_000)
                .map(|k| {
                    let window = (0.5 * TAU * k as f64 / 20_000.0).sin().powi(4);
                    window * (TAU * hz * k as f64 / 5000.0 + 0.3).cos()
                })
                .collect();
            let stride = fourier.stride(hz);
            let every: Vec<f64> = signal.iter().copied().step_by(stride).collect();
            let (full, fast) = (
                fourier.spectrum(&signal),
                fourier.spectrum_at(stride, &every),
            );
            let used = (0.96 * fourier.bins() as f64) as usize;
            let apart = full[..used]
                .iter()
                .zip(&fast)
                .map(|(a, b)| (a - b).norm())
                .fold(0.0, f64::max);
            assert!(
                apart < 1e-6 * 20_000.0,
                "{hz} Hz at stride {stride}: {apart}"
            );
        }
        assert_eq!(fourier.stride(40.0), 4);
    }

    /// A regressor with noise, of a residual that has the noise with the other sign: the true parameter is 0.02.
    #[test]
    fn noise_in_a_regressor_does_not_draw_its_parameter() {
        const ROWS: usize = 20_000;
        let fourier = Fourier::new(ROWS, 5000.0, 4, 2000);
        let noise = coloured(1, ROWS, 0.0);
        let line: Vec<f64> = (0..ROWS)
            .map(|k| 0.5 * (TAU * 30.0 * k as f64 / 5000.0).cos())
            .collect();
        let sum = |of: [f64; 2]| -> Vec<f64> {
            let pairs = line.iter().zip(&noise);
            pairs.map(|(l, n)| of[0] * l + of[1] * n).collect()
        };
        let residual = fourier.spectrum(&sum([0.02, -1.0]));
        let regressor = fourier.spectrum(&sum([1.0, 1.0]));
        let parameter = |regressor: &[Complex64]| {
            let dot = |other: &[Complex64]| -> f64 {
                let pairs = regressor.iter().zip(other);
                pairs.map(|(a, b)| (a * b.conj()).re).sum()
            };
            dot(&residual) / dot(regressor)
        };
        let variance = noise.iter().map(|n| n * n).sum::<f64>() / ROWS as f64;
        let whole = parameter(&regressor);
        let told = parameter(&fourier.above_noise(&regressor, ABOVE_NOISE, |_| variance));
        assert!(
            whole < -0.3 && (told - 0.02).abs() < 0.02,
            "with the noise {whole}, without {told}, expected less than -0.3, and 0.02"
        );
    }
}
