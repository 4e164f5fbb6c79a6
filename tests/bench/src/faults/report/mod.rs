//! `cargo xtask bench faults`: each input, wrong in each way, in each situation, and what comes of it.

mod interruptions;
mod page;
mod small;
mod story;

use crate::faults::{Cell, Drives, Hazard, Matrix, Outcome};
use anyhow::Result;
use clap::Args;
use control::supervisor::State;
use ddfeed::simulate::Bridges;
use hal_sim::boards::BoardKind;
use serde::Serialize;
use std::collections::BTreeMap;

/// All cells.
#[derive(Serialize)]
struct Report {
    cells: usize,
    #[serde(rename = "unsafe")]
    hazardous: usize,
    detection_us: Detection,
    travel_mm_worst: f64,
    overcurrent_periods_worst: f64,
    wrong_cause: usize,
    cells_detail: Vec<Detail>,
    scenarios: Vec<story::Told>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pairs: Option<story::Pairs>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    interruptions: Vec<interruptions::Row>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    soak: Vec<story::Long>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    steady: Vec<story::SteadyRow>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    small: Vec<small::Row>,
}

#[derive(Serialize)]
struct Detection {
    median: f64,
    worst: f64,
}

/// A cell.
#[derive(Serialize)]
struct Detail {
    board: &'static str,
    input: String,
    defect: &'static str,
    situation: &'static str,
    /// `detected`, or `harmless` where nothing was seen and nothing done wrong, else `missed`.
    found: &'static str,
    detection_us: Option<f64>,
    peak_a: f64,
    overcurrent_periods: f64,
    bus_j: f64,
    travel_mm: f64,
    end_stop_n: f64,
    state: &'static str,
    first_cause: Option<&'static str>,
    misalignment: Option<&'static str>,
    wrong_cause: bool,
    hazards: Vec<&'static str>,
}

const fn board_name(board: BoardKind) -> &'static str {
    match board {
        BoardKind::Nucleo => "nucleo_g474re",
        BoardKind::Nucleo40kHz => "nucleo_g474re at 40 kHz",
        BoardKind::Mains => "mains_310v",
    }
}

impl Detail {
    fn of(cell: &Cell, outcome: &Outcome) -> Self {
        let fault = cause(outcome.state);
        Self {
            board: board_name(cell.board),
            input: cell.input.name(),
            defect: cell.defect.name(),
            situation: cell.situation.name(),
            found: match (outcome.detected_s, outcome.hazards.is_empty()) {
                (Some(_), _) => "detected",
                (None, true) => "harmless",
                (None, false) => "missed",
            },
            detection_us: outcome.detected_s.map(|seconds| 1e6 * seconds),
            peak_a: outcome.peak_a,
            overcurrent_periods: outcome.over_current_periods,
            bus_j: outcome.returned_j,
            travel_mm: 1e3 * outcome.travel_m,
            end_stop_n: outcome.end_force_n,
            state: outcome.state.name(),
            first_cause: fault,
            misalignment: outcome.misalignment.map(|found| found.reason.name()),
            wrong_cause: outcome.wrong_cause,
            hazards: outcome.hazards.iter().map(|hazard| hazard.name()).collect(),
        }
    }
}

fn worst(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, f64::max)
}

impl Report {
    fn of(cells: &[Cell], outcomes: &[Outcome]) -> Self {
        let mut detected: Vec<f64> = outcomes.iter().filter_map(|o| o.detected_s).collect();
        detected.sort_by(f64::total_cmp);
        let unsafe_cells = outcomes.iter().filter(|o| !o.hazards.is_empty());
        Self {
            cells: cells.len(),
            hazardous: unsafe_cells.count(),
            detection_us: Detection {
                median: 1e6
                    * detected
                        .get(detected.len() / 2)
                        .copied()
                        .unwrap_or_default(),
                worst: 1e6 * detected.last().copied().unwrap_or_default(),
            },
            travel_mm_worst: 1e3 * worst(outcomes.iter().map(|o| o.travel_m)),
            overcurrent_periods_worst: worst(outcomes.iter().map(|o| o.over_current_periods)),
            wrong_cause: outcomes.iter().filter(|o| o.wrong_cause).count(),
            cells_detail: cells
                .iter()
                .zip(outcomes)
                .map(|(cell, outcome)| Detail::of(cell, outcome))
                .collect(),
            scenarios: Vec::new(),
            pairs: None,
            interruptions: Vec::new(),
            soak: Vec::new(),
            steady: Vec::new(),
            small: Vec::new(),
        }
    }
}

/// The first cause, if it is in a fault.
fn cause(state: State) -> Option<&'static str> {
    match state {
        State::Fault(fault) => Some(fault.name()),
        _ => None,
    }
}

