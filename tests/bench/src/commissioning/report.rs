//! `cargo xtask bench commission`: drives of two decades of power commissioned over their link, beside the truth.

use super::{Outcome, Rivals, USUAL, any_size, commission, rivals};
use crate::alignment::{miswirings, of_board};
use anyhow::{Context, Result};
use clap::Args;
use ddfeed::simulate::{BoardName, Bridges};
use hal_sim::parallel::on_all_cores;
use plant::Axis;
use serde::Serialize;

/// Furthest that a parameter may be off, %, and an angle, degrees.
const ERROR_GOAL_PERCENT: f64 = 5.0;
const ANGLE_GOAL_DEG: f64 = 1.0;
/// Furthest that a bandwidth may be from what was predicted, and the smallest phase margin, degrees.
const BANDWIDTH_GOAL: f64 = 0.1;
const MARGIN_GOAL_DEG: f64 = 40.0;
/// Seed of what is wired wrongly.
const MISWIRED_SEED: u64 = 3_000_000;

#[derive(Default, Serialize)]
struct Worst {
    r: f64,
    l: f64,
    flux: f64,
    inertia: f64,
}

/// Largest and median size of the errors of other drives' procedures, on all machines, %.
#[derive(Serialize)]
struct Other {
    odrive_r: [f64; 2],
    odrive_l: [f64; 2],
    vesc_r: [f64; 2],
}

/// Errors, margins and bandwidths are of the drives that were commissioned to the end.
#[derive(Serialize)]
struct Report {
    drives: u64,
    right: usize,
    finished: usize,
    error_percent_worst: Worst,
    offset_deg_worst: f64,
    signs_right: usize,
    miswirings: usize,
    named: usize,
    bandwidth_percent_worst: f64,
    phase_margin_deg_least: f64,
    limits_kept: usize,
    seconds_worst: f64,
    others_percent_worst_and_median: Other,
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |worst, value| worst.max(value.abs()))
}

fn is_right(outcome: &Outcome) -> bool {
    outcome.failure.is_none()
        && outcome.signs_right
        && outcome.within_limits
        && outcome.margin_deg > MARGIN_GOAL_DEG
        && largest(outcome.offset_deg.into_iter()) < ANGLE_GOAL_DEG
        && largest(outcome.error_percent.into_iter().flatten()) < ERROR_GOAL_PERCENT
        && largest(outcome.bandwidth_part.iter().map(|part| part - 1.0)) < BANDWIDTH_GOAL
}

