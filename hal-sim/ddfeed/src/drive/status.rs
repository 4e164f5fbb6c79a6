//! `drive status` and `drive faults`.

use super::connect::Drive;
use anyhow::{Context, Result};
use link::codes::{Fault, Origin};
use link::host::status::{StatusReport, code, entry_json, event_json, fault_json, is_fault, kind};
use serde_json::{Value, json};

/// Where a simulated drive has the settings of its flash from.
const STARTED_WITH: &str = "The simulated drive runs on the settings that it was started with, of `serve --settings` or `serve --flash`, or \
                            that were stored since. They are lost when `serve` ends without `--flash`.";

/// Prints what the drive is doing.
pub fn status(drive: &mut Drive, as_json: bool) -> Result<()> {
    let settings = drive.settings()?;
    let seen = StatusReport::of(drive.status()?);
    if as_json {
        println!("{:#}", seen.json(&settings, drive.simulated()));
        return Ok(());
    }
    println!("{}", seen.line(&settings));
    if let Some(fault) = seen.fault() {
        println!("Fault: {}", fault.sentence());
    }
    for fault in seen.further() {
        println!("And: {}", fault.sentence());
    }
    for (motor, whose) in [(None, "pair"), (Some(0), "screw"), (Some(1), "nut")] {
        for limit in seen.limits(motor) {
            println!("Limited, {whose}: {}", limit.sentence());
        }
    }
    for warning in settings.warnings() {
        println!("Warning: {}", warning.sentence());
    }
    if let Some(reason) = seen.misalignment() {
        println!("Alignment: {}", reason.sentence());
    }
    if let Some(origin) = seen.origin().filter(|origin| *origin != Origin::Own) {
        let unfit = seen.unfit();
        let which = unfit.map_or_else(String::new, |setting| {
            format!(" The first of them is {setting}.")
        });
        let sentence = match origin {
            Origin::Stored if drive.simulated() => STARTED_WITH,
            _ => origin.sentence(),
        };
        println!("Settings: {sentence}{which}");
    }
    for (name, fit) in seen.tables() {
        println!("Table of the {name}: {}. {}", fit.name(), fit.sentence());
    }
    let (screw, nut, feed) = (&settings.screw, &settings.nut, &settings.feed);
    println!(
        "Limits: screw {} rpm and {} N m, nut {} rpm and {} N m, table {} mm/s, {} mm/s^2 and {} mm/s^3",
        screw.speed_max_rpm,
        rounded(screw.torque_max_nm),
        nut.speed_max_rpm,
        rounded(nut.torque_max_nm),
        feed.velocity_max_mm_s,
        feed.acceleration_max_mm_s2,
        feed.jerk_max_mm_s3
    );
    match settings.soft_limits_mm() {
        Some([least, most]) if seen.homed() => {
            println!("Soft limits: the table stays between {least} and {most} mm");
        }
        Some([least, most]) => println!(
            "Soft limits of {least} and {most} mm do not act: the drive is not homed; `home` finds its place"
        ),
        None => {}
    }
    Ok(())
}

/// Prints the fault that has stopped the drive, and what happened, also before a reset.
pub fn faults(drive: &mut Drive, as_json: bool) -> Result<()> {
    let now = StatusReport::of(drive.status()?);
    let (last, journal) = (drive.faults()?, drive.journal()?);
    if as_json {
        let last: Vec<Value> = last.iter().map(entry_json).collect();
        let further: Vec<Value> = now.further().map(fault_json).collect();
        let events: Vec<Value> = journal.iter().map(event_json).collect();
        println!(
            "{:#}",
            json!({
                "fault": now.fault().map(fault_json),
                "further_faults": further,
                "last": last,
                "events": events,
            })
        );
        return Ok(());
    }
    match now.fault() {
        Some(fault) => println!("{}: {}", fault.name(), fault.sentence()),
        None => println!("no fault"),
    }
    for fault in now.further() {
        println!("and {}: {}", fault.name(), fault.sentence());
    }
    for one in &journal {
        let seconds = f64::from(one.uptime_ms) / 1e3;
        let mut line = format!(
            "{:>5}  {seconds:9.3} s  {}: {}",
            one.number,
            kind(one),
            code(one)
        );
        let unit = Fault::of_word(one.code).and_then(Fault::unit);
        if let (Some(unit), true) = (unit, is_fault(one)) {
            let [value, limit] = one.values;
            line += &format!(" ({value} {unit}");
            line += &if limit == 0 {
                ")".into()
            } else {
                format!(", limit {limit})")
            };
        }
        println!("{line}");
    }
    Ok(())
}

/// To four places: a torque that comes of a current has more.
fn rounded(torque_nm: f64) -> f64 {
    (torque_nm * 1e4).round() / 1e4
}

/// The drive's state and settings, for what goes on over a while.
pub fn look(drive: &mut Drive) -> Result<StatusReport> {
    Ok(StatusReport::of(
        drive.status().context("while it was looked at")?,
    ))
}
