//! From a record to the report.

use super::told::Told;
use super::{Fault, IdentifyOptions, simulation};
use crate::output::{Folder, refuse_inputs};
use anyhow::{Context, Result};
use identify::effects::stick_slip::FreeDrive;
use identify::records::{Mapping, OnFault};
use identify::report::{Report, write};
use identify::run::{RunError, Task, WrongData};
use std::path::Path;

/// The files of a report.
pub(super) const WRITTEN: [&str; 5] = [
    "report.html",
    "report.json",
    "model.toml",
    "residual.csv",
    "orders.svg",
];

/// Identifies, simulates and writes the report.
pub(super) fn run(options: &IdentifyOptions) -> Result<()> {
    let model = options.model.clone().context("no model: give --model")?;
    let inputs = options.fit.iter().chain(&options.check).chain([&model]);
    let inputs: Vec<&Path> = inputs
        .chain(&options.mapping)
        .map(std::path::PathBuf::as_path)
        .collect();
    refuse_inputs(&options.out, &WRITTEN, &inputs)?;
    let mapping = options.mapping.as_deref().map(Mapping::load).transpose()?;
    let mapping = mapping.unwrap_or_default();
    if let (Some(map), Some(fit)) = (&mapping.map, options.fit.first()) {
        refuse_inputs(&options.out, &WRITTEN, &[&fit.with_file_name(map)])?;
    }
    let task = Task {
        model,
        fit: options.fit.clone(),
        check: options.check.clone(),
        mapping,
        on_fault: match options.on_fault {
            Fault::Refuse => OnFault::Refuse,
            Fault::Skip => OnFault::Skip,
        },
    };
    carry_out(&task, options)
}

/// Identifies, and writes and prints what came of it.
pub(super) fn carry_out(task: &Task, options: &IdentifyOptions) -> Result<()> {
    let mut told = Told::new(options.progress);
    let drive: Option<&dyn FreeDrive> = match options.no_simulation {
        true => None,
        false => Some(&simulation::FixedPoint),
    };
    let done = task.run_with(drive, &mut |what, share| told.say(what, share));
    let mut done = match done {
        Ok(done) => done,
        Err(RunError::WrongData(wrong)) => {
            told.end();
            return wrong_data(&wrong, &options.out);
        }
        Err(error) => {
            told.end();
            return Err(error.into());
        }
    };
    if let Some(split) = &done.split {
        told.end();
        println!("{split}");
        told = Told::new(options.progress);
    }
    if let Some(replay) = done.replay.filter(|_| !options.no_simulation) {
        told.say("simulating", None);
        match simulation::simulation(&replay) {
            Ok(found) => done.report.simulation = found,
            // The report stands without it.
            Err(error) => eprintln!("the check record could not be simulated: {error:#}"),
        }
    }
    told.end();
    write(&done.report, &options.out)?;
    print(&done.report);
    println!("report: {}", options.out.join("report.html").display());
    Ok(())
}

#[derive(askama::Template)]
#[template(path = "wrong_data.html")]
struct WrongPage<'a> {
    wrong: &'a WrongData,
}

/// Says what is wrong with the data, in the terminal and as report.json and report.html.
fn wrong_data(wrong: &WrongData, out: &Path) -> Result<()> {
    let folder = Folder::open(out)?;
    folder.put_text(
        "report.json",
        &(serde_json::to_string_pretty(wrong)? + "\n"),
    )?;
    println!("verdict: {}", wrong.verdict);
    for finding in &wrong.wrong_data {
        println!("{}: {}", finding.file, finding.sentence);
    }
    folder.put_text(
        "report.html",
        &page::document::document("Wrong data", &WrongPage { wrong }),
    )?;
    println!("report: {}", folder.path("report.html").display());
    Ok(())
}

fn print(report: &Report) {
    println!("verdict: {}. {}", report.verdict, report.summary);
    for effect in &report.effects {
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
        println!(
            "{} at {}: {}; explains {:.1} % of the check record's excess",
            effect.kind,
            effect.place,
            values.join(", "),
            100.0 * effect.explained
        );
    }
    if let Some((_, figures)) = report.lead() {
        println!(
            "{} residual on the check record: {} -> {} {} rms (noise floor {})",
            figures.channel,
            short(figures.check_before),
            short(figures.check_after),
            figures.unit,
            short(figures.noise_floor)
        );
    }
    if let Some(simulation) = &report.simulation {
        println!(
            "ripple simulated less measured: {:.2} -> {:.2} points rms over {} holds",
            simulation.declared_rms_points,
            simulation.new_rms_points,
            simulation.holds.len()
        );
    }
    for record in &report.records {
        let skipped: usize = record.skipped.iter().map(|s| s.rows).sum();
        if skipped + record.bridged + record.cut > 0 {
            println!(
                "{}: {skipped} rows left out, {} bridged, {} cut off, of {}",
                record.file, record.bridged, record.cut, record.rows
            );
        }
    }
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
