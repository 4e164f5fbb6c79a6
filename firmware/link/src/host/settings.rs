//! Settings as a TOML file.

use crate::settings::datasheet::{spelled, spellings};
use crate::settings::{Kind, Setting, Settings, Value};
use anyhow::{Context, Result, bail, ensure};
use std::collections::HashMap;
use std::fmt::Write;
use toml::{Table, Value as Toml};

/// As the text of a TOML file: each group a table, each setting with what it means, its unit and its range.
#[must_use]
pub fn to_toml(settings: &Settings) -> String {
    some_to_toml(settings, |_| true)
}

/// The same of some settings.
#[must_use]
pub fn some_to_toml(settings: &Settings, some: impl Fn(&Setting) -> bool) -> String {
    let mut text = String::from(
        "# Settings of a drive. What is left out of a file keeps its value when the file is imported.\n",
    );
    let mut group = "";
    for setting in Settings::all().filter(some) {
        let Some(value) = settings.get(setting.id) else {
            continue;
        };
        // Writing to a string does not fail.
        if setting.group() != group {
            group = setting.group();
            let _ = write!(text, "\n[{group}]\n");
        }
        let _ = writeln!(
            text,
            "# {} ({} possible)",
            setting.doc(),
            setting.possible()
        );
        let _ = writeln!(text, "{} = {}", setting.name(), written(setting, value));
    }
    text
}

/// A value as TOML has it.
#[must_use]
pub fn written(setting: Setting, value: Value) -> String {
    match value {
        Value::Real(x) => Toml::Float(x).to_string(),
        Value::Whole(x) => x.to_string(),
        Value::Choice(_) => format!("\"{}\"", value.shown(setting)),
    }
}

/// What the text of a TOML file makes of `settings`; what it leaves out stays.
///
/// # Errors
/// The first value that is no setting, of another kind or beyond its range, by its name.
pub fn of_toml(settings: &Settings, text: &str) -> Result<Settings> {
    let file: Table = toml::from_str(text)?;
    let (mut new, mut said) = (*settings, HashMap::new());
    for (group, entries) in &file {
        let Toml::Table(entries) = entries else {
            bail!("`{group}` is no group of settings: settings stand in groups, as [{group}]");
        };
        for (name, value) in entries {
            let name = format!("{group}.{name}");
            let (setting, value) = read(&name, value)?;
            if let Some(before) = said.insert(setting.id, name.clone()) {
                bail!("{before} and {name} say the same: leave one out");
            }
            new.set(setting.id, value)?;
        }
    }
    Ok(new)
}

/// A setting and its value, of a name and what a person wrote for it.
///
/// # Errors
/// There is no such setting, or its value is of another kind or beyond its range.
pub fn of_words(name: &str, value: &str) -> Result<(Setting, Value)> {
    let quoted = || Toml::String(value.to_owned());
    let value = match value.parse::<i64>() {
        Ok(whole) => Toml::Integer(whole),
        Err(_) => value.parse::<f64>().map_or_else(|_| quoted(), Toml::Float),
    };
    let (setting, value) = read(name, &value)?;
    setting.check(value)?;
    Ok((setting, value))
}

fn read(name: &str, value: &Toml) -> Result<(Setting, Value)> {
    let (setting, factor) = spelled(name).with_context(|| unknown(name))?;
    let taken = match (setting.kind(), value) {
        (Kind::Real(_), Toml::Float(x)) => Some(Value::Real(x * factor)),
        // A whole number is a convenient way to write it.
        (Kind::Real(_), Toml::Integer(x)) => Some(Value::Real(*x as f64 * factor)),
        (Kind::Whole(_), Toml::Integer(x)) => u32::try_from(*x).ok().map(Value::Whole),
        (Kind::Choice(words), Toml::String(word)) => choice(words, word),
        (Kind::Choice(words), Toml::Boolean(on)) => choice(words, if *on { "on" } else { "off" }),
        _ => None,
    };
    let value =
        taken.with_context(|| format!("{name} is {value}, but {} possible", setting.possible()))?;
    if factor != 1.0 {
        let checked = setting.check(value);
        ensure!(
            checked.is_ok(),
            "{name} makes {setting} = {}, but {} possible",
            value.shown(setting),
            setting.possible()
        );
    }
    Ok((setting, value))
}

/// One of several words. Where these are `off` and `on`, other words for them count too.
fn choice(words: &[&str], word: &str) -> Option<Value> {
    let on_or_off = words.contains(&"on") && words.contains(&"off");
    let word = match word {
        "yes" | "true" if on_or_off => "on",
        "no" | "false" if on_or_off => "off",
        other => other,
    };
    let place = words.iter().position(|known| *known == word)?;
    u8::try_from(place).ok().map(Value::Choice)
}

/// That there is no such setting. Names what is spelled most like it, in the same group where there is that group.
fn unknown(name: &str) -> String {
    let group = name.split_once('.').map(|(group, _)| group);
    let known = || {
        let settings = Settings::all().map(|setting| setting.to_string());
        settings.chain(spellings().map(|(name, ..)| name))
    };
    let in_group = |known: &String| known.split_once('.').map(|(group, _)| group) == group;
    let is_group = known().any(|known| in_group(&known));
    let mut near: Vec<(usize, String)> = known()
        .filter(|known| !is_group || in_group(known))
        .map(|known| (unlike(&known, name), known))
        .collect();
    near.sort();
    near.truncate(3);
    let names: Vec<String> = near.into_iter().map(|(_, name)| name).collect();
    let all = group.filter(|_| is_group).unwrap_or_default();
    let all = if all.is_empty() {
        String::new()
    } else {
        format!(" {all}")
    };
    format!(
        "there is no setting {name}: the nearest are {}. `settings get{all}` prints all",
        names.join(", ")
    )
}

