//! Ripple, spectrum and orders of plotted signals.

use anyhow::{Result, ensure};
use hal_sim::hold_ripple::{Ripple, bandwidth_hz, window};
use hal_sim::vrf::velocities;
use serde_json::{Value, json};
use std::f64::consts::TAU;

/// Highest order that is computed, per turn.
const HIGHEST_ORDER: f64 = 100.0;
/// Most orders: a long record has finer ones than a plot shows.
const MOST_ORDERS: usize = 800;

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

/// Amplitudes by order: pairs of order (periods a turn) and amplitude in the unit of the values. The angle must turn on.
/// Hann window over the rows, mean removed.
#[must_use]
pub fn orders(values: &[f64], angle_rad: &[f64]) -> Vec<f64> {
    let rows = values.len().min(angle_rad.len());
    if rows < 8 {
        return Vec::new();
    }
    let (values, angles) = (&values[..rows], &angle_rad[..rows]);
    let turns = (angles[rows - 1] - angles[0]).abs() / TAU;
    if turns.is_nan() || turns < 1.0 {
        return Vec::new();
    }
    let mean = values.iter().sum::<f64>() / rows as f64;
    let step = (1.0 / turns).max(HIGHEST_ORDER / MOST_ORDERS as f64);
    let windowed: Vec<f64> = values
        .iter()
        .enumerate()
        .map(|(k, value)| {
            let hann = 0.5 - 0.5 * (TAU * (k as f64 + 0.5) / rows as f64).cos();
            (value - mean) * hann
        })
        .collect();
    // The mean of a Hann window is a half.
    let scale = 4.0 / rows as f64;
    let rows_a_turn = rows as f64 / turns;
    let highest = HIGHEST_ORDER.min(0.5 * rows_a_turn);
    (1..)
        .map(|k| f64::from(k) * step)
        .take_while(|order| *order <= highest)
        .flat_map(|order| {
            let (re, im) =
                windowed
                    .iter()
                    .zip(angles)
                    .fold((0.0, 0.0), |(re, im), (value, angle)| {
                        let (sin, cos) = (order * angle).sin_cos();
                        (re + value * cos, im - value * sin)
                    });
            [order, scale * f64::hypot(re, im)]
        })
        .collect()
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
