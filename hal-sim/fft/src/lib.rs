//! Fourier transforms of double precision. The planners of `rustfft` and `realfft` are generic, so each crate that calls them
//! compiles all of their kernels once more: here they are compiled once.
#![forbid(unsafe_code)]

pub use realfft::num_complex::{self, Complex64};
pub use realfft::{ComplexToReal, RealToComplex};

use realfft::RealFftPlanner;
use rustfft::FftPlanner;
use std::sync::Arc;

/// Plans transforms of real signals, and keeps the plans.
pub struct Planner(RealFftPlanner<f64>);

impl Planner {
    /// Nothing planned yet.
    #[must_use]
    pub fn new() -> Self {
        Self(RealFftPlanner::new())
    }

    /// From `length` samples to their one-sided spectrum, not scaled.
    pub fn forward(&mut self, length: usize) -> Arc<dyn RealToComplex<f64>> {
        self.0.plan_fft_forward(length)
    }

    /// From a one-sided spectrum to `length` samples, not scaled.
    pub fn inverse(&mut self, length: usize) -> Arc<dyn ComplexToReal<f64>> {
        self.0.plan_fft_inverse(length)
    }
}

impl Default for Planner {
    fn default() -> Self {
        Self::new()
    }
}

/// The spectrum of a signal, in its place and not scaled.
pub fn forward(signal: &mut [Complex64]) {
    FftPlanner::new()
        .plan_fft_forward(signal.len())
        .process(signal);
}

/// The signal of a spectrum, in its place and not scaled.
pub fn inverse(spectrum: &mut [Complex64]) {
    FftPlanner::new()
        .plan_fft_inverse(spectrum.len())
        .process(spectrum);
}
