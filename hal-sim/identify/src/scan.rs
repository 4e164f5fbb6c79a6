//! Order spectra: what of a residual repeats with an angle, at every order at once.
//!
//! The twice-whitened residual is summed into bins of the angle, and a transform gives its product with
//! `exp(-i order angle)` at all orders. Divided by what a unit amplitude would weigh on the operating points, it gives the
//! fall of the sum of squares that a harmonic of that order brings.

use realfft::num_complex::Complex64;
use std::f64::consts::TAU;
use std::ops::Range;

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
    /// squares. The rows' rate is twice `nyquist` (Hz).
    pub fn new(
        score: &[f64],
        angle: &[f64],
        stretches: &[Stretch],
        weight: &dyn Fn(usize, f64) -> f64,
        nyquist: f64,
        orders: Range<f64>,
    ) -> Self {
        let (low, high) = angle
            .iter()
            .fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
        let turns = (high - low) / TAU;
        let span = ((2.0 * turns).max(16.0) as usize).next_power_of_two();
        let count = (orders.end * span as f64) as usize;
        let first = ((orders.start * span as f64).ceil() as usize).max(1);
        let (mut sum, mut weights) = (vec![Complex64::default(); count], vec![0.0; count]);
        // Rows are samples of the angle: above half of them per turn an operating point shows its own orders mirrored.
        // Those that have the same orders below share one transform.
        let highest = |stretch: &Stretch| (nyquist * TAU / stretch.speed).min(orders.end);
        let mut groups: Vec<(f64, Vec<&Stretch>)> = Vec::new();
        for stretch in stretches {
            let top = highest(stretch);
            match groups.iter_mut().find(|(known, _)| *known == top) {
                Some((_, group)) => group.push(stretch),
                None => groups.push((top, vec![stretch])),
            }
        }
        for (top, group) in groups {
            let per_turn = ((4.0 * top) as usize).next_power_of_two();
            let transform = crate::fourier::transform(span * per_turn);
            let mut bins = transform.make_input_vec();
            let last = bins.len() - 1;
            for row in group.iter().flat_map(|stretch| stretch.rows.clone()) {
                let bin = ((angle[row] - low) / TAU * per_turn as f64 + 0.5) as usize;
                bins[bin.min(last)] += score[row];
            }
            let mut spectrum = transform.make_output_vec();
            transform
                .process(&mut bins, &mut spectrum)
                .expect("lengths of the plan");
            let end = ((top * span as f64) as usize).min(count);
            for k in first..end {
                sum[k] += spectrum[k];
            }
        }
        let coarse = span.div_ceil(4).max(1);
        for (index, stretch) in stretches.iter().enumerate() {
            let end = ((highest(stretch) * span as f64) as usize).min(count);
            for from in (0..end).step_by(coarse) {
                let to = (from + coarse).min(end);
                let order = from.max(first) as f64 / span as f64;
                let here = weight(index, order * stretch.speed / TAU);
                weights[from..to].iter_mut().for_each(|w| *w += here);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A slow wave on a fast stretch has mirrors at high orders, where only a slow stretch has any weight.
    #[test]
    fn a_slow_wave_is_not_taken_for_its_mirror() {
        const NYQUIST: f64 = 625.0;
        let speeds = [1.4 * TAU, 13.0 * TAU];
        let rows = 1500;
        let mut angle = vec![0.0];
        for speed in speeds {
            for _ in 0..rows {
                angle.push(angle[angle.len() - 1] + speed / (2.0 * NYQUIST));
            }
        }
        let score: Vec<f64> = angle.iter().map(|a| (a + 0.4).cos()).collect();
        let stretches = [0, 1].map(|k| Stretch {
            rows: k * rows..(k + 1) * rows,
            speed: speeds[k],
        });
        // As an acceleration's noise weighs: less and less from 60 Hz on.
        let weight = |_: usize, hz: f64| rows as f64 * (1.0 + (hz / 60.0).powi(4)).recip();
        let spectrum = OrderSpectrum::new(&score, &angle, &stretches, &weight, NYQUIST, 0.3..126.0);
        let best = spectrum.peaks(1, 0.1)[0];
        assert!((best - 1.0).abs() < 0.05, "order {best}");
    }
}
