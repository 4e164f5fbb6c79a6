//! `attach` and `command`: a running drive looked at and told what to do.

use super::memory::with_chip;
use super::{LOOK, ctrl_c};
use crate::session::Which;
use anyhow::{Context, Result, bail};
use clap::Args;
use link::codes::{ResetReason, Run, State};
use link::host::{Drive, Memory, View};
use probe_rs::probe::DebugProbeInfo;
use std::f64::consts::TAU;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread;
use std::time::Duration;

/// How long the drive has to take a command.
const TAKE: Duration = Duration::from_millis(50);

/// What `command` can be asked.
#[derive(Args, Clone, Debug, PartialEq)]
#[command(group = clap::ArgGroup::new("what").required(true).multiple(true).args(["velocity", "base", "stop", "reset"]))]
pub struct CommandOptions {
    /// The probe.
    #[command(flatten)]
    pub which: Which,
    /// Run, with the table at this velocity, mm/s.
    #[arg(long, value_name = "MM_S", allow_negative_numbers = true, conflicts_with_all = ["stop", "reset"])]
    pub velocity: Option<f64>,
    /// Run, with the nut at this speed, rpm.
    #[arg(long, value_name = "RPM", allow_negative_numbers = true, conflicts_with_all = ["stop", "reset"])]
    pub base: Option<f64>,
    /// Come to rest and switch the bridges off.
    #[arg(long, conflicts_with = "reset")]
    pub stop: bool,
    /// Leave a fault whose cause is gone.
    #[arg(long)]
    pub reset: bool,
}

/// Shows the drive until the session is ended.
pub fn attach(probe: DebugProbeInfo, drive: Drive) -> Result<()> {
    let mut before = None;
    with_chip(
        probe,
        move |mut memory, say: &dyn Fn(View)| -> Result<()> {
            loop {
                say(drive.look(&mut memory)?);
                thread::sleep(LOOK);
            }
        },
        |view| {
            for line in news(before.as_ref(), &view) {
                println!("{line}");
            }
            println!("{view}");
            before = Some(view);
            Ok(())
        },
    )
}

/// What has changed since the last look, in sentences.
fn news(before: Option<&View>, now: &View) -> Vec<String> {
    let mut lines = Vec::new();
    let restarted = before.is_none_or(|before| now.words().uptime_ms < before.words().uptime_ms);
    if restarted && let Some(reason) = now.reset_reason() {
        lines.push(format!("Last reset: {}", ResetReason::sentence(reason)));
    }
    if let Some(fault) = now.fault()
        && before.is_none_or(|before| before.fault() != Some(fault))
    {
        lines.push(format!("Fault: {}", fault.sentence()));
    }
    lines
}

/// Tells the drive, and says what it made of that. A drive that runs is commanded until Ctrl-C, and then comes to rest.
pub fn command(probe: DebugProbeInfo, drive: Drive, options: &CommandOptions) -> Result<()> {
    let options = options.clone();
    let stop = ctrl_c().context("Ctrl-C cannot be caught, and is what ends a command")?;
    with_chip(
        probe,
        move |mut memory, say: &dyn Fn(View)| tell(&mut memory, drive, &options, &stop, say),
        |view| {
            println!("{view}");
            Ok(())
        },
    )
}

fn tell(
    memory: &mut impl Memory,
    drive: Drive,
    options: &CommandOptions,
    stop: &AtomicBool,
    say: &dyn Fn(View),
) -> Result<()> {
    if options.velocity.is_some() || options.base.is_some() {
        let velocity = options.velocity.unwrap_or(0.0) * 1e-3;
        let base = options.base.unwrap_or(0.0) * TAU / 60.0;
        start(memory, drive, velocity, base)?;
        let followed = follow(memory, drive, stop, say);
        // Also when the drive was stopped, so that it does not run again by itself.
        drive.run(memory, Run::Rest)?;
        return followed;
    }
    let run = if options.reset { Run::Reset } else { Run::Rest };
    drive.run(memory, run)?;
    thread::sleep(TAKE);
    say(drive.look(memory)?);
    Ok(())
}

/// Goes on commanding a drive that runs, and says what it does, until that is to end.
fn follow(
    memory: &mut impl Memory,
    drive: Drive,
    stop: &AtomicBool,
    say: &dyn Fn(View),
) -> Result<()> {
    while !stop.load(Relaxed) {
        drive.keep_alive(memory)?;
        let view = drive.look(memory)?;
        let state = view.state();
        say(view);
        if let Some(State::Fault(fault)) = state {
            bail!("the drive was stopped. {}", fault.sentence());
        }
        thread::sleep(LOOK);
    }
    Ok(())
}

/// Gives the drive a velocity, m/s, and a base speed, rad/s, and lets it run.
///
/// # Errors
/// It is in no state to run, or may not move that fast.
pub fn start(memory: &mut impl Memory, drive: Drive, velocity: f64, base: f64) -> Result<()> {
    let before = drive.look(memory)?;
    match before.state() {
        Some(State::Ready | State::Running | State::Holding | State::Stopping) => {}
        Some(State::Fault(fault)) => bail!(
            "the drive is stopped by a fault and will not run. {} Once that is gone, `cargo xtask command --reset` leaves it",
            fault.sentence()
        ),
        Some(state) => bail!(
            "the drive is {} and cannot run yet: try again in a moment",
            state.name()
        ),
        None => bail!("the drive is in a state that this layout does not know: flash it first"),
    }
    drive.ask(memory, velocity, base)?;
    thread::sleep(TAKE);
    let after = drive.look(memory)?;
    if after.words().taken == before.words().taken {
        let why = if after.words().refused == before.words().refused {
            "has not taken the command: does its speed task run?"
        } else {
            "refuses the command: the table or a motor may not move that fast by the drive's plate"
        };
        bail!("the drive {why}");
    }
    drive.run(memory, Run::Run)
}