/// How many, and how to say it.
#[derive(Args)]
pub struct CommissionOptions {
    /// Drives.
    #[arg(long, default_value_t = 100)]
    pub drives: u64,
    /// Seed of the first.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// A shipped board's own machine, with another load and other rotor angles for each seed; `paper`: machines of any size.
    #[arg(long, value_enum, default_value_t = BoardName::Paper)]
    pub board: BoardName,
    /// How the bridges make their voltages.
    #[arg(long, value_enum, default_value = "mean")]
    pub bridges: Bridges,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// Runs and prints.
pub fn run(options: &CommissionOptions) -> Result<()> {
    let seeds: Vec<u64> = (options.seed..options.seed.saturating_add(options.drives)).collect();
    let start = |seed: u64| {
        let mut start = match options.board.kind() {
            Some(board) => of_board(board, seed),
            None => any_size(seed),
        };
        start.board.switching = options.bridges.switching();
        start
    };
    let outcomes = on_all_cores(&seeds, |seed| commission(&start(*seed), &USUAL))
        .into_iter()
        .zip(&seeds)
        .map(|(outcome, seed)| {
            outcome.with_context(|| format!("drive {seed} cannot be configured"))
        })
        .collect::<Result<Vec<Outcome>>>()?;
    if !options.json {
        for (outcome, seed) in outcomes.iter().zip(&seeds) {
            tell(*seed, outcome);
        }
    }
    let wrong = miswired(options.bridges)?;
    if !options.json {
        for one in &wrong {
            let mark = if one.named { ' ' } else { '!' };
            println!("{mark} {}: {}", one.name, one.failure);
        }
    }
    let others: Vec<Rivals> = on_all_cores(&seeds, |seed| {
        let start = start(*seed);
        Axis::ALL.map(|axis| rivals(&start, axis))
    })
    .into_iter()
    .flatten()
    .collect();
    let report = report(options.drives, &outcomes, &wrong, &others);
    if options.json {
        println!("{}", serde_json::to_string(&report)?);
    } else {
        print(&report);
    }
    Ok(())
}

/// A drive that is wired wrongly.
struct Miswired {
    name: String,
    /// What commissioning said.
    failure: String,
    /// It names what is wrong.
    named: bool,
}

/// Commissions drives that are wired wrongly.
fn miswired(bridges: Bridges) -> Result<Vec<Miswired>> {
    let wrong: Vec<_> = miswirings(MISWIRED_SEED)
        .into_iter()
        .filter_map(|wrong| Some((wrong.expected?, wrong)))
        .collect();
    on_all_cores(&wrong, |(expected, wrong)| {
        let mut start = wrong.start.clone();
        start.board.switching = bridges.switching();
        let failure = commission(&start, &USUAL)?.failure.unwrap_or_default();
        let named = failure.contains(expected.reason.name())
            && failure.contains(expected.reason.sentence());
        Ok(Miswired {
            name: wrong.name.clone(),
            failure,
            named,
        })
    })
    .into_iter()
    .collect()
}

fn report(drives: u64, outcomes: &[Outcome], wrong: &[Miswired], others: &[Rivals]) -> Report {
    let finished: Vec<&Outcome> = outcomes.iter().filter(|o| o.failure.is_none()).collect();
    let error = |k: usize| {
        largest(
            finished
                .iter()
                .flat_map(|o| o.error_percent.iter().map(move |motor| motor[k])),
        )
    };
    let spread = |of: &dyn Fn(&Rivals) -> f64| {
        let mut sizes: Vec<f64> = others.iter().map(|other| of(other).abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let middle = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
        [sizes.last().copied().unwrap_or(0.0), middle]
    };
    Report {
        drives,
        right: outcomes.iter().filter(|outcome| is_right(outcome)).count(),
        finished: finished.len(),
        error_percent_worst: Worst {
            r: error(0),
            l: error(1),
            flux: error(2),
            inertia: error(3),
        },
        offset_deg_worst: largest(finished.iter().flat_map(|o| o.offset_deg)),
        signs_right: finished.iter().filter(|o| o.signs_right).count(),
        miswirings: wrong.len(),
        named: wrong.iter().filter(|one| one.named).count(),
        bandwidth_percent_worst: 100.0
            * largest(
                finished
                    .iter()
                    .flat_map(|o| o.bandwidth_part.map(|part| part - 1.0)),
            ),
        phase_margin_deg_least: finished
            .iter()
            .map(|o| o.margin_deg)
            .fold(f64::INFINITY, f64::min),
        limits_kept: outcomes.iter().filter(|o| o.within_limits).count(),
        seconds_worst: largest(outcomes.iter().map(|o| o.seconds)),
        others_percent_worst_and_median: Other {
            odrive_r: spread(&|other| other.odrive_r_percent),
            odrive_l: spread(&|other| other.odrive_l_percent),
            vesc_r: spread(&|other| other.vesc_r_percent),
        },
    }
}

fn print(report: &Report) {
    println!(
        "\n{} of {} drives right, {} commissioned to the end; of these R, L, flux, inertia at most {:.1}, {:.1}, {:.1}, {:.1} % off (goal \
         {ERROR_GOAL_PERCENT}), angles {:.2} degrees (goal {ANGLE_GOAL_DEG}), bandwidth {:.1} % from what was predicted (goal {:.0}), \
         phase margin at least {:.1} degrees (goal {MARGIN_GOAL_DEG}); all limits kept on {}; {:.0} s at most\n{} of {} wrong wirings named",
        report.right,
        report.drives,
        report.finished,
        report.error_percent_worst.r,
        report.error_percent_worst.l,
        report.error_percent_worst.flux,
        report.error_percent_worst.inertia,
        report.offset_deg_worst,
        report.bandwidth_percent_worst,
        100.0 * BANDWIDTH_GOAL,
        report.phase_margin_deg_least,
        report.limits_kept,
        report.seconds_worst,
        report.named,
        report.miswirings,
    );
    let Other {
        odrive_r,
        odrive_l,
        vesc_r,
    } = &report.others_percent_worst_and_median;
    println!(
        "other drives' procedures on the same machines, % off at most (median): ODrive R {:.0} ({:.1}), L {:.0} ({:.1}); VESC R {:.0} ({:.1})",
        odrive_r[0], odrive_r[1], odrive_l[0], odrive_l[1], vesc_r[0], vesc_r[1]
    );
}

fn tell(seed: u64, outcome: &Outcome) {
    let mark = if is_right(outcome) { ' ' } else { '!' };
    match &outcome.failure {
        Some(failure) => println!("{mark} drive {seed}: {failure}"),
        None => println!(
            "{mark} drive {seed}: R, L, flux, J {:+.1?} % off, angle {:+.2?} degrees, bandwidth {:.2?}, margin {:.0} degrees, {:.0} s",
            outcome.error_percent,
            outcome.offset_deg,
            outcome.bandwidth_part,
            outcome.margin_deg,
            outcome.seconds
        ),
    }
}
