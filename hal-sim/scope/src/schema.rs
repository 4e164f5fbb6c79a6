//! Settings and injected faults as lists for the page.

use link::message::Injected;
use link::settings::{Effect, Kind, Setting, Settings};
use serde_json::{Value, json};

/// All settings: number, name, unit, range, default, documentation and when a change takes effect.
#[must_use]
pub fn settings() -> Value {
    Settings::all().map(|setting| one(&setting)).collect()
}

fn one(setting: &Setting) -> Value {
    let default = Settings::DEFAULT
        .get(setting.id)
        .map(|value| value.shown(*setting).to_string());
    let kind = match setting.kind() {
        Kind::Real(range) => json!({ "real": range }),
        Kind::Whole(range) => json!({ "whole": range }),
        Kind::Choice(words) => json!({ "choice": words }),
    };
    json!({
        "id": setting.id,
        "name": setting.to_string(),
        "group": setting.group(),
        "unit": setting.unit(),
        "doc": setting.doc().to_string(),
        "effect": match setting.effect() {
            Effect::AtOnce => "at once",
            Effect::AtRest => "at rest",
            Effect::Restart => "after a restart",
        },
        "default": default,
        "kind": kind,
    })
}

/// Faults that a simulated drive can be given.
#[must_use]
pub fn injections() -> Value {
    Injected::ALL
        .iter()
        .map(|fault| {
            json!({
                "name": fault.name(),
                "sentence": fault.sentence(),
                "unit": fault.unit(),
                "range": fault.range(),
                "motor": fault.has_motor(),
            })
        })
        .collect()
}