/// Which cells, and how to say it.
#[derive(Args)]
pub struct FaultsOptions {
    /// Runs each so-many-th cell only.
    #[arg(long, default_value = "1")]
    pub every: std::num::NonZeroUsize,
    /// So many random pairs of faults besides.
    #[arg(long, default_value_t = 200)]
    pub pairs: usize,
    /// Seed of their draw: other seeds draw other pairs.
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    pub pair_seed: u64,
    /// And alignments that each of six causes interrupts at so many random moments, on both boards. 1,000 take 25 minutes of CPU.
    #[arg(long, value_name = "MOMENTS", default_value_t = 20)]
    pub interruptions: u64,
    /// And long runs of so many simulated seconds each, on both boards: with random commands, faults and resets.
    #[arg(long, value_name = "SECONDS")]
    pub soak: Option<f64>,
    /// The same of hard but healthy running, in which no watch may stop the drive.
    #[arg(long, value_name = "SECONDS")]
    pub healthy: Option<f64>,
    /// And steady running of so many seconds at each of six common speeds and three loads, on both boards.
    #[arg(long, value_name = "SECONDS")]
    pub steady: Option<f64>,
    /// And sensor faults of growing size: slipped encoder, weak flux, a channel's gain, an encoder frozen at rest.
    #[arg(long)]
    pub small: bool,
    /// Of drives that compensate what repeats with their angles, as the firmware's feature `smooth` does.
    #[arg(long)]
    pub compensated: bool,
    /// How the bridges make their voltages. Scenarios and interrupted alignments keep mean voltages.
    #[arg(long, value_enum, default_value = "mean")]
    pub bridges: Bridges,
    /// Writes the matrix as a page into this folder.
    #[arg(long)]
    pub out: Option<std::path::PathBuf>,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// Runs and prints.
pub fn run(options: &FaultsOptions) -> Result<()> {
    let cells = Cell::all().into_iter().step_by(options.every.get());
    let cells: Vec<Cell> = cells.collect();
    let drives = Drives {
        compensated: options.compensated,
        switching: options.bridges.switching(),
    };
    let outcomes = Matrix::of(&cells, drives)?.run_all(&cells)?;
    let report = Report {
        scenarios: story::scenarios()?,
        pairs: match options.pairs {
            0 => None,
            count => Some(story::pairs(count, options.pair_seed, drives)?),
        },
        interruptions: interruptions::rows(options.interruptions)?,
        soak: story::long_runs(options.healthy, options.soak, drives)?,
        steady: story::steady(options.steady, drives)?,
        small: match options.small {
            true => small::rows(drives.switching)?,
            false => Vec::new(),
        },
        ..Report::of(&cells, &outcomes)
    };
    if options.json {
        println!("{}", serde_json::to_string(&report)?);
    } else {
        tell(&report, &cells, &outcomes);
        story::tell_scenarios(&report.scenarios);
        report.pairs.iter().for_each(story::tell_pairs);
        interruptions::tell(&report.interruptions);
        story::tell_soaks(&report.soak);
        story::tell_steady(&report.steady);
        small::tell(&report.small);
    }
    if let Some(out) = &options.out {
        std::fs::create_dir_all(out)?;
        let path = out.join("report.html");
        std::fs::write(&path, page::page(&report, &cells, &outcomes))?;
        if !options.json {
            println!("{}", path.display());
        }
    }
    Ok(())
}

fn tell(report: &Report, cells: &[Cell], outcomes: &[Outcome]) {
    let mut groups: BTreeMap<(String, &str), Vec<&Detail>> = BTreeMap::new();
    for detail in report.cells_detail.iter().filter(|d| !d.hazards.is_empty()) {
        let cause = detail.first_cause.unwrap_or("no fault");
        let key = (format!("{:?}", detail.hazards), cause);
        groups.entry(key).or_default().push(detail);
    }
    for ((hazards, cause), details) in &groups {
        println!("{} unsafe by {hazards}, stopped by: {cause}", details.len());
        for d in details {
            println!(
                "  {:<14} {:<22} {:<10} {:<15} {:>9.1} ms {:>7.2} A {:>5.1} periods {:>7.2} mm {:>6.1} J {:>6.0} N {}",
                d.board,
                d.input,
                d.defect,
                d.situation,
                d.detection_us.unwrap_or(f64::NAN) / 1e3,
                d.peak_a,
                d.overcurrent_periods,
                d.travel_mm,
                d.bus_j,
                d.end_stop_n,
                d.misalignment.unwrap_or_default()
            );
        }
    }
    let count = |hazard: Hazard| {
        let has = outcomes.iter().filter(|o| o.hazards.contains(&hazard));
        has.count()
    };
    let found = |what: &str| {
        let has = report.cells_detail.iter().filter(|d| d.found == what);
        has.count()
    };
    println!(
        "\n{} cells: {} detected, {} harmless, {} missed; {} unsafe: {} by over-current, {} by travel, {} by a wrong cause",
        cells.len(),
        found("detected"),
        found("harmless"),
        found("missed"),
        report.hazardous,
        count(Hazard::OverCurrent),
        count(Hazard::Travel),
        count(Hazard::WrongCause)
    );
    println!(
        "detection: median {:.1} ms, worst {:.0} ms; worst travel {:.1} mm; worst over-current {:.1} periods",
        report.detection_us.median / 1e3,
        report.detection_us.worst / 1e3,
        report.travel_mm_worst,
        report.overcurrent_periods_worst
    );
}
