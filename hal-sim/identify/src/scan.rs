//! Order spectra: what of a residual repeats with an angle, at every order at once.
//!
//! For each operating point the twice-whitened residual is summed into bins of the angle, and one transform gives its
//! product with `exp(-i order angle)` at all orders. Over the operating points these add coherently; divided by what a
//! unit amplitude would weigh there, they give the fall of the sum of squares that a harmonic of that order brings.

use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;
use std::f64::consts::TAU;
use std::ops::Range;

/// Bins per turn of the angle; orders are used up to a quarter of it.
const BINS: usize = 512;

/// What one operating point has.
pub struct Stretch {
    /// Rows.
    pub rows: Range<usize>,
    /// Mean size of the angle's speed, rad/s.
    pub speed: f64,
}

/// Score of every order.
pub struct OrderSpectrum {
    /// Distance of two orders.
    pub spacing: f64,
    /// Fall of the sum of squares, by order / spacing.
    pub fall: Vec<f64>,
    /// Amplitude in the residual's unit, by order / spacing.
    pub amplitude: Vec<f64>,
    /// Angle covered, turns.
    pub turns: f64,
}

impl OrderSpectrum {
    /// Scans a weighted residual `score` (residual through the whitening twice) over `angle` (rad).
    ///
    /// `weight(stretch, hz)` is what a unit harmonic at that frequency weighs on that operating point, twice its sum of
    /// squares. Orders run from `lowest` to `highest`.
    pub fn new(
        score: &[f64],
        angle: &[f64],
        stretches: &[Stretch],
        weight: &dyn Fn(usize, f64) -> f64,
        orders: Range<f64>,
    ) -> Self {
        let (low, high) = angle
            .iter()
            .fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
        let turns = (high - low) / TAU;
        let span = ((4.0 * turns).max(16.0) as usize).next_power_of_two();
        let length = span * BINS;
        let count = ((orders.end.min(BINS as f64 / 4.0)) * span as f64) as usize;
        let first = ((orders.start * span as f64).ceil() as usize).max(1);
        let transform = RealFftPlanner::<f64>::new().plan_fft_forward(length);
        let (mut sum, mut weights) = (vec![Complex64::default(); count], vec![0.0; count]);
        let mut bins = transform.make_input_vec();
        let mut spectrum = transform.make_output_vec();
        let coarse = span.div_ceil(4).max(1);
        for (index, stretch) in stretches.iter().enumerate() {
            bins.iter_mut().for_each(|x| *x = 0.0);
            for row in stretch.rows.clone() {
                let bin = ((angle[row] - low) / TAU * BINS as f64 + 0.5) as usize;
                bins[bin.min(length - 1)] += score[row];
            }
            transform
                .process(&mut bins, &mut spectrum)
                .expect("lengths of the plan");
            let mut here = 0.0;
            for k in first..count {
                if k == first || k % coarse == 0 {
                    here = weight(index, k as f64 / span as f64 * stretch.speed / TAU);
                }
                if here > 0.0 {
                    sum[k] += spectrum[k];
                    weights[k] += here;
                }
            }
        }
        let most = weights.iter().copied().fold(0.0, f64::max);
        let (fall, amplitude) = sum
            .iter()
            .zip(&weights)
            .map(|(s, &w)| {
                // An order that hardly any operating point can show is not scored.
                if w > 1e-4 * most {
                    (2.0 * s.norm_sqr() / w, 2.0 * s.norm() / w)
                } else {
                    (0.0, 0.0)
                }
            })
            .unzip();
        OrderSpectrum {
            spacing: 1.0 / span as f64,
            fall,
            amplitude,
            turns,
        }
    }

    /// The `count` highest peaks, as orders, at least `apart` from each other.
    pub fn peaks(&self, count: usize, apart: f64) -> Vec<f64> {
        let mut fall = self.fall.clone();
        let reach = (apart / self.spacing).ceil() as usize;
        let mut peaks = Vec::new();
        for _ in 0..count {
            let Some((at, &best)) = fall.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))
            else {
                break;
            };
            if best <= 0.0 {
                break;
            }
            peaks.push(at as f64 * self.spacing);
            let from = at.saturating_sub(reach);
            let to = (at + reach + 1).min(fall.len());
            fall[from..to].iter_mut().for_each(|x| *x = 0.0);
        }
        peaks
    }
}
