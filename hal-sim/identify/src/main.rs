//! `identify`: from a recording to the effect that its model lacks.

use clap::{Parser, Subcommand};
use identify::report;
use plant::model::Model;
use plant::recording::Recording;
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
    /// The recording to identify from (.csv, .csv.gz).
    #[arg(long, required = true)]
    fit: Option<PathBuf>,
    /// Another recording of the same machine: it confirms, and errors are reported on it.
    #[arg(long, required = true)]
    check: Option<PathBuf>,
    /// Folder for report.json, report.html, model.toml and residual.csv.
    #[arg(long, required = true)]
    out: Option<PathBuf>,
}

#[derive(Subcommand)]
enum Command {
    /// The figures that the tool is held to, on the recordings and measured data beside the project.
    Bench {
        /// As JSON.
        #[arg(long)]
        json: bool,
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
    let (Some(model), Some(fit), Some(check), Some(out)) =
        (arguments.model, arguments.fit, arguments.check, arguments.out)
    else {
        return Ok(());
    };
    let model = Model::load(&model)?;
    let fit = Recording::load(&fit)?;
    let check = Recording::load(&check)?;
    let outcome = identify::analysis::analyse(&model, &fit, &check);
    report::write(&outcome, &out)?;
    println!("verdict: {}", outcome.verdict());
    for found in &outcome.effects {
        print!("{} at {}:", found.effect.effect().kind(), found.effect.place().name());
        for estimate in identify::interval::estimates(found) {
            let [low, high] = estimate.interval;
            print!(" {} {:.5} ({low:.5} to {high:.5})", estimate.name, estimate.value);
        }
        println!("; explains {:.1} %", 100.0 * found.explained);
    }
    println!("report: {}", out.join("report.html").display());
    Ok(())
}
