//! Identification of two recordings on the page, and the settings that compensate what it finds.

use anyhow::{Context, Result, ensure};
use hal_sim::boards::BoardKind;
use hal_sim::experiment::{CHECK, FIT, HELD_S};
use hal_sim::smooth::kept::{compensated, leave_out_lost};
use hal_sim::smooth::known::Known;
use identify::analysis::analyse;
use identify::records::DataQuality;
use identify::report::traced;
use link::settings::{Settings, Value as SettingValue};
use plant::model::Model;
use plant::recording::{AxisSample, Recording, Sample};
use serde_json::{Map, Value, json};

/// Values of a recorded row: time, seven of each motor, the table.
pub const ROW: usize = 16;
/// Shortest recording, rows.
const SHORTEST: usize = 1000;

/// A row as numbers.
#[must_use]
pub fn numbers(sample: &Sample) -> [f64; ROW] {
    let mut row = [0.0; ROW];
    row[0] = sample.time_s;
    for (part, axis) in row[1..ROW - 1].chunks_exact_mut(7).zip(&sample.axes) {
        part.copy_from_slice(&[
            axis.angle_rad,
            axis.ia_a,
            axis.ib_a,
            axis.ud_v,
            axis.uq_v,
            axis.iq_ref_a,
            axis.speed_ref_rad_s,
        ]);
    }
    row[ROW - 1] = sample.table_position_m;
    row
}

fn recording(rows: &[f64], name: &str) -> Result<Recording> {
    let mut recording = Recording::default();
    for row in rows.as_chunks::<ROW>().0 {
        let axis = |at: usize| AxisSample {
            angle_rad: row[at],
            ia_a: row[at + 1],
            ib_a: row[at + 2],
            ud_v: row[at + 3],
            uq_v: row[at + 4],
            iq_ref_a: row[at + 5],
            speed_ref_rad_s: row[at + 6],
        };
        recording.push(&Sample {
            time_s: row[0],
            axes: [axis(1), axis(8)],
            table_position_m: row[ROW - 1],
        });
    }
    ensure!(
        recording.len() >= SHORTEST,
        "The {name} recording has {} rows, but at least {SHORTEST} are needed.",
        recording.len()
    );
    Ok(recording)
}

/// Operating points of a recording: table velocity, mm/s, and common speed, rpm, each held for `held_s`.
#[must_use]
pub fn operating_points() -> Value {
    json!({ "fit": FIT, "check": CHECK, "held_s": HELD_S })
}

/// Identifies what two recordings have beyond the declared model. Gives `report` and `model`, the new model file.
///
/// # Errors
/// The model cannot be read, or a recording is too short.
pub fn identify(declared: &str, fit: &[f64], check: &[f64]) -> Result<Value> {
    let mut declared = Model::parse(declared, "the declared model")?;
    let (fit, check) = (recording(fit, "fit")?, recording(check, "check")?);
    let seconds = fit.time_s[fit.len() - 1] - fit.time_s[0];
    declared.sensing.sample_hz = (fit.len() - 1) as f64 / seconds;
    let outcome = analyse(&declared, &fit, &check);
    let quality = |recording: &Recording, file: &str| DataQuality {
        file: file.to_owned(),
        rows: recording.len(),
        used: recording.len(),
        ..DataQuality::default()
    };
    let report = traced(&outcome, [quality(&fit, "fit"), quality(&check, "check")]);
    Ok(json!({
        "report": serde_json::to_value(&report).context("the report is no JSON")?,
        "model": report.model,
    }))
}

/// Settings that compensate what a model has: those that differ from `held`, and the effects that no setting compensates.
///
/// # Errors
/// The model cannot be read.
pub fn compensation(model: &str, held: &Settings) -> Result<Value> {
    let model = Model::parse(model, "the model")?;
    let mut known = Known::of(&model);
    leave_out_lost(&model, &mut known);
    // The board's constants are not among the settings that compensate.
    let plain = held.plate(&BoardKind::Mains.plate().board);
    let new = Settings::of_plate(&compensated(&plain, &known));
    let mut settings = Map::new();
    for setting in Settings::all().filter(|setting| setting.compensates()) {
        let (old, value) = (held.get(setting.id), new.get(setting.id));
        if let Some(value) = value.filter(|value| old != Some(*value)) {
            settings.insert(setting.to_string(), text(value, &setting).into());
        }
    }
    Ok(json!({ "settings": settings, "not_compensated": known.left }))
}

fn text(value: SettingValue, setting: &link::settings::Setting) -> String {
    match value {
        // All digits: a shown value is rounded.
        SettingValue::Real(x) => format!("{x:?}"),
        other => other.shown(*setting).to_string(),
    }
}
