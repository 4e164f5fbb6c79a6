//! What was found, as files: `report.json`, `model.toml`, `residual.csv`, `report.html`.

use crate::analysis::Outcome;
use crate::interval::estimates;
use crate::select::Trial;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

/// Why the files could not be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The folder could not be made.
    #[error("{}: cannot make the output folder: {source}; choose one that can be written", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A file could not be written.
    #[error("{}: cannot write: {source}; choose a folder that can be written", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
}

/// Writes all files into `folder`, which is made if it is not there.
///
/// # Errors
/// A folder or file that cannot be written.
pub fn write(outcome: &Outcome, folder: &Path) -> Result<(), WriteError> {
    std::fs::create_dir_all(folder).map_err(|source| WriteError::Folder {
        path: folder.to_owned(),
        source,
    })?;
    let file = |name: &str, text: String| {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|source| WriteError::File { path, source })
    };
    let mut text = serde_json::to_string_pretty(&json(outcome)).expect("a JSON value has a text");
    text.push('\n');
    file("report.json", text)?;
    file("model.toml", outcome.model.to_toml())?;
    file("residual.csv", residual_csv(outcome))?;
    file("report.html", crate::html::page(outcome))
}

/// `report.json`.
pub fn json(outcome: &Outcome) -> Value {
    let effects: Vec<Value> = outcome
        .effects
        .iter()
        .map(|found| {
            let estimates = estimates(found);
            let (mut parameters, mut intervals) = (Map::new(), Map::new());
            let mut effect = Map::new();
            effect.insert("kind".into(), found.effect.effect().kind().into());
            effect.insert("where".into(), found.effect.place().name().into());
            for estimate in estimates {
                if estimate.name == "order" || estimate.name == "hz" {
                    effect.insert(estimate.name.clone(), estimate.value.into());
                }
                intervals.insert(estimate.name.clone(), json!(estimate.interval));
                parameters.insert(estimate.name, estimate.value.into());
            }
            effect.insert("parameters".into(), parameters.into());
            effect.insert("interval".into(), intervals.into());
            effect.insert("explained".into(), found.explained.into());
            effect.insert(
                "fall".into(),
                json!({ "fit": found.fall, "check": found.check_fall }),
            );
            effect.insert("held_back".into(), json!(found.held_back));
            effect.insert("rivals".into(), found.rivals.iter().map(trial).collect());
            effect.into()
        })
        .collect();
    let residual: Vec<Value> = outcome
        .channels
        .iter()
        .map(|figures| {
            json!({
                "channel": figures.channel.name(),
                "unit": figures.channel.unit(),
                "fit_before": figures.fit_before,
                "fit_after": figures.fit_after,
                "check_before": figures.check_before,
                "check_after": figures.check_after,
                "noise_floor": figures.noise_floor,
                "whitened": figures.whitened,
                "whiteness": figures.whiteness,
            })
        })
        .collect();
    let unexplained: Vec<Value> = outcome
        .unexplained
        .iter()
        .map(|left| {
            json!({
                "channel": left.channel,
                "coordinate": left.coordinate,
                "order": left.order,
                "size": left.size,
                "reason": left.reason,
            })
        })
        .collect();
    let calibration: Vec<Value> = outcome
        .calibration
        .iter()
        .map(|(name, change, sigma)| {
            json!({
                "parameter": name, "relative_change": change, "sigma": sigma,
            })
        })
        .collect();
    json!({
        "verdict": outcome.verdict(),
        "effects": effects,
        "residual": residual,
        "unexplained": unexplained,
        "calibration": calibration,
        "selection": {
            "tried": outcome.tried,
            "threshold": outcome.threshold,
            "next": outcome.last.iter().take(8).map(trial).collect::<Vec<_>>(),
        },
    })
}

fn trial(trial: &Trial) -> Value {
    json!({
        "family": trial.hypothesis.name(),
        "where": trial.hypothesis.place.name(),
        "shape": trial.hypothesis.shape,
        "fall": trial.gain.fall,
    })
}

fn residual_csv(outcome: &Outcome) -> String {
    let mut text = String::from("t_s");
    for (channel, ..) in &outcome.residuals {
        let name = channel.name().replace(' ', "_");
        let unit = channel.unit().replace(' ', "").to_lowercase();
        text.push_str(&format!(",{name}_before_{unit},{name}_after_{unit}"));
    }
    text.push('\n');
    for (row, time) in outcome.coordinates.time.iter().enumerate() {
        text.push_str(&format!("{time:.4}"));
        for (_, before, after) in &outcome.residuals {
            for side in [before, after] {
                text.push_str(&format!(",{:.4e}", side.get(row).copied().unwrap_or(0.0)));
            }
        }
        text.push('\n');
    }
    text
}
