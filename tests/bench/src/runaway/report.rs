//! `cargo xtask bench runaway`: wrong electrical angles, at rest and running, against what the plate allows.

use crate::runaway::WrongAngle;
use anyhow::Result;
use clap::Args;
use ddfeed::simulate::BoardName;
use serde::Serialize;

#[derive(Default, Serialize)]
struct Report {
    wrong_angles: usize,
    named: usize,
    within_limits: usize,
    seconds_worst: f64,
    peak_a_worst: f64,
    travel_mm_worst: f64,
    energy_j_worst: f64,
    /// The largest part of its limit that any of them took.
    part_of_limit_worst: f64,
}

/// On which board, and how to say it.
#[derive(Args)]
pub struct RunawayOptions {
    /// The board: as it ships, or the coupled machine with a good drive's sensors.
    #[arg(long, value_enum, default_value_t = BoardName::Mains)]
    pub board: BoardName,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// Runs and prints.
pub fn run(options: &RunawayOptions) -> Result<()> {
    let setup = WrongAngle::setup(options.board.kind());
    let plate = setup.plate();
    let mut report = Report::default();
    if !options.json {
        println!(
            "{:<30} {:>21} {:>15} {:>17} {:>15}  fault",
            "wrong angle (each: allowed)", "time, ms", "peak, A", "travel, mm", "energy, J"
        );
    }
    for wrong in WrongAngle::all() {
        let (outcome, limits) = (wrong.run(&setup)?, wrong.limits(&plate));
        let (named, within) = (outcome.names(wrong.axis), outcome.within(&limits));
        report.wrong_angles += 1;
        report.named += usize::from(named);
        report.within_limits += usize::from(within);
        for (worst, value) in [
            (&mut report.seconds_worst, outcome.seconds),
            (&mut report.peak_a_worst, outcome.peak_a),
            (&mut report.travel_mm_worst, 1e3 * outcome.travel_m),
            (&mut report.energy_j_worst, outcome.energy_j),
            (
                &mut report.part_of_limit_worst,
                [
                    outcome.seconds / limits.seconds,
                    outcome.peak_a / limits.peak_a,
                    outcome.travel_m / limits.travel_m,
                    outcome.energy_j / limits.energy_j,
                ]
                .into_iter()
                .fold(0.0, f64::max),
            ),
        ] {
            *worst = worst.max(value);
        }
        if !options.json {
            let when = if wrong.running { "running" } else { "at rest" };
            let name = format!("{:?} {:+.0} degrees, {when}", wrong.axis, wrong.degrees);
            println!(
                "{} {name:<28} {:>9.1} ({:>8.1}) {:>6.2} ({:>5.2}) {:>7.3} ({:>6.2}) {:>6.2} ({:>5.1})  {:?}",
                if named && within { ' ' } else { '!' },
                1e3 * outcome.seconds,
                1e3 * limits.seconds,
                outcome.peak_a,
                limits.peak_a,
                1e3 * outcome.travel_m,
                1e3 * limits.travel_m,
                outcome.energy_j,
                limits.energy_j,
                outcome.state
            );
        }
    }
    if options.json {
        println!("{}", serde_json::to_string(&report)?);
    } else {
        println!(
            "\n{} of {} named, {} within what the plate allows; at most {:.1} ms, {:.2} A, {:.3} mm, {:.2} J",
            report.named,
            report.wrong_angles,
            report.within_limits,
            1e3 * report.seconds_worst,
            report.peak_a_worst,
            report.travel_mm_worst,
            report.energy_j_worst
        );
    }
    Ok(())
}
