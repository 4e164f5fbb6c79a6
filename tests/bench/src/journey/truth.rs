//! What was commissioned and identified, beside the truth.

use anyhow::{Context, Result};
use plant::Axis;
use plant::model::Model;
use serde_json::Value;
use std::fs;
use std::path::Path;

/// The effects that `identify` named, and the commissioned values that it moved away from the truth.
pub fn worse_values(real: &Model, folder: &Path) -> Result<(Vec<String>, Vec<String>)> {
    let report = fs::read_to_string(folder.join("out/report.json"))?;
    let report: Value = serde_json::from_str(&report)?;
    let effects = report["effects"]
        .as_array()
        .context("the report has no effects")?;
    let word = |effect: &Value, key: &str| effect[key].as_str().unwrap_or_default().to_owned();
    let named = effects
        .iter()
        .map(|effect| format!("{} ({})", word(effect, "kind"), word(effect, "where")))
        .collect();
    let commissioned = Model::load(&folder.join("found/model.toml"))?;
    let identified = Model::load(&folder.join("out/model.toml"))?;
    let worse = values(real)
        .into_iter()
        .zip(values(&commissioned))
        .zip(values(&identified))
        .zip(intervals(&commissioned))
        .filter_map(|((((name, truth), (_, before)), (_, after)), half)| {
            let off = |value: f64| (value / truth - 1.0).abs();
            let moved = (after / before - 1.0).abs();
            (off(after) > off(before) && moved > half).then(|| {
                format!(
                    "{name} {:.3} to {:.3} %",
                    100.0 * off(before),
                    100.0 * off(after)
                )
            })
        })
        .collect();
    Ok((named, worse))
}

/// Of each value, the half of its commissioned interval, relative: beyond it, a value that is further from the truth is worse. Digits of
/// the model's text are allowed for.
fn intervals(commissioned: &Model) -> Vec<f64> {
    let Some(measured) = &commissioned.measured else {
        return vec![0.0; 8];
    };
    [measured.screw, measured.nut]
        .into_iter()
        .flat_map(|motor| {
            [
                motor.resistance,
                motor.inductance,
                motor.flux,
                motor.inertia,
            ]
        })
        .map(|half| half.max(1e-5) * (1.0 + 1e-9))
        .collect()
}

/// What commissioning measures of the motors.
fn values(model: &Model) -> Vec<(String, f64)> {
    Axis::ALL
        .into_iter()
        .flat_map(|axis| {
            let motor = model.motor(axis);
            [
                ("resistance", motor.resistance_ohm),
                ("inductance", motor.inductance_h),
                ("flux", motor.flux_wb),
                ("inertia", motor.inertia_kg_m2),
            ]
            .map(|(name, value)| (format!("{}'s {name}", axis.name()), value))
        })
        .collect()
}
