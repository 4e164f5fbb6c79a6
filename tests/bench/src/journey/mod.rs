//! `cargo xtask bench journey`: machines of users from cold to a smoother table, by the commands alone.
//!
//! Each machine has a process of its own: what its commands print stays apart, and time is the simulated drive's.

mod draw;
mod one;
mod truth;

pub use draw::machine;
pub use one::{Row, travel};

use anyhow::{Context, Result, ensure};
use clap::Args;
use ddfeed::simulate::Bridges;
use hal_sim::parallel::on_all_cores;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::Command;

/// How far a ripple may be from what was predicted, of that.
const PREDICTED: f64 = 0.2;
/// How much two recordings of the same may differ, of the larger: noise, and where the table stands.
const SAME: f64 = 0.1;

/// Which machines.
#[derive(Args)]
pub struct JourneyOptions {
    /// Machines.
    #[arg(long, default_value_t = 40)]
    pub machines: u64,
    /// Seed of the first.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Keeps the files of each machine here, in a folder `machine-SEED`, in place of an earlier run's.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// How the bridges make their voltages.
    #[arg(long, value_enum, default_value = "mean")]
    pub bridges: Bridges,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
    /// The machine of `--seed` alone, within this process.
    #[arg(long, hide = true)]
    pub alone: bool,
}

/// What came of all.
#[derive(Serialize)]
pub struct Report {
    /// Machines.
    pub machines: usize,
    /// Those of which no step failed.
    pub complete: usize,
    /// Those for which `compensate` wrote something.
    pub compensated: usize,
    /// Those whose ripple is within a fifth of the predicted.
    pub predicted_within_fifth: usize,
    /// Those whose ripple rose.
    pub worse: usize,
    /// Those whose ripple after the restart is the one before.
    pub restart_same: usize,
    /// Commissioned values that `identify` made worse.
    pub values_worse: usize,
    /// Each.
    pub rows: Vec<Row>,
}

impl Report {
    /// Counts.
    #[must_use]
    pub fn of(rows: Vec<Row>) -> Self {
        let count = |of: &dyn Fn(&Row) -> bool| rows.iter().filter(|row| of(row)).count();
        Self {
            machines: rows.len(),
            complete: count(&|row| row.failed_step.is_none()),
            compensated: count(&Row::is_compensated),
            predicted_within_fifth: count(&Row::is_as_predicted),
            worse: count(&Row::is_worse),
            restart_same: count(&Row::is_same_after_restart),
            values_worse: rows.iter().map(|row| row.values_worse.len()).sum(),
            rows,
        }
    }
}

impl Row {
    /// The ripple with the compensation is within a fifth of the predicted.
    #[must_use]
    pub fn is_as_predicted(&self) -> bool {
        let pair = self.ripple_after.zip(self.ripple_predicted);
        pair.is_some_and(|(after, predicted)| (after / predicted - 1.0).abs() <= PREDICTED)
    }

    /// The compensation raised the ripple, by more than two recordings of the same differ. At a speed of whole counts a row, the
    /// counts' part is anything up to twice the floor.
    #[must_use]
    pub fn is_worse(&self) -> bool {
        let pair = self.ripple_after.zip(self.ripple_before);
        self.is_compensated()
            && pair.is_some_and(|(after, before)| {
                let differ = (0.5 * SAME * before).max(self.ripple_repeats);
                after > before + differ + self.scale_floor
            })
    }

    /// `compensate` wrote something: it writes nothing that brings no gain or that a restart loses.
    #[must_use]
    pub fn is_compensated(&self) -> bool {
        let pair = self.ripple_predicted.zip(self.ripple_before);
        pair.is_some_and(|(predicted, before)| predicted < (1.0 - 1e-9) * before)
    }

