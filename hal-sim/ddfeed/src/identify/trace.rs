//! From a record to the report.

use super::printed::print;
use super::told::Told;
use super::{Fault, IdentifyOptions, simulation};
use crate::output::{Folder, refuse_inputs};
use anyhow::{Context, Result};
use identify::effects::stick_slip::FreeDrive;
use identify::records::{Mapping, OnFault};
use identify::report::write;
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
    carry_out(&task, options, None)
}

/// Identifies, and writes and prints what came of it. `demo_seed` is that of a demonstration.
pub(super) fn carry_out(
    task: &Task,
    options: &IdentifyOptions,
    demo_seed: Option<u64>,
) -> Result<()> {
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
    done.report.demo_seed = demo_seed;
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
