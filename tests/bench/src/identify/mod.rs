//! `cargo xtask bench identify`: the identification against its goals.

mod alone;
pub mod attacks;
mod clean;
#[cfg(test)]
mod coverage_test;
pub mod figures;
mod judge;
mod makes;
mod outside;
mod outside_axes;
mod real;
mod wrong_data;

use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use figures::Figures;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use xtask::tools::{root, target_folder};

/// Machines of the blind test where it has not run yet.
const SHORT: u32 = 20;

/// How to say what the identification reaches.
#[derive(Args)]
pub struct BenchOptions {
    /// As JSON.
    #[arg(long)]
    pub json: bool,
    /// What the shared recordings' machines have, to judge by; recordings/answers.json beside the project if not given.
    #[arg(long)]
    pub answers: Option<PathBuf>,
    /// Runs the blind test first, on so many machines. Without it, what its last run wrote is taken, and the test of 20
    /// machines is run if there is none.
    #[arg(long)]
    pub blind: Option<u32>,
    /// The full numbers of drawn machines; without it a sample.
    #[arg(long)]
    pub long: bool,
    /// Only these parts.
    #[arg(long, value_enum, num_args = 1..)]
    pub only: Vec<Part>,
    /// So many machines of each part that draws them, in place of the sample's or the full numbers.
    #[arg(long)]
    pub runs: Option<u64>,
    /// Keeps the files of clean motors of other makes here.
    #[arg(long)]
    pub keep: Option<PathBuf>,
    /// The first machine of those with effects that no family has, and of clean double drives: another one is another seed.
    #[arg(long, default_value_t = 0)]
    pub first: usize,
}

/// A part of the bench.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Part {
    /// Shared recordings, EMPS, LAAS, an ODrive's records, the paper.
    Measured,
    /// The blind test.
    Blind,
    /// Motors alone.
    Pmsm,
    /// Clean motors and feed axes.
    Clean,
    /// Effects that no family has.
    Outside,
    /// Wrong data.
    Wrong,
    /// Real machines of other people.
    Real,
    /// Thin records.
    Thin,
    /// Attacks, and curves that are added.
    Attacks,
    /// Clean motors of other makes.
    Makes,
}

/// Measures and prints.
pub fn run(options: &BenchOptions) -> Result<()> {
    let shared = match std::env::var_os("DDFEED_SHARED") {
        Some(folder) => PathBuf::from(folder),
        None => root()?.join("../shared"),
    };
    let is_asked = |part: Part| options.only.is_empty() || options.only.contains(&part);
    let blind = match is_asked(Part::Blind) {
        true => blind(options)?,
        false => Value::Null,
    };
    let figures = is_asked(Part::Measured).then(|| {
        let answers = options
            .answers
            .clone()
            .unwrap_or_else(|| shared.join("recordings/answers.json"));
        let answers = read(&answers)
            .inspect_err(|error| eprintln!("the recordings are not judged: {error:#}"))
            .ok();
        Figures::measure(&shared, answers.as_ref())
    });
    let Sample {
        pmsm,
        outside,
        wrong,
        clean,
        thin,
        attacks: [rounds, every],
        makes,
    } = Sample::of(options);
    let every = every as usize;
    let mut more = json!({ "blind": blind });
    if is_asked(Part::Clean) {
        more["clean"] = clean::measure(options.first as u64, clean);
    }
    if is_asked(Part::Pmsm) {
        let drawn = alone::drawn(pmsm[0], pmsm[1]);
        more["clean"]["pmsm"] =
            json!({ "runs": drawn["clean"], "false_alarms": drawn["false_alarms"] });
        more["pmsm"] = drawn;
    }
    if is_asked(Part::Outside) {
        more["outside"] = outside::measure(options.first, outside);
    }
    if is_asked(Part::Wrong) {
        more["wrong_data"] = json!(wrong_data::measure(wrong[0], wrong[1])?);
    }
    if is_asked(Part::Real) {
        more["real"] = json!(real::real(&shared.join("measured"))?);
    }
    if is_asked(Part::Thin) {
        more["thin"] = json!(attacks::thin(options.first as u64, thin));
    }
    if is_asked(Part::Attacks) {
        let (attacks, curves) = attacks::attacks(options.first as u64, rounds, every);
        (more["attacks"], more["curves"]) = (json!(attacks), json!(curves));
    }
    if is_asked(Part::Makes) {
        more["makes"] = json!(makes::measure(
            options.first as u64,
            makes,
            options.keep.as_deref()
        )?);
    }
    let json = figures.as_ref().map_or_else(|| json!({}), Figures::json);
    if options.json {
        let mut json = json;
        if let (Some(all), Value::Object(more)) = (json.as_object_mut(), more) {
            all.extend(more);
        }
        println!("{}", serde_json::to_string(&json)?);
    } else {
        if let Some(figures) = &figures {
            print(figures, &more["blind"]);
        }
        println!("\n{}", serde_json::to_string_pretty(&more)?);
    }
    Ok(())
}

