//! `identify`: from a recording to the effect that its model lacks.

use clap::{Parser, Subcommand};
use identify::load::{Mapping, load};
use identify::{bench, report};
use plant::model::Model;
use std::path::PathBuf;
use std::process::ExitCode;

/// Holds a model against a recording and traces what the model lacks.
#[derive(Parser)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    /// The declared model (model.toml).
    #[arg(long, required = true)]
    model: Option<PathBuf>,
    /// The recording to identify from (.csv, .csv.gz, .mat; .parquet if built with that feature).
    #[arg(long, required = true)]
    fit: Option<PathBuf>,
    /// Another recording of the same machine: it confirms, and errors are reported on it.
    #[arg(long, required = true)]
    check: Option<PathBuf>,
    /// Folder for report.json, report.html, model.toml and residual.csv.
    #[arg(long, required = true)]
    out: Option<PathBuf>,
    /// Which columns of the recordings are which, and their units, where they differ from the project's own.
    #[arg(long)]
    mapping: Option<PathBuf>,
}

#[derive(Subcommand)]
enum Command {
    /// The figures that the tool is held to, on the recordings and measured data beside the project.
    Bench {
        /// As JSON.
        #[arg(long)]
        json: bool,
        /// What the shared recordings' machines have, to judge by (JSON).
        #[arg(long)]
        answers: Option<PathBuf>,
        /// What the blind test wrote (JSON).
        #[arg(long)]
        blind: Option<PathBuf>,
    },
}

fn main() -> ExitCode {
    match run(Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: Arguments) -> Result<(), Box<dyn std::error::Error>> {
    if let Some(Command::Bench {
        json,
        answers,
        blind,
    }) = arguments.command
    {
        let figures = bench::run(&bench::shared(), answers.as_deref(), blind.as_deref());
        if json {
            println!("{figures:#}");
        } else {
            print_figures(&figures);
        }
        return Ok(());
    }
    let (Some(model), Some(fit), Some(check), Some(out)) = (
        arguments.model,
        arguments.fit,
        arguments.check,
        arguments.out,
    ) else {
        return Err("--model, --fit, --check and --out are needed".into());
    };
    let model = Model::load(&model)?;
    let mapping = arguments
        .mapping
        .as_deref()
        .map(Mapping::load)
        .transpose()?;
    eprintln!("reading {}", fit.display());
    let fit = load(&fit, mapping.as_ref(), &model)?;
    eprintln!("reading {}", check.display());
    let check = load(&check, mapping.as_ref(), &model)?;
    eprintln!("tracing the residual");
    let outcome = identify::analysis::analyse(&model, &fit, &check);
    report::write(&outcome, &out)?;
    println!("verdict: {}", outcome.verdict());
    for found in &outcome.effects {
        print!(
            "{} at {}:",
            found.effect.effect().kind(),
            found.effect.place().name()
        );
        for estimate in identify::interval::estimates(found) {
            let [low, high] = estimate.interval;
            print!(
                " {} {} ({} to {})",
                estimate.name,
                short(estimate.value),
                short(low),
                short(high)
            );
        }
        println!("; explains {:.1} %", 100.0 * found.explained);
    }
    println!("report: {}", out.join("report.html").display());
    Ok(())
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

fn print_figures(figures: &serde_json::Value) {
    let number = |value: &serde_json::Value| {
        value
            .as_f64()
            .map_or_else(|| "-".to_owned(), |v| format!("{v:.2}"))
    };
    println!("{:44}{:>10}{:>10}", "", "is", "goal");
    let row = |name: &str, value: &serde_json::Value, goal: &str| {
        println!("{name:44}{:>10}{goal:>10}", number(value))
    };
    row("shared recordings right", &figures["open"]["right"], "10");
    row("blind machines right", &figures["blind"]["right"], "95 %");
    row("false alarms", &figures["blind"]["false_alarms"], "1 %");
    row(
        "EMPS force, published model, %",
        &figures["emps"]["published"]["force_percent"],
        "",
    );
    row(
        "EMPS force, ours, %",
        &figures["emps"]["ours"]["force_percent"],
        "",
    );
    row(
        "EMPS force, ours with homing, %",
        &figures["emps"]["ours_homed"]["force_percent"],
        "2.9",
    );
    row(
        "LAAS current before, %",
        &figures["laas"]["before_percent"],
        "",
    );
    row(
        "LAAS current after, %",
        &figures["laas"]["after_percent"],
        "5",
    );
    row(
        "paper, model less measured, points",
        &figures["paper"]["rms_points"],
        "",
    );
    row(
        "seconds per recording",
        &figures["seconds_per_recording"],
        "2",
    );
    println!(
        "{}",
        figures["paper"]["sentence"].as_str().unwrap_or_default()
    );
}
