//! Which nut speed is proposed for a table velocity.

use serde::Serialize;

/// The rule, as a sentence.
pub const RULE: &str = "Of the nut speeds whose ripple is within 10 % of the smallest, the one with the smallest loss is proposed.";

/// Ripple that still counts as the smallest, relative to it.
const AS_SMOOTH: f64 = 1.1;

/// A nut speed, and what it costs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Choice {
    /// Nut speed, rpm; 0 is the single drive (CDFS).
    pub nut_rpm: f64,
    /// Its ripple, %.
    pub vrf_percent: f64,
    /// Copper and friction loss there, W; none where it was not measured.
    pub loss_w: Option<f64>,
}

/// The one that [`RULE`] proposes. A choice of unknown loss comes after all others; between equal losses the smoother one is taken.
pub fn proposed(choices: impl Iterator<Item = Choice> + Clone) -> Option<Choice> {
    let known = choices.filter(|choice| choice.vrf_percent.is_finite());
    let smallest = known.clone().map(|choice| choice.vrf_percent);
    let limit = AS_SMOOTH * smallest.reduce(f64::min)?;
    let loss = |choice: &Choice| choice.loss_w.unwrap_or(f64::INFINITY);
    known
        .filter(|choice| choice.vrf_percent <= limit)
        .min_by(|a, b| {
            let by_loss = loss(a).total_cmp(&loss(b));
            by_loss.then(a.vrf_percent.total_cmp(&b.vrf_percent))
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(choices: &[(f64, f64, Option<f64>)]) -> Option<f64> {
        let choices = choices
            .iter()
            .map(|&(nut_rpm, vrf_percent, loss_w)| Choice {
                nut_rpm,
                vrf_percent,
                loss_w,
            });
        proposed(choices).map(|choice| choice.nut_rpm)
    }

    #[test]
    fn the_coolest_of_those_as_smooth_as_the_smoothest_is_proposed() {
        let choices = [
            (0.0, 2.0, Some(5.0)),
            (300.0, 1.09, Some(10.0)),
            (500.0, 1.05, Some(14.0)),
            (800.0, 1.0, Some(20.0)),
        ];
        assert_eq!(of(&choices), Some(300.0));
        let rougher = [(300.0, 1.11, Some(10.0)), (800.0, 1.0, Some(20.0))];
        assert_eq!(of(&rougher), Some(800.0), "11 % more ripple is too much");
    }

    #[test]
    fn what_is_unknown_does_not_win() {
        let hot = [(300.0, 1.0, None), (800.0, 1.05, Some(20.0))];
        assert_eq!(of(&hot), Some(800.0));
        let plain = [(300.0, 1.0, None), (800.0, 1.05, None)];
        assert_eq!(of(&plain), Some(300.0));
        assert_eq!(of(&[(300.0, f64::NAN, Some(1.0))]), None);
        assert_eq!(of(&[]), None);
    }
}