/// Runs the blind test where it is asked for or has not run yet; what its last run wrote.
fn blind(options: &BenchOptions) -> Result<Value> {
    let result = target_folder()?.join("blind/blind.json");
    let machines = options.blind.or((!result.exists()).then_some(SHORT));
    let failed = machines.and_then(|machines| xtask::firmware::blind(machines).err());
    // A test that misses its goal has written its result all the same.
    Ok(read(&result).unwrap_or_else(|error| {
        let why = failed.as_ref().unwrap_or(&error);
        eprintln!("the blind test has no result: {why:#}");
        json!({ "right": null, "of": null, "false_alarms": null, "clean": null })
    }))
}

/// How many machines are drawn.
struct Sample {
    /// Motors alone: with effects, and clean.
    pmsm: [u64; 2],
    /// Machines with something that no family has.
    outside: usize,
    /// Machines whose data is got wrong in each way, and machines with sound data.
    wrong: [u64; 2],
    /// Clean motors, feed axes and double drives.
    clean: [u64; 3],
    /// Thin records.
    thin: u64,
    /// Machines of each attack, and of how many kinds one is tried.
    attacks: [u64; 2],
    /// Clean motors of other makes.
    makes: u64,
}

impl Sample {
    /// The full numbers, or what a build server can afford.
    fn of(options: &BenchOptions) -> Self {
        if let Some(runs) = options.runs {
            return Sample {
                pmsm: [runs; 2],
                outside: runs as usize,
                wrong: [runs; 2],
                clean: [runs; 3],
                thin: runs,
                attacks: [runs, 1],
                makes: runs,
            };
        }
        match options.long {
            true => Sample {
                pmsm: [200, 300],
                outside: 354,
                wrong: [5, 200],
                clean: [300, 300, 300],
                thin: 200,
                attacks: [10, 1],
                makes: 300,
            },
            false => Sample {
                pmsm: [11, 8],
                outside: 59,
                wrong: [1, 4],
                clean: [24, 2, 16],
                thin: 10,
                attacks: [1, 4],
                makes: 10,
            },
        }
    }
}

fn read(path: &Path) -> Result<Value> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("{} is not there", path.display()))?;
    serde_json::from_str(&text).with_context(|| format!("{} is no JSON", path.display()))
}

fn print(figures: &Figures, blind: &Value) {
    let row = |name: &str, value: Option<f64>, goal: &str| {
        let value = value.map_or_else(|| "-".to_owned(), |v| format!("{v:.2}"));
        println!("{name:52}{value:>10}{goal:>10}");
    };
    println!("{:52}{:>10}{:>10}", "", "is", "goal");
    row(
        "shared recordings right",
        figures.open.map(|o| o.0.into()),
        "10",
    );
    let blind = |name: &str| blind.get(name).and_then(Value::as_f64);
    row("blind machines right", blind("right"), "95 %");
    row("   of", blind("of"), "");
    row("false alarms", blind("false_alarms"), "1 %");
    row("   on clean machines", blind("clean"), "");
    row(
        "CPU seconds per recording, one thread",
        figures.seconds_per_recording,
        "1",
    );
    for found in &figures.found {
        println!("  {found}");
    }
    if let Some(study) = &figures.axis {
        let [fit, test] = study.inverse_percent;
        println!("\nEMPS, force error, %; declared inverse model: {fit:.2} fit, {test:.2} test");
        println!(
            "{:52}{:>10}{:>10}{:>10}",
            "in closed-loop simulation", "fit", "test", "homed"
        );
        for stage in study
            .stages
            .iter()
            .chain(&study.corrected)
            .chain([&study.ideal])
        {
            println!(
                "  {:50}{:>10.2}{:>10.2}{:>10.2}",
                stage.added,
                stage.estimate.force_percent,
                stage.test.force_percent,
                stage.homed.force_percent
            );
        }
        println!("{:52}{:>10}{:>10}{:>10}", "goal", "", "", "2.6");
    }
    if let Some(motor) = &figures.motor {
        println!("\nLAAS, current error on the half that was not fitted, % of its rms");
        row(
            "inertia and friction",
            Some(motor.study.before_percent()),
            "",
        );
        row(
            "with the orders of the slow turn",
            Some(motor.study.after_percent()),
            "3",
        );
        row("   halves swapped", Some(motor.swapped_percent[1]), "");
        for order in motor.study.orders.iter().take(5) {
            println!(
                "  {:>4} per turn: {}",
                order.order,
                order.suggests(Some(motor.model.pole_pairs))
            );
        }
    }
    for pair in &figures.odrive {
        println!(
            "{} -> {}: {:.1} -> {:.1} % of the current, {} names",
            pair.fit, pair.check, pair.before_percent, pair.after_percent, pair.names
        );
    }
    let paper = &figures.paper;
    println!(
        "\nPaper, model less measured: {:.2} points rms; with one effect more: in sample, left out",
        paper.rms
    );
    for attempt in &paper.attempts {
        println!(
            "  {:64}{:>6.2}{:>6.2}  ({:.3} {})",
            attempt.name, attempt.in_sample, attempt.leave_one_out, attempt.size, attempt.unit
        );
    }
    println!("{}", paper.sentence());
}
