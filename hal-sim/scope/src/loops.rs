//! Bandwidth and phase margin of the loops that settings make, as predicted by their model.

use anyhow::Result;
use commission::tune::{Crossing, Loops};
use link::host::settings::of_words;
use link::settings::Settings;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Frequencies of a curve.
const POINTS: u32 = 200;
/// The lowest, Hz.
const LOWEST_HZ: f64 = 1.0;

/// Rates of a drive, Hz.
#[derive(Clone, Copy, Debug)]
pub struct Rates {
    /// PWM periods a second.
    pub pwm_hz: f64,
    /// Steps of the speed task a second.
    pub speed_hz: f64,
}

/// Current and speed loops of both motors, with values of settings by name. Settings that are not named have their default.
///
/// Each has `motor`, `loop`, `bandwidth_hz`, `margin_deg`, and the open loop's curve: `hz`, `gain_db`, `phase_deg`.
///
/// # Errors
/// A name is unknown, or a value is out of its range.
pub fn predicted(values: &BTreeMap<String, String>, rates: Rates) -> Result<Value> {
    let mut settings = Settings::DEFAULT;
    for (name, value) in values {
        let (setting, value) = of_words(name, value)?;
        settings.set(setting.id, value)?;
    }
    let (period_s, step_s) = (1.0 / rates.pwm_hz, 1.0 / rates.speed_hz);
    let motors = [("screw", &settings.screw), ("nut", &settings.nut)];
    Ok(motors
        .into_iter()
        .flat_map(|(name, motor)| {
            let loops = Loops::of(motor, &settings, period_s, step_s);
            [
                one(
                    name,
                    "current",
                    loops.current_crossing(),
                    rates.pwm_hz,
                    &|w| loops.current(w),
                ),
                one(
                    name,
                    "speed",
                    loops.speed_crossing(),
                    rates.speed_hz,
                    &|w| loops.speed(w),
                ),
            ]
        })
        .collect())
}

/// A loop that is sampled at `sampled_hz`.
fn one(
    motor: &str,
    name: &str,
    crossing: Crossing,
    sampled_hz: f64,
    open: &dyn Fn(f64) -> nalgebra::Complex<f64>,
) -> Value {
    let highest_hz = 0.5 * sampled_hz;
    let at = |k: u32| LOWEST_HZ * (highest_hz / LOWEST_HZ).powf(f64::from(k) / f64::from(POINTS));
    let hz: Vec<f64> = (0..=POINTS).map(at).collect();
    let values: Vec<_> = hz.iter().map(|hz| open(TAU * hz)).collect();
    // An open loop comes from -180 degrees or above, and falls: its phase is followed from there.
    let mut phase = 0.0;
    let phase_deg: Vec<f64> = values
        .iter()
        .enumerate()
        .map(|(k, value)| {
            phase = match k {
                0 => (-value).arg() - TAU / 2.0,
                _ => phase + (value / values[k - 1]).arg(),
            };
            phase.to_degrees()
        })
        .collect();
    json!({
        "motor": motor,
        "loop": name,
        "bandwidth_hz": crossing.bandwidth_rad_s / TAU,
        "margin_deg": crossing.margin_deg,
        "hz": hz,
        "gain_db": values.iter().map(|value| 20.0 * value.norm().log10()).collect::<Vec<_>>(),
        "phase_deg": phase_deg,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATES: Rates = Rates {
        pwm_hz: 20e3,
        speed_hz: 5e3,
    };

    fn speed_loop(values: &[(&str, &str)]) -> Value {
        let owned = |(name, value): &(&str, &str)| ((*name).to_owned(), (*value).to_owned());
        let values = values.iter().map(owned).collect();
        predicted(&values, RATES).unwrap()[1].clone()
    }

    #[test]
    fn the_curve_crosses_a_gain_of_one_at_the_bandwidth_with_the_margin() {
        let speed = speed_loop(&[]);
        let numbers = |key: &str| -> Vec<f64> {
            let all = speed[key].as_array().unwrap().iter();
            all.map(|value| value.as_f64().unwrap()).collect()
        };
        let [hz, gain, phase] = ["hz", "gain_db", "phase_deg"].map(numbers);
        let after = gain.iter().position(|gain| *gain < 0.0).unwrap();
        let bandwidth = speed["bandwidth_hz"].as_f64().unwrap();
        assert!(hz[after - 1] <= bandwidth && bandwidth <= hz[after]);
        let margin = 180.0 + phase[after - 1];
        let said = speed["margin_deg"].as_f64().unwrap();
        assert!((margin - said).abs() < 3.0, "{margin} and {said} degrees");
    }

    #[test]
    fn a_faster_speed_loop_has_less_margin() {
        let margin = |speed: &str| {
            let speed = speed_loop(&[("tuning.speed_rad_s", speed)]);
            speed["margin_deg"].as_f64().unwrap()
        };
        assert!(margin("400") < margin("200") - 5.0);
    }

    #[test]
    fn a_value_out_of_range_is_a_sentence() {
        let values = [("tuning.speed_rad_s".to_owned(), "-1".to_owned())];
        let error = predicted(&values.into(), RATES).unwrap_err().to_string();
        assert!(error.contains("speed_rad_s"), "{error}");
    }
}
