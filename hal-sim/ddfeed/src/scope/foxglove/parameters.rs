//! Settings as Foxglove's parameters: numbers as numbers, choices as their words.

use anyhow::{Context, Result, bail};
use foxglove::websocket::{Parameter, ParameterValue};
use link::host::settings::of_words;
use link::settings::{Settings, Value};

/// The settings of these names, in the schema's order; of none: all.
pub fn of(settings: &Settings, names: &[String]) -> Vec<Parameter> {
    Settings::all()
        .filter_map(|setting| {
            let name = setting.to_string();
            if !names.is_empty() && !names.contains(&name) {
                return None;
            }
            Some(match settings.get(setting.id)? {
                Value::Real(value) => Parameter::float64(name, value),
                Value::Whole(value) => Parameter::integer(name, value.into()),
                value @ Value::Choice(_) => {
                    Parameter::string(name, value.shown(setting).to_string())
                }
            })
        })
        .collect()
}

/// `settings` with these values.
///
/// # Errors
/// A name or a value that is not possible.
pub fn changed(settings: &Settings, parameters: &[Parameter]) -> Result<Settings> {
    let mut new = *settings;
    for Parameter { name, value, .. } in parameters {
        let word = match value {
            Some(ParameterValue::Float64(value)) => value.to_string(),
            Some(ParameterValue::Integer(value)) => value.to_string(),
            Some(ParameterValue::String(word)) => word.clone(),
            Some(ParameterValue::Bool(on)) => if *on { "on" } else { "off" }.to_owned(),
            _ => bail!("{name} has no value that a setting can have: give a number or a word"),
        };
        let (setting, value) = of_words(name, &word)?;
        new.set(setting.id, value)
            .with_context(|| format!("{name} was not set"))?;
    }
    Ok(new)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_come_back_as_they_were_shown() {
        let settings = Settings::DEFAULT;
        let all = of(&settings, &[]);
        assert_eq!(all.len(), Settings::all().count());
        assert_eq!(changed(&settings, &all).unwrap(), settings);
        let lead = of(&settings, &["feed.lead_mm".to_owned()]);
        assert_eq!(
            lead,
            [Parameter::float64("feed.lead_mm", settings.feed.lead_mm)]
        );
    }

    #[test]
    fn what_no_setting_can_be_is_refused() {
        let refused = |parameter: Parameter| {
            let error = changed(&Settings::DEFAULT, &[parameter]).unwrap_err();
            format!("{error:#}")
        };
        assert!(refused(Parameter::float64("feed.lead", 5.0)).contains("feed.lead"));
        let negative = refused(Parameter::float64("feed.lead_mm", -5.0));
        assert!(negative.contains("feed.lead_mm"), "{negative}");
        let empty = refused(Parameter::empty("feed.lead_mm"));
        assert!(empty.contains("no value"), "{empty}");
    }
}
