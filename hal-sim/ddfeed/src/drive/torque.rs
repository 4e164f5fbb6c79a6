//! One motor follows a torque, as long as the command runs.

use super::connect::Drive;
use super::motion::{caught, led, ready};
use super::options::{Motor, TorqueOptions};
use anyhow::{Context, Result, bail};
use link::codes::{Limit, State};
use link::host::command::{base_speed, torque_current};
use link::message::Command;
use link::settings::Settings;
use std::f64::consts::TAU;
use std::time::Duration;

/// Of the fastest that motor and feed allow, so that rounding does not exceed it.
const FASTEST: f64 = 0.999;

/// Holds a torque until Ctrl-C or as long as asked.
pub fn torque(drive: &mut Drive, options: &TorqueOptions) -> Result<()> {
    let settings = drive.settings()?;
    let command = command(&settings, options)?;
    let stop = caught()?;
    if options.arm {
        ready(drive, &stop)?;
    }
    drive.tell(command)?;
    let longest = options.duration.map(Duration::from_secs_f64);
    let mut ran = false;
    let mut at_a_limit = false;
    led(drive, &settings, &stop, |seen, elapsed| {
        ran |= seen.state == Some(State::Running);
        let travel = || seen.limits(None).any(|limit| limit == Limit::Travel);
        at_a_limit = ran && seen.state == Some(State::Holding) && travel();
        Ok(at_a_limit || longest.is_some_and(|longest| elapsed >= longest))
    })?;
    if at_a_limit {
        bail!(
            "the table came near a soft limit (settings travel.soft_least_mm, travel.soft_most_mm): the torque has ended, and the \
             table is at rest. Give a torque the other way"
        );
    }
    println!("at rest");
    Ok(())
}

/// The link's command.
fn command(settings: &Settings, options: &TorqueOptions) -> Result<Command> {
    let (motor, plate, way) = match options.motor {
        Motor::Screw => (0, &settings.screw, 1.0),
        Motor::Nut => (1, &settings.nut, -1.0),
    };
    let lead_m = settings.feed.lead_mm * 1e-3;
    let torque_nm = match (options.nm, options.table_force) {
        (Some(torque_nm), _) => torque_nm,
        (None, force_n) => way * force_n.unwrap_or_default() * lead_m / TAU,
    };
    let by_feed = settings.feed.velocity_max_mm_s / settings.feed.lead_mm * 60.0;
    let fastest = FASTEST
        * plate
            .speed_max_rpm
            .min(by_feed - options.other_rpm.abs())
            .max(0.0);
    let current = torque_current(torque_nm, plate.voltage_constant_v_rms_per_krpm);
    Ok(Command::Torque {
        motor,
        current: current.with_context(|| {
            format!(
                "the torque is {torque_nm} N m, but the motor allows up to {} N m either way",
                plate.torque_max_nm
            )
        })?,
        speed: base_speed(options.rpm_max.unwrap_or(fastest), "--rpm-max")?,
        base: base_speed(options.other_rpm, "--other-rpm")?,
    })
}
