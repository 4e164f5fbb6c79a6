//! The figures that the tool is held to, on the data beside the project.

use crate::analysis::{Outcome, analyse};
use crate::{emps, laas, paper};
use plant::model::Model;
use plant::recording::Recording;
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

/// Machines of the shared recordings.
const MACHINES: u32 = 10;
/// Values may be off by this share.
const TOLERANCE: f64 = 0.15;

/// The folder beside the project that holds recordings and measured data: `$DDFEED_SHARED`, or `../shared`.
pub fn shared() -> std::path::PathBuf {
    std::env::var_os("DDFEED_SHARED").map_or_else(|| "../shared".into(), Into::into)
}

/// Whether an expected list of effects (`kind`, `where`, and parameters, here or under `parameters`) is what was found.
fn right(expected: &[Value], outcome: &Outcome) -> bool {
    let one = |wanted: &Value, found: &crate::analysis::Found| {
        let value = |name: &str| {
            wanted
                .get(name)
                .or_else(|| wanted.get("parameters")?.get(name))
        };
        let text = |name: &str| value(name).and_then(Value::as_str);
        text("kind") == Some(found.effect.effect().kind())
            && text("where") == Some(found.effect.place().name())
            && found
                .effect
                .effect()
                .parameters()
                .iter()
                .all(|(name, ours)| match value(name).and_then(Value::as_f64) {
                    Some(theirs) if name == "order" => (ours - theirs).abs() <= 0.02 * theirs,
                    Some(theirs) if name != "phase" => {
                        (ours - theirs).abs() <= TOLERANCE * theirs.abs()
                    }
                    _ => true,
                })
    };
    expected.len() == outcome.effects.len()
        && expected
            .iter()
            .all(|w| outcome.effects.iter().any(|f| one(w, f)))
}

/// Runs everything. `answers` judges the shared recordings, `blind` is what the blind test wrote; without them their
/// counts are null. What is not there is skipped and named on standard error.
pub fn run(folder: &Path, answers: Option<&Path>, blind: Option<&Path>) -> Value {
    let read = |path: &Path| -> Option<Value> {
        serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok()
    };
    let answers = answers.and_then(read);
    let (mut correct, mut of, mut seconds, mut named) = (0, 0, 0.0, Vec::new());
    for k in 1..=MACHINES {
        let name = format!("open-{k:02}");
        let at = folder.join("recordings").join(&name);
        let start = Instant::now();
        let (Ok(model), Ok(fit), Ok(check)) = (
            Model::load(&at.join("model.toml")),
            Recording::load(&at.join("fit.csv.gz")),
            Recording::load(&at.join("check.csv.gz")),
        ) else {
            eprintln!("skipped: {} is not there", at.display());
            continue;
        };
        let outcome = analyse(&model, &fit, &check);
        seconds += start.elapsed().as_secs_f64();
        of += 1;
        let expected = answers.as_ref().and_then(|all| {
            let own = all.get(&name)?;
            own.as_array().or_else(|| own.get("effects")?.as_array())
        });
        correct += u32::from(expected.is_some_and(|expected| right(expected, &outcome)));
        named.push(json!({ "machine": name, "report": crate::report::json(&outcome)["effects"] }));
    }
    json!({
        "open": { "right": answers.as_ref().map(|_| correct), "of": of, "found": named },
        "blind": blind.and_then(read).unwrap_or(json!({ "right": null, "of": null, "false_alarms": null, "clean": null })),
        "emps": emps_figures(&folder.join("measured/emps")),
        "laas": laas_figures(&folder.join("measured/laas")),
        "paper": paper_figures(),
        "seconds_per_recording": if of > 0 { json!(seconds / f64::from(of)) } else { Value::Null },
    })
}

fn emps_figures(folder: &Path) -> Value {
    let load = |name: &str| emps::Record::load(&folder.join(name));
    let (estimate, test) = match (load("DATA_EMPS.mat"), load("DATA_EMPS_PULSES.mat")) {
        (Ok(estimate), Ok(test)) => (estimate, test),
        (Err(error), _) | (_, Err(error)) => {
            eprintln!("skipped: {error}");
            return Value::Null;
        }
    };
    let study = emps::Study::new(&estimate, &test);
    let figures = |errors: &emps::Errors| {
        json!({
            "force_percent": errors.force_percent,
            "velocity_percent": errors.velocity_percent,
            "position_um": errors.position_um,
        })
    };
    let (Some(first), Some(last)) = (study.stages.first(), study.stages.last()) else {
        return Value::Null;
    };
    // Without homing, what repeats with the screw has no phase on the test file: the model before it.
    let unhomed = study.stages.iter().rev().find(|s| {
        !s.axis
            .terms
            .iter()
            .any(|(t, _)| matches!(t, emps::Term::Periodic(_)))
    });
    json!({
        "published": figures(&first.test),
        "ours": unhomed.map(|stage| figures(&stage.test)),
        "ours_homed": figures(&last.homed),
        "published_inverse_percent": study.inverse_percent,
        "stages": study.stages.iter().map(|stage| json!({
            "added": stage.added,
            "estimate": figures(&stage.estimate),
            "test": figures(&stage.test),
            "homed": figures(&stage.homed),
        })).collect::<Vec<_>>(),
    })
}

fn laas_figures(folder: &Path) -> Value {
    match laas::Study::new(folder) {
        Ok(study) => json!({
            "before_percent": study.before_percent,
            "after_percent": study.after_percent,
            "orders": study.orders.iter().map(|o| json!({
                "order": o.order, "amplitude_a": o.amplitude_a, "suggests": o.suggests(),
            })).collect::<Vec<_>>(),
        }),
        Err(error) => {
            eprintln!("skipped: {error}");
            Value::Null
        }
    }
}

fn paper_figures() -> Value {
    let study = paper::Study::new(&Model::paper());
    json!({
        "model": study.model,
        "measured": paper::MEASURED,
        "rms_points": study.rms,
        "attempts": study.attempts.iter().map(|a| json!({
            "effect": a.name, "size": a.size, "unit": a.unit, "in_sample": a.in_sample, "leave_one_out": a.leave_one_out,
        })).collect::<Vec<_>>(),
        "sentence": study.sentence(),
    })
}
