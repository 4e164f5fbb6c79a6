//! Channels that a file does not have, made of those that it has.

use super::record::{Channel, Origin};
use super::{Machine, Record};
use crate::signal::frames;

/// Bandwidth of a speed that is derived from a position, Hz: what a drive's speed loop sees, and at most an eighth of the
/// rate, so that the noise of the counts stays below the slope's.
pub fn speed_band_hz(rate: f64) -> f64 {
    (rate / 8.0).min(200.0)
}

/// Adds what the machine needs: angle from speed, speed from angle, d-q currents and voltages from phases.
pub(super) fn complete(record: &mut Record, pole_pairs: Option<f64>, amplitude_invariant: bool) {
    match record.machine {
        Machine::DoubleDrive => {}
        Machine::FeedAxis => motion(record, "position_m", "speed_m_s"),
        Machine::Motor => motion(record, "position_rad", "speed_rad_s"),
        Machine::Pmsm => {
            if let (None, Some(p), Some(electrical)) = (
                record.get("angle_rad"),
                pole_pairs,
                record.get("electrical_angle_rad"),
            ) {
                let angle = electrical.iter().map(|angle| angle / p).collect();
                record.derive(
                    "angle_rad",
                    angle,
                    "the electrical angle over the pole pairs",
                );
            }
            motion(record, "angle_rad", "speed_rad_s");
            electrical(record, pole_pairs, amplitude_invariant);
        }
    }
}

/// Position from speed, or speed from position.
fn motion(record: &mut Record, position: &'static str, speed: &'static str) {
    let rate = record.rate;
    let of_segments = |record: &Record, values: &[f64], of: &dyn Fn(&[f64]) -> Vec<f64>| {
        let segments = record.segments.iter();
        segments
            .flat_map(|rows| of(&values[rows.clone()]))
            .collect()
    };
    match (record.get(position), record.get(speed)) {
        (None, Some(values)) => {
            let way = of_segments(record, values, &|v| integral(v, rate));
            record.derive(
                position,
                way,
                "the integral of the speed by the trapezoid rule",
            );
        }
        (Some(values), None) => {
            let slopes = of_segments(record, values, &|x| slope(x, rate));
            record.derive(
                speed,
                slopes,
                &format!(
                    "the slope of the position, to {:.0} Hz",
                    speed_band_hz(rate)
                ),
            );
        }
        _ => {}
    }
}

fn integral(values: &[f64], rate: f64) -> Vec<f64> {
    let mut sum = 0.0;
    let mut before = None;
    values
        .iter()
        .map(|&value| {
            sum += before
                .replace(value)
                .map_or(0.0, |b: f64| 0.5 * (b + value) / rate);
            sum
        })
        .collect()
}

/// Least-squares slope over the rows about each one; its first zero is at about twice the band.
fn slope(values: &[f64], rate: f64) -> Vec<f64> {
    let half = ((rate / (2.0 * speed_band_hz(rate))).round() as usize).clamp(1, 64);
    let n = values.len();
    (0..n)
        .map(|k| {
            let reach = half.min(k).min(n - 1 - k);
            if reach == 0 {
                let (a, b) = (k.saturating_sub(1), (k + 1).min(n - 1));
                return match b - a {
                    0 => 0.0,
                    rows => (values[b] - values[a]) * rate / rows as f64,
                };
            }
            let sum: f64 = (1..=reach)
                .map(|m| m as f64 * (values[k + m] - values[k - m]))
                .sum();
            let r = reach as f64;
            rate * sum / (r * (r + 1.0) * (2.0 * r + 1.0) / 3.0)
        })
        .collect()
}

