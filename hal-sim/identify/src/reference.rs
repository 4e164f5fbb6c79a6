//! All keys of mapping and model files, as a page made from the code: the structs that the files are read into, with their
//! documentation, and the channels of each machine. `ddfeed identify --reference` prints it; `REFERENCE.md` holds it.

use crate::records::{Machine, Need, unit_names};
use plant::effects::{AnyEffect, Measured};
use std::fmt::Write;

const MAPPING: &str = include_str!("records/mapping.rs");
const MODEL: &str = include_str!("../../plant/src/model/mod.rs");
const INSTALLATION: &str = include_str!("../../plant/src/model/installation.rs");
const MEASURED: &str = include_str!("../../plant/src/model/measured.rs");
const AXIS: &str = include_str!("machines/feed_axis/file.rs");
const PMSM: &str = include_str!("machines/pmsm_file.rs");
const MOTOR: &str = include_str!("machines/motor/record.rs");

const MEASURED_EFFECT: &str = include_str!("../../plant/src/effects/measured.rs");

/// The kinds of effects by name, with the struct and the source of each.
pub(crate) fn effects() -> Vec<[&'static str; 3]> {
    let kinds = AnyEffect::CATALOGUE.iter();
    let mut all: Vec<_> = kinds
        .map(|kind| [kind.name, kind.structure, kind.source])
        .collect();
    all.push([Measured::KIND, "Measured", MEASURED_EFFECT]);
    all.sort_unstable();
    all
}

/// A key of a file: its name, its type, what it is.
type Key = (String, String, String);

/// The fields of a struct in a source, with their documentation.
fn keys(source: &str, structure: &str) -> Vec<Key> {
    let start = format!("struct {structure} {{");
    let Some((_, body)) = source.split_once(&start) else {
        return Vec::new();
    };
    let mut keys = Vec::new();
    let mut about: Vec<&str> = Vec::new();
    for line in body.lines().skip(1).map(str::trim) {
        if line == "}" {
            break;
        }
        if let Some(text) = line.strip_prefix("///") {
            about.push(text.trim());
        } else if line.starts_with("#[") || line.starts_with(")]") || line.is_empty() {
        } else if let Some((name, kind)) = line.trim_start_matches("pub ").split_once(": ") {
            let kind = kind.trim_end_matches(',');
            keys.push((name.to_owned(), in_words(kind), about.join(" ")));
            about.clear();
        }
    }
    keys
}

/// A type as a file has it.
fn in_words(kind: &str) -> String {
    let (inner, optional) = match kind.strip_prefix("Option<") {
        Some(inner) => (inner.trim_end_matches('>'), ", may be left out"),
        None => (kind, ""),
    };
    let words = match inner {
        "f64" => "number",
        "u32" | "usize" => "whole number",
        "bool" => "`true` or `false`, `false` if left out",
        "String" | "char" => "text",
        "Machine" | "Clock" => "one of its names",
        "Rows" => "table",
        "Quantity" => "`torque` or `force`",
        "MeasuredOver" => "`angle`, `speed`, `position` or `position x direction`",
        "[f64; 2]" => "two numbers",
        "Vec<f64>" => "numbers",
        inner if inner.starts_with("BTreeMap") => "tables by name",
        inner if inner.starts_with("Vec") => "array of tables",
        other => other,
    };
    format!("{words}{optional}")
}

fn table(page: &mut String, rows: &[Key]) {
    page.push_str("| key | is | |\n| --- | --- | --- |\n");
    for (name, kind, about) in rows {
        let about = about.replace('|', "\\|");
        // Writing to memory does not fail.
        let _ = writeln!(page, "| `{name}` | {kind} | {about} |");
    }
    page.push('\n');
}