/// How unlike two names are: letters that change, less those of the words that they share.
fn unlike(known: &str, name: &str) -> usize {
    let words: Vec<&str> = name.split(['.', '_']).collect();
    let shared: usize = known
        .split(['.', '_'])
        .filter(|word| words.contains(word))
        .map(str::len)
        .sum();
    (distance(known, name) + 4 * name.len()).saturating_sub(4 * shared)
}

/// Changes of a letter from one name to the other (Levenshtein).
fn distance(a: &str, b: &str) -> usize {
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.bytes().enumerate() {
        let mut corner = i;
        row[0] = i + 1;
        for (j, y) in b.bytes().enumerate() {
            let change = corner + usize::from(x != y);
            corner = row[j + 1];
            row[j + 1] = change.min(corner + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn refused(text: &str) -> String {
        format!("{:#}", of_toml(&Settings::DEFAULT, text).unwrap_err())
    }

    #[test]
    fn an_export_is_read_back_as_it_was() {
        let mut settings = Settings::DEFAULT;
        settings.screw.pole_pairs = 4;
        settings.feed.lead_mm = 0.1 + 0.2;
        settings.watch.over_speed_ms = 1e3;
        let text = to_toml(&settings);
        assert_eq!(of_toml(&Settings::DEFAULT, &text).unwrap(), settings);
    }

    #[test]
    fn a_file_changes_what_it_names() {
        let text = "[feed]\nlead_mm = 10\n[nut]\nencoder_direction = \"backwards\"\n";
        let settings = of_toml(&Settings::DEFAULT, text).unwrap();
        assert_eq!(settings.feed.lead_mm, 10.0);
        assert_eq!(settings.differences(&Settings::DEFAULT).count(), 2);
        assert_eq!(settings.screw, Settings::DEFAULT.screw);
    }

    /// A motor of the default board, as its manual prints it (Teknic Hudson M-2331P: 0.61 ohm, 0.89 mH between leads, 13.65 V
    /// peak per 1000 rpm).
    #[test]
    fn a_datasheet_s_figures_go_in_as_they_are_printed() {
        let text = "[screw]\nresistance_line_to_line_ohm = 0.61\ninductance_line_to_line_mh = 0.89\n\
                    voltage_constant_v_peak_per_krpm = 13.65\npole_pairs = 4\n";
        let settings = of_toml(&Settings::DEFAULT, text).unwrap();
        let volts = settings.screw.voltage_constant_v_rms_per_krpm;
        let expected = 13.65 / 2f64.sqrt();
        assert!(
            (volts / expected - 1.0).abs() < 1e-12,
            "measured {volts} V/krpm, expected {expected}"
        );
    }

    #[test]
    fn what_is_wrong_is_named_with_what_is_possible() {
        for (text, said) in [
            ("[feed]\nlead_mm = -5", "feed.lead_mm is -5, but 0.01 to"),
            (
                "[feed]\nlead_mm = \"five\"",
                "feed.lead_mm is \"five\", but 0.01 to",
            ),
            ("[feed]\nlead_mm = nan", "feed.lead_mm is NaN, but"),
            (
                "[feed]\nlead = 5",
                "no setting feed.lead: the nearest are feed.lead_mm,",
            ),
            ("lead_mm = 5", "`lead_mm` is no group"),
            (
                "[nut]\npole_pairs = 2.5",
                "nut.pole_pairs is 2.5, but whole",
            ),
            ("[nut]\npole_pairs = -1", "nut.pole_pairs is -1, but whole"),
            (
                "[nut]\nencoder_direction = \"up\"",
                "\"unknown\", \"forwards\", \"backwards\" are possible",
            ),
            (
                "[nut]\nresistance_phase_ohm = 101",
                "nut.resistance_phase_ohm makes nut.resistance_line_to_line_ohm = 202, but",
            ),
            (
                "[nut]\nresistance_phase_ohm = 1\nresistance_line_to_line_ohm = 2",
                "nut.resistance_phase_ohm and nut.resistance_line_to_line_ohm say the same",
            ),
            ("[feed]\nlead_mm = 5\nlead_mm = 6", "duplicate key"),
        ] {
            let error = refused(text);
            assert!(error.contains(said), "{text:?}: {error}");
        }
    }

    proptest! {
        /// Whatever is in a file, it is taken or refused in a sentence.
        #[test]
        fn any_text_is_taken_or_refused(text in "\\PC*") {
            let _ = of_toml(&Settings::DEFAULT, &text);
        }

        #[test]
        fn any_value_is_taken_within_its_range_or_refused(k in 0usize..70, x: f64) {
            if let Some(setting) = Settings::all().nth(k) {
                let text = format!("[{}]\n{} = {}", setting.group(), setting.name(), Toml::Float(x));
                if let Ok(settings) = of_toml(&Settings::DEFAULT, &text) {
                    let value = settings.get(setting.id).unwrap();
                    prop_assert!(setting.check(value).is_ok());
                }
            }
        }
    }
}
