//! An angle's encoder by the angle alone: its counts, and what rounding to them does.

use super::quantile::quantile;

/// Where in a count a smooth motion is counted again: power over these is a mean over chance.
pub(crate) const PHASES: [f64; 4] = [0.06, 0.31, 0.56, 0.81];
/// Quantile of the changes of a step from row to row that is one count, and how many of them there must be.
const LEAST: f64 = 0.01;
const CHANGES: usize = 100;
/// How far a step may be from whole counts, counts; up to how many counts it says that; and in which share of the steps.
const NEAR: f64 = 0.05;
const FEW: f64 = 50.0;
const MOST_STEPS: f64 = 0.99;

/// The error of rounding an angle of `turned` counts, in counts.
pub(crate) fn saw_tooth(turned: f64) -> f64 {
    turned.floor() + 0.5 - turned
}

/// One count of the encoder, in the angle's unit, or `None` where the angle has no counts.
pub(crate) fn count_of(angle: &[f64]) -> Option<f64> {
    let changes = angle.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs());
    let span = angle.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    // What the sum of two numbers rounds is no step.
    let changes: Vec<f64> = changes.filter(|x| *x > 1e-12 * span).collect();
    if changes.len() < CHANGES {
        return None;
    }
    let count = quantile(changes, LEAST)?;
    let steps = angle.windows(2).map(|w| (w[1] - w[0]).abs() / count);
    let few: Vec<f64> = steps.filter(|x| *x > 0.5 && *x < FEW).collect();
    let whole = few.iter().filter(|x| (*x - x.round()).abs() < NEAR).count();
    let is_counted = few.len() >= CHANGES && whole as f64 >= MOST_STEPS * few.len() as f64;
    is_counted.then_some(count)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A shaft between two speeds, counted, with some noise after that.
    fn angle(counts: f64, noise: f64) -> Vec<f64> {
        let turned = |k: usize| 3.0 * (0.004 * k as f64).sin() + 0.01 * k as f64;
        let chance = |k: usize| (k.wrapping_mul(2_654_435_761) % 1009) as f64 / 1009.0 - 0.5;
        let round = |k: usize| (turned(k) * counts).round() / counts + noise * chance(k);
        (0..8000).map(round).collect()
    }

    #[test]
    fn a_count_is_found_where_there_is_one() {
        for counts in [300.0, 2048.0] {
            let found = count_of(&angle(counts, 0.0)).expect("counts");
            assert!((found * counts - 1.0).abs() < 1e-3, "{counts}: {found}");
        }
        assert_eq!(count_of(&angle(300.0, 0.01)), None);
        assert_eq!(count_of(&vec![1.0; 8000]), None);
        assert_eq!(count_of(&[]), None);
    }
}
