//! `cargo xtask bench align`: starts on drawn machines, wrong wiring, and loads that nothing holds.

use super::AlignOptions;
use anyhow::Result;
use hal_sim::alignment::{Outcome, Start, miswirings};
use serde::Serialize;

/// Largest error of the electrical angle, degrees.
const ERROR_GOAL_DEG: f64 = 2.0;
/// Furthest that the table may move, um.
const TRAVEL_GOAL_UM: f64 = 50.0;
/// Starts with a load that friction does not hold.
const LOOSE: u64 = 12;
/// Seeds of what is wired wrongly and of loose loads.
const MISWIRED_SEED: u64 = 1_000_000;
const LOOSE_SEED: u64 = 2_000_000;

#[derive(Serialize)]
struct Report {
    starts: u64,
    aligned: u64,
    error_deg_worst: f64,
    travel_um_worst: f64,
    torque_nm_worst: f64,
    seconds_worst: f64,
    miswirings: usize,
    named: usize,
    miswired_travel_um_worst: f64,
    miswired_torque_nm_worst: f64,
    loose: u64,
    loose_refused: u64,
}

/// What a drive says of an outcome.
fn said(outcome: &Outcome) -> String {
    match outcome.misalignment {
        Some(found) => {
            format!("{:?}: {}", found.part, found.reason.name())
        }
        None => format!("{:?}", outcome.state),
    }
}

/// Runs and prints.
pub(super) fn run(options: &AlignOptions) -> Result<()> {
    let mut report = Report {
        starts: options.starts,
        aligned: 0,
        error_deg_worst: 0.0,
        travel_um_worst: 0.0,
        torque_nm_worst: 0.0,
        seconds_worst: 0.0,
        miswirings: 0,
        named: 0,
        miswired_travel_um_worst: 0.0,
        miswired_torque_nm_worst: 0.0,
        loose: LOOSE,
        loose_refused: 0,
    };
    let tell = |sentence: String| {
        if !options.json {
            println!("{sentence}");
        }
    };
    for seed in 1..=options.starts {
        let outcome = Start::drawn(seed).run()?;
        report.travel_um_worst = report.travel_um_worst.max(outcome.travel_m * 1e6);
        report.torque_nm_worst = report.torque_nm_worst.max(outcome.torque_nm);
        report.seconds_worst = report.seconds_worst.max(outcome.seconds);
        if outcome.is_ready() {
            report.aligned += 1;
            report.error_deg_worst = report.error_deg_worst.max(outcome.error_deg_worst());
        } else {
            tell(format!("start {seed} refused: {}", said(&outcome)));
        }
    }
    for miswiring in miswirings(MISWIRED_SEED) {
        let outcome = miswiring.start.run()?;
        report.miswirings += 1;
        let right = match miswiring.expected {
            Some(expected) => outcome.misalignment == Some(expected),
            None => outcome.is_ready() && outcome.error_deg_worst() < ERROR_GOAL_DEG,
        };
        report.named += usize::from(right);
        report.miswired_travel_um_worst =
            report.miswired_travel_um_worst.max(outcome.travel_m * 1e6);
        report.miswired_torque_nm_worst = report.miswired_torque_nm_worst.max(outcome.torque_nm);
        let mark = if right { ' ' } else { '!' };
        tell(format!("{mark} {:<48} {}", miswiring.name, said(&outcome)));
    }
    for seed in 0..LOOSE {
        let outcome = Start::loose(LOOSE_SEED + seed).run()?;
        report.loose_refused += u64::from(outcome.misalignment.is_some());
    }
    if options.json {
        println!("{}", serde_json::to_string(&report)?);
        return Ok(());
    }
    println!(
        "\n{} of {} starts aligned, the worst {:.2} degrees off (goal {ERROR_GOAL_DEG}); the table moved by at most {:.1} um \
         (goal {TRAVEL_GOAL_UM}), currents made at most {:.3} N m; {:.2} s at most",
        report.aligned,
        report.starts,
        report.error_deg_worst,
        report.travel_um_worst,
        report.torque_nm_worst,
        report.seconds_worst
    );
    println!(
        "{} of {} miswirings named or harmless as expected, within {:.1} um and {:.3} N m; {} of {} loose loads refused",
        report.named,
        report.miswirings,
        report.miswired_travel_um_worst,
        report.miswired_torque_nm_worst,
        report.loose_refused,
        report.loose
    );
    Ok(())
}
