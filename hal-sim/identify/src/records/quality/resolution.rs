//! Whether an angle steps by the counts that the model has of its encoder.

use super::{Finding, Limits};
use crate::signal::quantile::quantile;
use std::f64::consts::TAU;

/// Size of the steps that stand alone, rad: the angle holds one value in two rows, and another in the next two. `None` where
/// there are fewer than `least`.
fn lone_step(angle: &[f64], least: usize) -> Option<f64> {
    let lone = angle
        .windows(4)
        .filter(|w| w[0] == w[1] && w[1] != w[2] && w[2] == w[3]);
    let steps: Vec<f64> = lone.map(|w| (w[2] - w[1]).abs()).collect();
    match steps.len() < least {
        true => None,
        false => quantile(steps, 0.5),
    }
}

/// An angle whose encoder is coarser than `counts` a turn, which the model has as `setting`.
pub(super) fn check(
    (name, angle): (&str, &[f64]),
    (setting, counts): (&str, u32),
    limits: &Limits,
    found: &mut Vec<Finding>,
) {
    let Some(step) = lone_step(angle, limits.distinct) else {
        return;
    };
    let times = step * f64::from(counts) / TAU;
    if times > limits.coarser {
        found.push(Finding::new(
            "coarser_encoder",
            &[name],
            [times, limits.coarser],
            format!(
                "`{name}` steps by {step:.3e} rad, {:.0} counts a turn, expected the {counts} of `{setting}`; set it to what the \
                 encoder has, or record the machine of this model",
                TAU / step
            ),
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is said of a shaft that turns at 0.3 rad/s, read 5000 times a second, by an encoder of so many counts.
    fn said(has: u32, declared: u32) -> Vec<Finding> {
        let lsb = TAU / f64::from(has);
        let angle: Vec<f64> = (0..20_000)
            .map(|k| (0.3 * f64::from(k) / 5000.0 / lsb).floor() * lsb)
            .collect();
        let mut found = Vec::new();
        check(
            ("nut_angle_rad", &angle),
            ("sensing.encoder_counts_per_turn", declared),
            &Limits::default(),
            &mut found,
        );
        found
    }

    #[test]
    fn a_coarser_encoder_than_the_models_is_wrong_data() {
        let found = said(4000, 131_072);
        let [one] = &found[..] else {
            panic!("{found:?}")
        };
        assert!(
            one.sentence.contains("4000 counts a turn"),
            "{}",
            one.sentence
        );
        for (has, declared) in [(4000, 4000), (131_072, 131_072), (16_384, 4000)] {
            assert_eq!(said(has, declared), [], "{has} counts, {declared} declared");
        }
    }
}
