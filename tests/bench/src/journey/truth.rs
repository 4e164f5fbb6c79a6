//! What was commissioned and identified, beside the truth.

use anyhow::{Context, Result};
use plant::Axis;
use plant::model::Model;
use serde_json::Value;
use std::fs;
use std::path::Path;

/// A value is worse where it is further from the truth than before by more than this part of the truth.
const WORSE: f64 = 2e-3;

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
        .filter_map(|(((name, truth), (_, before)), (_, after))| {
            let off = |value: f64| (value / truth - 1.0).abs();
            (off(after) > off(before) + WORSE).then(|| {
                format!(
                    "{name} {:.2} to {:.2} %",
                    100.0 * off(before),
                    100.0 * off(after)
                )
            })
        })
        .collect();
    Ok((named, worse))
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