    /// Power off and on changed nothing, but for what two recordings of the same differ by.
    #[must_use]
    pub fn is_same_after_restart(&self) -> bool {
        let pair = self.ripple_after.zip(self.ripple_restarted);
        pair.is_some_and(|(after, again)| {
            let differ = (SAME * after.max(again)).max(self.ripple_repeats);
            (after - again).abs() <= differ + self.scale_floor
        })
    }
}

/// Runs and prints.
pub fn run(options: &JourneyOptions) -> Result<()> {
    let temporary = tempfile::tempdir()?;
    let out = options.out.as_deref().unwrap_or(temporary.path());
    if options.alone {
        let row = travel(options.seed, options.bridges, &folder(out, options.seed));
        println!("{}", serde_json::to_string(&row)?);
        return Ok(());
    }
    let seeds: Vec<u64> = (options.seed..options.seed.saturating_add(options.machines)).collect();
    let rows = on_all_cores(&seeds, |seed| {
        let row = apart(*seed, options.bridges, out);
        if !options.json {
            match &row {
                Ok(row) => tell(row),
                Err(error) => println!("machine {seed}: {error:#}"),
            }
        }
        row
    })
    .into_iter()
    .collect::<Result<Vec<Row>>>()?;
    let report = Report::of(rows);
    if options.json {
        println!("{}", serde_json::to_string(&report)?);
        return Ok(());
    }
    println!(
        "\nof {} machines: {} complete, {} compensated, {} within a fifth of the prediction, {} worse, {} the same after a restart; \
         {} commissioned values made worse",
        report.machines,
        report.complete,
        report.compensated,
        report.predicted_within_fifth,
        report.worse,
        report.restart_same,
        report.values_worse
    );
    Ok(())
}

fn folder(out: &Path, seed: u64) -> PathBuf {
    out.join(format!("machine-{seed}"))
}

/// A machine in a process of its own. The last line that it prints is its row.
fn apart(seed: u64, bridges: Bridges, out: &Path) -> Result<Row> {
    let mut command = Command::new(std::env::current_exe()?);
    command.args(["journey", "--alone", "--seed"]);
    command.arg(seed.to_string()).arg("--out").arg(out);
    if bridges == Bridges::Switching {
        command.args(["--bridges", "switching"]);
    }
    let output = command.output()?;
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    // The temporary folder of a machine is gone with the report.
    let folder = folder(out, seed);
    if folder.exists() {
        std::fs::write(folder.join("said.txt"), format!("{said}\n{errors}"))?;
    }
    if !output.status.success() {
        return Ok(Row {
            seed,
            failed_step: Some(format!("the program ended: {}", errors.trim())),
            ..Row::default()
        });
    }
    let last = said.lines().last().context("a machine printed nothing")?;
    ensure!(last.starts_with('{'), "the last line is no row: {last}");
    Ok(serde_json::from_str(last)?)
}

fn tell(row: &Row) {
    let mark = |right: bool, letter: char| if right { ' ' } else { letter };
    let percent =
        |ripple: Option<f64>| ripple.map_or("-".to_owned(), |value| format!("{value:.3}"));
    println!(
        "{}{}{}{} machine {:>4}: {:5.1} V {:4.1} bits {:<11} before {} predicted {} after {} restarted {} % [{}] named [{}]{}{}",
        mark(row.failed_step.is_none(), 'F'),
        mark(row.is_as_predicted(), 'p'),
        mark(!row.is_worse(), 'W'),
        mark(row.is_same_after_restart(), 'r'),
        row.seed,
        row.bus_v,
        row.encoder_bits,
        row.encoder,
        percent(row.ripple_before),
        percent(row.ripple_predicted),
        percent(row.ripple_after),
        percent(row.ripple_restarted),
        row.effects.join(", "),
        row.named.join(", "),
        if row.values_worse.is_empty() {
            String::new()
        } else {
            format!(" worse: {}", row.values_worse.join(", "))
        },
        row.failed_step
            .as_ref()
            .map_or(String::new(), |step| format!("\n     {step}"))
    );
}
