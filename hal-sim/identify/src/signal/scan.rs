//! Order spectra: what of a residual repeats with an angle, at every order at once.
//!
//! The twice-whitened residual is summed into bins of the angle, and a transform gives its product with
//! `exp(-i order angle)` at all orders. Divided by what a unit amplitude would weigh on the operating points, it gives the
//! fall of the sum of squares that a harmonic of that order brings.

use fft::Complex64;
use std::f64::consts::{PI, TAU};
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
    /// squares. Each operating point counts up to `highest_hz`, at most half the rows' rate.
    pub fn new(
        score: &[f64],
        angle: &[f64],
        stretches: &[Stretch],
        weight: &dyn Fn(usize, f64) -> f64,
        highest_hz: f64,
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
        let highest = |stretch: &Stretch| (highest_hz * TAU / stretch.speed).min(orders.end);
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
            let transform = crate::signal::fourier::transform(span * per_turn);
            let mut bins = transform.make_input_vec();
            let count_bins = bins.len();
            for row in group.iter().flat_map(|stretch| stretch.rows.clone()) {
                // Shared by the two bins around it: whole bins would scatter a strong order over high ones.
                let at = (angle[row] - low) / TAU * per_turn as f64;
                let (bin, part) = (at as usize, at.fract());
                bins[bin % count_bins] += (1.0 - part) * score[row];
                bins[(bin + 1) % count_bins] += part * score[row];
            }
            let mut spectrum = transform.make_output_vec();
            transform
                .process(&mut bins, &mut spectrum)
                .expect("lengths of the plan");
            let end = ((top * span as f64) as usize).min(count);
            for k in first..end {
                // Sharing is a triangle over the angle: its own spectrum is taken out.
                let u = PI * k as f64 / (span * per_turn) as f64;
                sum[k] += spectrum[k] * (u / u.sin()).powi(2);
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
        let reach = (apart / self.spacing).ceil() as usize;
        let peaks = peaks(self.fall.clone(), count, reach);
        peaks
            .into_iter()
            .map(|at| at as f64 * self.spacing)
            .collect()
    }
}

/// Where the `count` highest peaks are, at least `reach` from each other.
pub(crate) fn peaks(mut fall: Vec<f64>, count: usize, reach: usize) -> Vec<usize> {
    let mut peaks = Vec::new();
    while peaks.len() < count {
        let best = fall.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        let Some((at, _)) = best.filter(|(_, best)| **best > 0.0) else {
            break;
        };
        peaks.push(at);
        let end = (at + reach + 1).min(fall.len());
        fall[at.saturating_sub(reach)..end].fill(0.0);
    }
    peaks
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half the rows' rate, Hz.
    const NYQUIST: f64 = 625.0;
    const ROWS: usize = 1500;

    /// An angle that goes at one speed after the other, and its stretches.
    fn at_speeds(speeds: [f64; 2]) -> (Vec<f64>, [Stretch; 2]) {
        let mut angle = vec![0.0];
        for speed in speeds {
            for _ in 0..ROWS {
                angle.push(angle[angle.len() - 1] + speed / (2.0 * NYQUIST));
            }
        }
        let stretches = [0, 1].map(|k| Stretch {
            rows: k * ROWS..(k + 1) * ROWS,
            speed: speeds[k],
        });
        (angle, stretches)
    }

    /// A slow wave on a fast stretch has mirrors at high orders, where only a slow stretch has any weight.
    #[test]
    fn a_slow_wave_is_not_taken_for_its_mirror() {
        let (angle, stretches) = at_speeds([1.4 * TAU, 13.0 * TAU]);
        let score: Vec<f64> = angle.iter().map(|a| (a + 0.4).cos()).collect();
        // As an acceleration's noise weighs: less and less from 60 Hz on.
        let weight = |_: usize, hz: f64| ROWS as f64 * (1.0 + (hz / 60.0).powi(4)).recip();
        let spectrum = OrderSpectrum::new(&score, &angle, &stretches, &weight, NYQUIST, 0.3..126.0);
        let best = spectrum.peaks(1, 0.1)[0];
        assert!((best - 1.0).abs() < 0.05, "order {best}");
    }

    /// Where rows fall between bins a strong order must not show at high ones, which weigh a thousandth of it.
    #[test]
    fn a_strong_order_is_not_scattered() {
        let (angle, stretches) = at_speeds([32.6, 61.0]);
        let weight = |_: usize, hz: f64| ROWS as f64 * (1.0 + (hz / 93.0).powi(4)).recip();
        // Through the whitening twice it comes out with its own frequency's weight.
        let score: Vec<f64> = stretches
            .iter()
            .enumerate()
            .flat_map(|(k, stretch)| {
                let gain = weight(k, 12.0 * stretch.speed / TAU) / ROWS as f64;
                let rows = stretch.rows.clone();
                rows.map(|row| gain * (12.0 * angle[row]).cos())
                    .collect::<Vec<_>>()
            })
            .chain([0.0])
            .collect();
        let highest_hz = 0.8 * NYQUIST;
        let spectrum =
            OrderSpectrum::new(&score, &angle, &stretches, &weight, highest_hz, 0.3..126.0);
        let peaks = spectrum.peaks(1, 0.1);
        assert!((peaks[0] - 12.0).abs() < 0.02, "order {}", peaks[0]);
        let scattered = spectrum.fall[(60.0 / spectrum.spacing) as usize..]
            .iter()
            .fold(0.0_f64, |most, fall| most.max(*fall));
        let own = spectrum.fall[(peaks[0] / spectrum.spacing).round() as usize];
        assert!(scattered < 0.05 * own, "{scattered} of {own}");
    }
}
