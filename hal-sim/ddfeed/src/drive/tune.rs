//! `drive tune`: gains for a bandwidth and a phase margin, of the motors as the settings describe them.

use super::connect::Drive;
use super::options::TuneOptions;
use super::settings::announce_restart;
use anyhow::{Result, ensure};
use commission::proposal::propose;
use commission::quantity::Quantity;
use commission::tune::{Tuned, Wanted, with_speed_loops};
use serde::Serialize;

#[derive(Serialize)]
struct Report<'a> {
    /// It holds now.
    set: bool,
    speed_loop_rad_s: f64,
    margin_deg: f64,
    quantities: &'a [Quantity],
}

/// Proposes, and sets it if that is asked.
pub fn run(drive: &mut Drive, options: &TuneOptions) -> Result<()> {
    let held = drive.settings()?;
    let (period_s, step_s) = (1.0 / drive.pwm_hz(), 1.0 / drive.speed_hz());
    let margin_deg = options.loops.margin;
    let wanted = Wanted {
        speed_rad_s: options.loops.speed_loop.unwrap_or(held.tuning.speed_rad_s),
        margin_deg,
    };
    let proposal = propose(&held, wanted, period_s, step_s)?;
    let speed_loop_rad_s = proposal.settings.tuning.speed_rad_s;
    if let Some(asked) = options.loops.speed_loop {
        let faster = with_speed_loops(&proposal.settings, asked);
        ensure!(
            speed_loop_rad_s >= asked,
            "speed loops of {asked} rad/s would have a phase margin of {:.1} degrees, but {margin_deg} are wanted: give --speed-loop {:.0} \
             or less, or a smaller --margin",
            Tuned::of(&faster, period_s, step_s).margin_deg(),
            speed_loop_rad_s.floor()
        );
    }
    if options.set && proposal.settings != held {
        announce_restart(drive, &held, &proposal.settings, options.restart)?;
        drive.configure(&proposal.settings)?;
    }
    if options.json {
        let report = Report {
            set: options.set,
            speed_loop_rad_s,
            margin_deg,
            quantities: &proposal.quantities,
        };
        println!("{}", serde_json::to_string_pretty(&report)?);
        return Ok(());
    }
    for quantity in &proposal.quantities {
        println!("{quantity}");
    }
    println!(
        "{}",
        match (proposal.settings == held, options.set) {
            (true, _) => "this is what is set",
            (false, true) => "set",
            (false, false) => "proposed: --set makes it hold",
        }
    );
    Ok(())
}
