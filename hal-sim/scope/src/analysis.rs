//! Ripple, spectrum and orders of plotted signals.

use anyhow::{Result, ensure};
use hal_sim::hold_ripple::{Ripple, bandwidth_hz, window};
use hal_sim::vrf::{spectrum, velocities};
use serde_json::{Value, json};
use std::f64::consts::TAU;

/// Highest order that is computed, per turn.
const HIGHEST_ORDER: f64 = 100.0;

/// Ripple of evenly spaced positions of the table, m, `interval_s` apart, against their mean velocity.
///
/// # Errors
/// There are too few positions, or the table stands.
pub fn ripple(table_m: &[f64], interval_s: f64) -> Result<Value> {
    ensure!(
        interval_s > 0.0 && table_m.len() as f64 * interval_s >= 0.4,
        "Ripple takes at least 0.4 s of telemetry."
    );
    ensure!(
        table_m.iter().all(|x| x.is_finite()),
        "Rows are missing in these seconds."
    );
    let velocities = velocities(table_m, interval_s, window(interval_s));
    let mean = velocities.iter().sum::<f64>() / velocities.len() as f64;
    ensure!(
        mean.abs() > 1e-6,
        "The table stands: ripple is relative to its velocity."
    );
    let Ripple {
        vrf_percent,
        rms_percent,
    } = Ripple::of(&velocities, interval_s, mean);
    Ok(json!({
        "vrf_percent": vrf_percent,
        "rms_percent": rms_percent,
        "bandwidth_hz": bandwidth_hz(interval_s).min(0.5 / interval_s),
        "mean_mm_s": 1e3 * mean,
    }))
}

/// Amplitudes by order: pairs of order (periods a turn) and amplitude in the unit of the values. The values are interpolated at even
/// angles. Nothing where the angle turns by less than one turn, or back by more than a thousandth of a turn.
#[must_use]
pub fn orders(values: &[f64], angle_rad: &[f64]) -> Vec<f64> {
    let Some(even) = at_even_angles(values, angle_rad) else {
        return Vec::new();
    };
    let turns = turned(angle_rad);
    spectrum(&even, even.len() as f64 / turns)
        .into_iter()
        .take_while(|(order, _)| *order <= HIGHEST_ORDER)
        .flat_map(|(order, amplitude)| [order, amplitude])
        .collect()
}

/// Turns from the first angle to the last.
fn turned(angle_rad: &[f64]) -> f64 {
    match (angle_rad.first(), angle_rad.last()) {
        (Some(first), Some(last)) => (last - first).abs() / TAU,
        _ => 0.0,
    }
}

/// As many values as there are, at even angles from the first to the last.
fn at_even_angles(values: &[f64], angle_rad: &[f64]) -> Option<Vec<f64>> {
    let turns = turned(angle_rad);
    if values.len() != angle_rad.len() || turns.is_nan() || turns < 1.0 {
        return None;
    }
    let sign = (angle_rad[angle_rad.len() - 1] - angle_rad[0]).signum();
    let travel: Vec<f64> = angle_rad
        .iter()
        .map(|angle| sign * (angle - angle_rad[0]))
        .collect();
    // A shaft that turns has only its encoder's noise backwards.
    if travel.windows(2).any(|pair| pair[1] < pair[0] - 1e-3 * TAU) {
        return None;
    }
    let (count, mut row) = (values.len(), 0);
    let even = (0..count).map(|k| {
        let at = turns * TAU * k as f64 / count as f64;
        while row + 2 < count && travel[row + 1] <= at {
            row += 1;
        }
        let width = travel[row + 1] - travel[row];
        let part = if width > 0.0 {
            ((at - travel[row]) / width).clamp(0.0, 1.0)
        } else {
            0.0
        };
        values[row] + part * (values[row + 1] - values[row])
    });
    Some(even.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_shows_its_amplitude() {
        let angles: Vec<f64> = (0..2000)
            .map(|k| TAU * 10.0 * f64::from(k) / 2000.0)
            .collect();
        let values: Vec<f64> = angles.iter().map(|a| 2.0 + 0.3 * (6.0 * a).cos()).collect();
        let spectrum = orders(&values, &angles);
        let largest = spectrum
            .as_chunks::<2>()
            .0
            .iter()
            .max_by(|a, b| a[1].total_cmp(&b[1]))
            .unwrap();
        assert!((largest[0] - 6.0).abs() < 0.11, "order {}", largest[0]);
        assert!((largest[1] - 0.3).abs() < 0.01, "amplitude {}", largest[1]);
    }

    #[test]
    fn an_angle_that_stands_has_no_orders() {
        assert!(orders(&[1.0; 100], &[0.5; 100]).is_empty());
        assert!(orders(&[], &[]).is_empty());
        assert!(orders(&[1.0; 100], &[f64::NAN; 100]).is_empty());
    }

    /// A sine of velocity amplitude `a` about `v` has VRF `2 a / v`.
    #[test]
    fn ripple_is_that_of_a_sine() {
        let (v, a, hz) = (2.5e-3, 2.5e-5, 20.0);
        let at = |k: i32| {
            let t = f64::from(k) * 1e-3;
            v * t - a / (TAU * hz) * (TAU * hz * t).cos()
        };
        let table: Vec<f64> = (0..2000).map(at).collect();
        let ripple = ripple(&table, 1e-3).unwrap();
        let vrf = ripple["vrf_percent"].as_f64().unwrap();
        assert!((vrf - 2.0).abs() < 0.03, "{vrf} %, expected 2 %");
        assert!(super::ripple(&[0.0; 2000], 1e-3).is_err());
        assert!(super::ripple(&table[..10], 1e-3).is_err());
    }
}