/// The first sentences of a source's documentation.
fn headline(source: &str) -> String {
    source
        .lines()
        .map_while(|line| line.strip_prefix("//!"))
        .map(str::trim)
        .take_while(|line| !line.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}

/// Keys of the tables of a source, each under its heading.
fn tables(page: &mut String, source: &str, tables: &[(&str, &str)]) {
    for (heading, structure) in tables {
        let _ = writeln!(page, "### {heading}\n");
        table(page, &keys(source, structure));
    }
}

/// Keys of a mapping file.
fn mapping(page: &mut String) {
    table(page, &keys(MAPPING, "Mapping"));
    tables(
        page,
        MAPPING,
        &[
            ("`[columns.NAME]`: where a channel comes from", "Source"),
            ("`[rows]`: which rows count", "Rows"),
            (
                "`[files.\"PATTERN\"]`: what differs in some files",
                "Differs",
            ),
        ],
    );
    page.push_str(
        "### `[constants.NAME]`: numbers beside the columns\n\n`name`, the name of a variable of the file, of which the first \
         value is taken; or `value`, the number.\n\n### Channels\n\nTime is `t_s`, s. A name's ending is its unit.\n\n",
    );
    for machine in Machine::ALL {
        channels(page, machine);
    }
    page.push_str("### Units\n\n");
    for of in ["s", "rad", "rad/s", "m", "m/s", "A", "V", "N", "1"] {
        let names: Vec<String> = unit_names(of)
            .iter()
            .map(|name| format!("`{name}`"))
            .collect();
        let _ = writeln!(page, "- of {of}: {}", names.join(", "));
    }
}

/// Channels and constants of a machine.
fn channels(page: &mut String, machine: Machine) {
    let _ = writeln!(
        page,
        "#### `machine = \"{}\"`: {}\n",
        machine.name(),
        machine.about()
    );
    page.push_str("| channel | needed | |\n| --- | --- | --- |\n");
    for channel in machine.channels() {
        let need = match channel.need {
            Need::Required => "yes".to_owned(),
            Need::Optional => "no".to_owned(),
            Need::OneOf(group, alternative) => format!("{group}, way {}", alternative + 1),
        };
        let _ = writeln!(page, "| `{}` | {need} | {} |", channel.name, channel.about);
    }
    page.push('\n');
    for (name, about) in machine.constants() {
        let _ = writeln!(page, "- constant `{name}`: {about}");
    }
    if !machine.constants().is_empty() {
        page.push('\n');
    }
}

/// Keys of a double drive's model.
fn double_drive(page: &mut String) {
    page.push_str("\n## Model file of a double drive\n\n");
    tables(
        page,
        MODEL,
        &[
            ("`[screw]` and `[nut]`: the motors", "MotorModel"),
            (
                "`[[screw.torque_harmonics]]`, `[[nut.torque_harmonics]]`",
                "TorqueHarmonic",
            ),
            ("`[feed]`: screw-nut pair, table and guideway", "FeedModel"),
            ("`[sensing]`", "SensingModel"),
        ],
    );
    page.push_str("### `[installation]`: may be left out\n\n");
    table(page, &keys(INSTALLATION, "InstallationModel"));
    page.push_str(
        "### `[measured.screw]` and `[measured.nut]`: halves of 95 % intervals, relative; may be left out\n\n",
    );
    table(page, &keys(MEASURED, "MeasuredMotor"));
    page.push_str(
        "### `[[effects]]`: what it has beyond that\n\n`kind`, `where` (`screw`, `nut`, `both` or `feed`), and the parameters of \
         the kind:\n\n",
    );
    for [kind, structure, source] in effects() {
        let _ = writeln!(page, "#### `{kind}`\n\n{}\n", headline(source));
        table(page, &keys(source, structure));
    }
}

/// The page.
pub fn page() -> String {
    let mut page = String::from(
        "# Keys of mapping and model files\n\nMade from the code by `ddfeed identify --reference`; a test holds this page \
         equal to it.\n\n## Mapping file\n\nWhich column of a log is which channel, in which unit, and how it was \
         sampled.\n\n",
    );
    mapping(&mut page);
    double_drive(&mut page);
    page.push_str("## Model file of a feed axis\n\n### `[axis]`\n\n");
    table(&mut page, &keys(AXIS, "Plate"));
    page.push_str("## Model file of a motor\n\n### `[motor]`\n\n");
    table(&mut page, &keys(MOTOR, "MotorModel"));
    page.push_str("## Model file of a pmsm\n\n### `[motor]`\n\nAs `[screw]` of a double drive.\n\n### `[sensing]`\n\n");
    table(&mut page, &keys(PMSM, "Sensing"));
    page.truncate(page.trim_end().len());
    page.push('\n');
    page
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_committed_page_is_what_the_code_makes() {
        let committed = include_str!("../REFERENCE.md");
        assert!(
            committed == page(),
            "REFERENCE.md is not what the code makes: cargo ddfeed identify --reference > hal-sim/identify/REFERENCE.md"
        );
    }

    #[test]
    fn every_kind_of_effect_and_every_key_is_on_the_page() {
        for [kind, structure, source] in effects() {
            let keys = keys(source, structure);
            assert!(!keys.is_empty(), "no key of {kind} was found");
        }
        for (source, structure) in [
            (MAPPING, "Mapping"),
            (MAPPING, "Source"),
            (MAPPING, "Rows"),
            (MAPPING, "Differs"),
            (MODEL, "MotorModel"),
            (MODEL, "FeedModel"),
            (MODEL, "SensingModel"),
            (AXIS, "Plate"),
            (MOTOR, "MotorModel"),
            (PMSM, "Sensing"),
        ] {
            assert!(
                !keys(source, structure).is_empty(),
                "{structure} has no keys"
            );
        }
    }
}
