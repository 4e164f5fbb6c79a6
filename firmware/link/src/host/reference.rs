//! All settings as a page, made from their declarations.

use crate::settings::datasheet::SPELLINGS;
use crate::settings::{Effect, Kind, Setting, Settings};
use std::fmt::Write;

/// The page, in Markdown. `ddfeed settings` prints it; `SETTINGS.md` holds it.
#[must_use]
pub fn page() -> String {
    let mut page = String::from(
        "# Settings of a drive\n\nMade from the code by `ddfeed settings`; a test holds this page equal to it.\n\n\
         A setting is `group.name`, as in `ddfeed drive ... settings set feed.lead_mm=10`. Where it stands for `#`, its place counts from 1.\n\
         Its number is that of the group in the upper byte, and its own in the lower.\n",
    );
    let all: Vec<Setting> = Settings::all().collect();
    let mut groups_before: Vec<&str> = Vec::new();
    for first in &all {
        if groups_before.contains(&first.group()) {
            continue;
        }
        // Groups of the same parameters share a table.
        let alike = all.iter().filter(|other| other.is_parameter_of(first));
        let mut groups: Vec<_> = alike.map(|other| (other.group(), other.id >> 8)).collect();
        groups.dedup();
        groups_before.extend(groups.iter().map(|(name, _)| name));
        let heading: Vec<String> = groups
            .iter()
            .map(|(name, number)| format!("`{name}` ({number})"))
            .collect();
        let _ = write!(
            page,
            "\n## {}\n\n| setting | number | default | possible | takes effect | |\n| --- | --- | --- | --- | --- | --- |\n",
            heading.join(", ")
        );
        let group: Vec<&Setting> = all
            .iter()
            .filter(|setting| setting.group() == first.group())
            .collect();
        for (k, setting) in group.iter().enumerate() {
            if !group[..k]
                .iter()
                .any(|before| before.is_parameter_of(setting))
            {
                let places = group.iter().filter(|other| other.is_parameter_of(setting));
                row(&mut page, setting, places.map(|place| place.id & 0xFF));
            }
        }
    }
    page.push_str("\n## Other names of the same, in `screw` and `nut`\n\n| name | times | setting |\n| --- | --- | --- |\n");
    for spelling in SPELLINGS {
        let _ = writeln!(
            page,
            "| `{}` | {} | `{}` |",
            spelling.name, spelling.factor, spelling.setting
        );
    }
    page
}

fn row(page: &mut String, setting: &Setting, numbers: impl Iterator<Item = u16>) {
    let numbers: Vec<String> = numbers.map(|number| number.to_string()).collect();
    let default = Settings::DEFAULT
        .get(setting.id)
        .map(|value| value.shown(*setting).to_string())
        .unwrap_or_default();
    let unit = setting.unit();
    let possible = match setting.kind() {
        Kind::Real([least, most]) => format!("{least} to {most} {unit}"),
        Kind::Whole([least, most]) => format!("whole, {least} to {most} {unit}"),
        Kind::Choice(words) => words.join(", "),
    };
    let effect = match setting.effect() {
        Effect::AtOnce => "at once",
        Effect::AtRest => "at rest",
        Effect::Restart => "after a restart",
    };
    let every = setting.at_all_places();
    let _ = writeln!(
        page,
        "| `{}` | {} | {default} | {} | {effect} | {} |",
        every.name(),
        numbers.join(", "),
        possible.trim_end(),
        every.doc()
    );
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_committed_page_is_what_the_code_makes() {
        let committed = include_str!("../../SETTINGS.md");
        assert!(
            committed == super::page(),
            "SETTINGS.md is not what the code makes: cargo ddfeed settings > firmware/link/SETTINGS.md"
        );
    }
}
