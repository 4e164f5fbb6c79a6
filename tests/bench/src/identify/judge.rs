//! Whether what was found on a machine is what it has. The answers are read to judge, by who runs the bench.

use identify::analysis::{Found, Outcome};
use serde_json::Value;

/// Values may be off by this share.
const TOLERANCE: f64 = 0.15;
/// Orders and frequencies by this.
const SAME_LINE: f64 = 0.02;

/// Whether the machine `name` was told right; `None` if the answers do not say what it has. They may be an object by the
/// machines' names or a list of entries that name theirs, itself or below one key; an entry is a list of effects or has
/// one as `effects`.
pub fn right(answers: &Value, name: &str, outcome: &Outcome) -> Option<bool> {
    let expected = effects_of(answers, name)?;
    Some(
        expected.len() == outcome.effects.len()
            && expected
                .iter()
                .all(|wanted| outcome.effects.iter().any(|found| same(wanted, found))),
    )
}

fn effects_of<'a>(answers: &'a Value, name: &str) -> Option<&'a Vec<Value>> {
    let number = name.rsplit('-').next().unwrap_or(name);
    let is_it = |text: &str| text == name || text == number;
    let list = |entry: &'a Value| {
        entry.as_array().or_else(|| {
            ["effects", "undeclared", "has"]
                .iter()
                .find_map(|key| entry.get(key)?.as_array())
        })
    };
    match answers {
        Value::Object(all) => all
            .iter()
            .find(|(key, _)| is_it(key))
            .and_then(|(_, entry)| list(entry))
            .or_else(|| {
                all.values()
                    .filter(|below| below.is_object() || below.is_array())
                    .find_map(|below| effects_of(below, name))
            }),
        Value::Array(entries) => entries
            .iter()
            .find(|entry| {
                ["machine", "name", "recording", "folder", "id"]
                    .iter()
                    .filter_map(|key| entry.get(key)?.as_str())
                    .any(is_it)
            })
            .and_then(list),
        _ => None,
    }
}

fn same(wanted: &Value, found: &Found) -> bool {
    let value = |name: &str| {
        wanted
            .get(name)
            .or_else(|| wanted.get("parameters")?.get(name))
    };
    let text = |name: &str| value(name).and_then(Value::as_str);
    let close = |(name, ours): &(String, f64)| {
        let Some(theirs) = value(name).and_then(Value::as_f64) else {
            return true;
        };
        let line =
            name == "order" || (name == "hz" && found.effect.effect().kind() == "time_periodic");
        match name.as_str() {
            "phase" | "duration_s" => true,
            _ if line => (ours - theirs).abs() <= SAME_LINE * theirs.abs(),
            _ => (ours - theirs).abs() <= TOLERANCE * theirs.abs(),
        }
    };
    text("kind") == Some(found.effect.effect().kind())
        && text("where") == Some(found.effect.place().name())
        && found.effect.effect().parameters().iter().all(close)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn answers_are_found_in_any_of_the_shapes() {
        let effects = json!([{ "kind": "cogging" }]);
        for answers in [
            json!({ "open-03": effects, "open-04": [] }),
            json!({ "machines": { "03": { "effects": effects } } }),
            json!([{ "name": "open-03", "effects": effects }]),
        ] {
            let found = effects_of(&answers, "open-03").expect("an entry");
            assert_eq!(found.len(), 1);
            assert!(effects_of(&answers, "open-07").is_none());
        }
        let clean = json!({ "open-03": [] });
        assert!(effects_of(&clean, "open-03").expect("an entry").is_empty());
    }
}