/// d-q currents and voltages, power-invariant.
fn electrical(record: &mut Record, pole_pairs: Option<f64>, amplitude_invariant: bool) {
    let scale = (1.5_f64).sqrt();
    if amplitude_invariant {
        for name in [
            "id_a", "iq_a", "ud_v", "uq_v", "id_ref_a", "iq_ref_a", "ualpha_v", "ubeta_v",
        ] {
            if let Some(channel) = record.channels.iter_mut().find(|c| c.name == name) {
                channel.values.iter_mut().for_each(|value| *value *= scale);
            }
        }
        record.quality.notes.push(
            "d-q currents and voltages are times sqrt(3/2): the plant is power-invariant".into(),
        );
    }
    let Some(pole_pairs) = pole_pairs else { return };
    let Some(angle) = record.get("angle_rad") else {
        return;
    };
    let rotor: Vec<(f64, f64)> = angle.iter().map(|a| (pole_pairs * a).sin_cos()).collect();
    if record.get("iq_a").is_none()
        && let (Some(a), Some(b)) = (record.get("ia_a"), record.get("ib_a"))
    {
        let (d, q) = park(&clarke(a, b), &rotor);
        record.derive("id_a", d, "the phase currents in the rotor's frame");
        record.derive("iq_a", q, "the phase currents in the rotor's frame");
    }
    if record.get("uq_v").is_some() {
        return;
    }
    let along = |name: &str| record.get(name);
    let phases = if let (Some(a), Some(b)) = (along("ualpha_v"), along("ubeta_v")) {
        let pair = a.iter().copied().zip(b.iter().copied());
        Some(pair.collect::<Vec<_>>())
    } else if let (Some(a), Some(b), Some(c)) = (along("ua_v"), along("ub_v"), along("uc_v")) {
        Some(star(a, b, c, |_| 1.0))
    } else if let (Some(a), Some(b), Some(c), Some(bus)) = (
        along("duty_a"),
        along("duty_b"),
        along("duty_c"),
        along("bus_v"),
    ) {
        Some(star(a, b, c, |k| bus[k]))
    } else {
        None
    };
    if let Some(phases) = phases {
        let (d, q) = park(&phases, &rotor);
        record.derive("ud_v", d, "the voltages in the rotor's frame");
        record.derive("uq_v", q, "the voltages in the rotor's frame");
    }
}

/// Clarke of two phases whose third is minus their sum.
fn clarke(a: &[f64], b: &[f64]) -> Vec<(f64, f64)> {
    a.iter()
        .zip(b)
        .map(|(a, b)| frames::clarke(*a, *b))
        .collect()
}

/// Clarke of three phases against their mean.
fn star(a: &[f64], b: &[f64], c: &[f64], unit: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
    (0..a.len())
        .map(|k| {
            let mean = (a[k] + b[k] + c[k]) / 3.0;
            let scale = unit(k);
            frames::clarke(scale * (a[k] - mean), scale * (b[k] - mean))
        })
        .collect()
}

fn park(vector: &[(f64, f64)], rotor: &[(f64, f64)]) -> (Vec<f64>, Vec<f64>) {
    vector
        .iter()
        .zip(rotor)
        .map(|(vector, (sin, cos))| frames::park(*vector, (*cos, *sin)))
        .unzip()
}

impl Record {
    fn derive(&mut self, name: &'static str, values: Vec<f64>, how: &str) {
        self.quality
            .notes
            .push(format!("`{name}` is derived: {how}"));
        self.channels.push(Channel {
            name,
            values,
            origin: Origin::Derived,
        });
    }
}

/// Takes out the jumps of a value that starts again after a period. What is not finite stays and is passed over.
pub(super) fn unwrap(values: &mut [f64], period: f64) {
    let (mut turns, mut before) = (0.0, None);
    for value in values.iter_mut().filter(|value| value.is_finite()) {
        if let Some(before) = before.replace(*value) {
            turns -= ((*value - before) / period).round();
        }
        *value += turns * period;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn what_wraps_is_unwrapped_and_a_bad_row_is_passed_over() {
        let mut values = [350.0, 355.0, f64::NAN, 5.0, 10.0, 355.0];
        unwrap(&mut values, 360.0);
        assert_eq!(
            [values[1], values[3], values[4], values[5]],
            [355.0, 365.0, 370.0, 355.0]
        );
    }

    #[test]
    fn a_slope_and_its_integral_are_each_others_inverse() {
        let rate = 1000.0;
        let position: Vec<f64> = (0..4000)
            .map(|k| (2.0 * PI * 3.0 * f64::from(k) / rate).sin())
            .collect();
        let speed = slope(&position, rate);
        let again = integral(&speed, rate);
        let worst = (100..3900)
            .map(|k| (again[k] - again[100] - position[k] + position[100]).abs())
            .fold(0.0, f64::max);
        assert!(worst < 2e-3, "{worst}");
    }
}
