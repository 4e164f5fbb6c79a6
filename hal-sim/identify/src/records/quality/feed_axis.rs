//! What an axis' channels say of each other: position and reference, force and motion.

use super::motor::made_by;
use super::regress::{fit, rms};
use super::{Finding, Limits};
use crate::records::Record;

/// Length of the stretches that are averaged, s.
const BLOCK_S: f64 = 0.02;

pub(super) fn check(record: &Record, mass_kg: f64, limits: &Limits, found: &mut Vec<Finding>) {
    let position = record.channel("position_m");
    let length = ((BLOCK_S * record.rate) as usize).max(2);
    let blocks: Vec<usize> = (0..position.len().saturating_sub(length))
        .step_by(length)
        .collect();
    let mean = |values: &[f64]| -> Vec<f64> {
        let of = |from: &usize| values[*from..from + length].iter().sum::<f64>() / length as f64;
        blocks.iter().map(of).collect()
    };
    let centred = |values: &[f64]| -> Vec<f64> {
        let values = mean(values);
        let middle = values.iter().sum::<f64>() / values.len().max(1) as f64;
        values.into_iter().map(|v| v - middle).collect()
    };
    let moved = centred(position);
    if let Some(reference) = record.get("reference_m") {
        let asked = centred(reference);
        if let Some(own) = fit(std::slice::from_ref(&asked), &moved).filter(|_| rms(&asked) > 1e-6)
        {
            let ratio = own.values[0];
            if own.explained < limits.speed_explained || !limits.follow_ratio.contains(&ratio) {
                let how = match own.explained > limits.fixed {
                    true => format!(
                        "moves {ratio:.4} times as far as `reference_m`, expected once{}",
                        made_by(ratio)
                    ),
                    false => format!(
                        "does not follow `reference_m` ({:.0} % explained, expected more than {:.0} %)",
                        100.0 * own.explained.max(0.0),
                        100.0 * limits.speed_explained
                    ),
                };
                found.push(Finding::new(
                    "follow",
                    &["position_m", "reference_m"],
                    [ratio, *limits.follow_ratio.end()],
                    format!("`position_m` {how}: give units or signs in a mapping file; are they the right columns?"),
                ));
                return;
            }
        }
    }
    force(record, mass_kg, &blocks, length, limits, found);
}

/// Force by mass, friction and offset.
fn force(
    record: &Record,
    mass_kg: f64,
    blocks: &[usize],
    length: usize,
    limits: &Limits,
    found: &mut Vec<Finding>,
) {
    let position = record.channel("position_m");
    let scale = record.constant("force_per_volt_n").unwrap_or(f64::NAN);
    let measured: Vec<f64> = match (record.get("force_n"), record.get("output_v")) {
        (Some(force), _) => force.to_vec(),
        (None, Some(output)) if scale.is_finite() => output.iter().map(|v| v * scale).collect(),
        _ => return,
    };
    let seconds = length as f64 / record.rate;
    let speed: Vec<f64> = blocks
        .iter()
        .map(|from| (position[from + length] - position[*from]) / seconds)
        .collect();
    let top = speed.iter().fold(0.0, |top: f64, v| top.max(v.abs()));
    let inner = 1..speed.len().saturating_sub(1);
    let force: Vec<f64> = inner
        .clone()
        .map(|k| measured[blocks[k]..blocks[k] + length].iter().sum::<f64>() / length as f64)
        .collect();
    let acceleration: Vec<f64> = inner
        .clone()
        .map(|k| mass_kg * (speed[k + 1] - speed[k - 1]) / (2.0 * seconds))
        .collect();
    if rms(&acceleration) < 0.1 * rms(&force) && rms(&acceleration) < 10.0 * rms(&force) {
        return;
    }
    let columns = [
        acceleration,
        inner
            .clone()
            .map(|k| (speed[k] / (0.01 * top)).tanh())
            .collect(),
        inner.clone().map(|k| speed[k]).collect(),
        vec![1.0; force.len()],
    ];
    let Some(own) = fit(&columns, &force) else {
        return;
    };
    let (ratio, error) = (own.values[0], limits.sigmas * own.errors[0]);
    let range = &limits.mass_ratio;
    if ratio + error > *range.start() && ratio - error < *range.end() {
        return;
    }
    let sentence = match ratio < 0.0 {
        true => "the force works against the acceleration, expected with it: the sign of the output or of the position is \
                 reversed; give it the scale -1 in a mapping file"
            .to_owned(),
        false => format!(
            "force and acceleration give a mass of {:.3} kg, but the model declares {mass_kg:.3} kg, a factor of {ratio:.3} (expected \
             {:.2} to {:.1}); correct mass_kg or force_per_volt_n, or the units of position and output",
            ratio * mass_kg,
            range.start(),
            range.end()
        ),
    };
    found.push(Finding::new(
        "mass",
        &["position_m", "output_v"],
        [ratio, *range.end()],
        sentence,
    ));
}
