//! A report in the terminal.

use identify::conclusion::said::Said;
use identify::records::DataQuality;
use identify::report::{Effect, Report};

/// Prints what matters of a report.
pub(super) fn print(report: &Report) {
    let effects = report.effects.iter().flat_map(effect);
    let records = report.records.iter().flat_map(faults);
    let lines = verdict(report.verdict, &report.said).into_iter();
    let lines = lines.chain(effects).chain(lead(report));
    for line in lines.chain(ripple(report)).chain(records) {
        println!("{line}");
    }
}

/// A line for each answer: verdict, residual, what was not tested, what to record next and how.
fn verdict(verdict: &str, said: &Said) -> Vec<String> {
    let line = |name: &str, text: String| format!("{name}: {text}");
    let lines = [
        Some(format!("verdict: {verdict}. {}", said.why)),
        said.left.clone().map(|text| line("residual", text)),
        said.untested_words()
            .map(|text| line("not tested by this record", text)),
        said.next_words().map(|text| line("record next", text)),
        said.command
            .as_ref()
            .map(|command| format!("    {command}")),
    ];
    lines.into_iter().flatten().collect()
}

/// An effect with its values, and what else may be its cause.
fn effect(effect: &Effect) -> Vec<String> {
    let values: Vec<String> = effect
        .parameters
        .iter()
        .map(|(name, value)| {
            let [low, high] = effect.interval.get(name).copied().unwrap_or([f64::NAN; 2]);
            let unit = effect.unit.get(name).map_or("", String::as_str);
            format!(
                "{name} {} ({} to {}) {unit}",
                short(*value),
                short(low),
                short(high)
            )
            .trim_end()
            .to_owned()
        })
        .collect();
    let line = format!(
        "{} at {}: {}; explains {:.1} % of the check record's excess",
        effect.kind,
        effect.place,
        values.join(", "),
        100.0 * effect.explained
    );
    let suggests = effect.suggests.iter().map(|cause| format!("    {cause}"));
    [line].into_iter().chain(suggests).collect()
}

/// How the residual fell of the channel that the first sentence names.
fn lead(report: &Report) -> Option<String> {
    let (_, figures) = report.lead()?;
    let floor = match figures.noise_floor.is_finite() {
        true => format!("noise floor {}", short(figures.noise_floor)),
        false => "noise floor unknown".into(),
    };
    Some(format!(
        "{} residual on the check record: {} -> {} {} rms ({floor})",
        figures.channel,
        short(figures.check_before),
        short(figures.check_after),
        figures.unit
    ))
}

/// How far the simulated ripple is from the record's.
fn ripple(report: &Report) -> Option<String> {
    let simulation = report.simulation.as_ref()?;
    let further_off = match report.is_further_off() {
        Some(_) => "; the new model is further from the record, so do not compensate with it",
        None => "",
    };
    Some(format!(
        "ripple simulated less measured: {:.2} -> {:.2} points rms over {} holds{further_off}",
        simulation.declared_rms_points,
        simulation.new_rms_points,
        simulation.holds.len()
    ))
}

/// What became of a record's rows, where not all were used, and what was guessed or noted.
fn faults(record: &DataQuality) -> Vec<String> {
    let skipped: usize = record.skipped.iter().map(|s| s.rows).sum();
    let rows = (skipped + record.bridged + record.cut > 0).then(|| {
        format!(
            "{}: {skipped} rows left out, {} bridged, {} cut off, of {}",
            record.file, record.bridged, record.cut, record.rows
        )
    });
    let notes = record.notes.iter();
    let notes = notes.map(|note| format!("{}: {note}", record.file));
    rows.into_iter().chain(notes).collect()
}

/// Four significant digits.
fn short(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-3..1e5).contains(&size) {
        return format!("{value:.3e}");
    }
    let decimals = if size == 0.0 {
        0
    } else {
        (3 - size.log10().floor() as i32).max(0) as usize
    };
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::{DriveOptions, Task};
    use clap::{Args, Command, FromArgMatches};
    use std::collections::BTreeMap;

    /// The command that a report proposes is one that the drive takes.
    #[test]
    fn the_drive_takes_the_command_that_is_proposed() {
        let proposed = identify::conclusion::said::command([603.4, 301.7, 150.85]);
        let words = proposed.strip_prefix("ddfeed ").expect("a command");
        let parser = DriveOptions::augment_args(Command::new("drive"));
        let found = parser.try_get_matches_from(words.split(' ')).unwrap();
        let Task::Record(record) = DriveOptions::from_arg_matches(&found).unwrap().task else {
            panic!("`{proposed}` records")
        };
        let base: Vec<f64> = record.hold.iter().map(|hold| hold.base).collect();
        assert_eq!(base.len(), 6);
        assert!(
            record.arm && base.iter().any(|speed| *speed < 0.0),
            "{base:?}"
        );
    }

    #[test]
    fn each_answer_has_a_line() {
        let said = Said {
            why: "What is named takes 90 % of it.".into(),
            left: Some("Most of it is in the nut torque.".into()),
            untested: Some(vec!["viscous friction".into()]),
            next: vec!["both directions".into()],
            command: Some("ddfeed drive record rec".into()),
            channel: None,
        };
        assert_eq!(
            verdict("partly explained", &said),
            [
                "verdict: partly explained. What is named takes 90 % of it.",
                "residual: Most of it is in the nut torque.",
                "not tested by this record: viscous friction",
                "record next: both directions",
                "    ddfeed drive record rec",
            ]
        );
    }

    #[test]
    fn candidates_stand_beneath_an_effect() {
        let of_order = "the record shows the order, not the cause; candidates: misaligned coupling";
        let found = Effect {
            kind: "coupling_misalignment".into(),
            place: "nut".into(),
            order: Some(1.0),
            hz: None,
            parameters: BTreeMap::from([("amplitude".into(), 0.04)]),
            interval: BTreeMap::from([("amplitude".into(), [0.039, 0.041])]),
            unit: BTreeMap::from([("amplitude".into(), "N m".into())]),
            explained: 1.0,
            held_back: Vec::new(),
            not_separable: Vec::new(),
            candidates: &["misaligned coupling"],
            curve: None,
            shows: None,
            suggests: Some(of_order.into()),
        };
        let [line, beneath] = &effect(&found)[..] else {
            panic!("an effect and its candidates are two lines")
        };
        assert!(line.ends_with("explains 100.0 % of the check record's excess"));
        assert_eq!(beneath.trim(), of_order);
    }
}
