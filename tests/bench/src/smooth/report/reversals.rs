//! Reversals through friction that sticks.

use super::{MODES, mode};
use crate::smooth::reversal::{Reversal, reversal};
use anyhow::Result;
use hal_sim::parallel::on_all_cores;
use serde_json::{Value, json};

/// Of all modes.
pub fn measure() -> Result<Vec<Reversal>> {
    let reversals = on_all_cores(&MODES, |&nut_rpm| reversal(nut_rpm));
    Ok(reversals.into_iter().collect::<Result<_, _>>()?)
}

/// As JSON.
pub fn json(reversals: &[Reversal]) -> Value {
    let one = |(&nut_rpm, error): (&f64, &Reversal)| {
        json!({
            "mode": mode(nut_rpm),
            "error_pi_percent": error.pi,
            "error_ours_percent": error.known,
            "error_ours_percent_if_known_30_less_and_more": error.off,
            "error_observed_percent_if_unknown_30_less_known_30_more": error.observed,
        })
    };
    MODES.iter().zip(reversals).map(one).collect()
}

/// For a person.
pub fn print(reversals: &[Reversal]) {
    println!(
        "\nReversal of 1 mm/s at 0.5 Hz through friction that sticks, largest error over the amplitude: PI, ours, ours told 30 % less \
         and more; with observer and notch: friction unknown, told 30 % less, known, told 30 % more"
    );
    for (&nut_rpm, error) in MODES.iter().zip(reversals) {
        let Reversal {
            pi,
            known,
            off: [less, more],
            observed: [unknown, seen_less, seen, seen_more],
        } = error;
        println!(
            "  {:<36} {pi:>7.1} % {known:>7.1} % {less:>7.1} % {more:>7.1} %   {unknown:>7.1} % {seen_less:>7.1} % {seen:>7.1} % \
             {seen_more:>7.1} %",
            mode(nut_rpm)
        );
    }
}
