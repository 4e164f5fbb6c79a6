//! `attach`: the debug view of a running drive.

use super::LOOK;
use super::memory::with_chip;
use anyhow::Result;
use link::codes::ResetReason;
use link::host::{Drive, View};
use probe_rs::probe::DebugProbeInfo;
use std::thread;

/// Looks at which the clock shows the same before that is said.
const STANDS: u32 = 5;
/// What it means.
const STANDING: &str = "its core is halted, or no firmware runs and this is what the last one left in RAM. End what halts the core, \
                        or flash the firmware with `cargo xtask flash`.";

fn uptime_ms(view: &View) -> u32 {
    view.words().uptime_ms
}

/// Shows the drive until the session is ended.
///
/// # Errors
/// The probe or the chip is lost.
pub fn attach(probe: DebugProbeInfo, drive: Drive) -> Result<()> {
    let mut before = None;
    let mut stands = 0;
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
            stands = match before.as_ref().map(uptime_ms) == Some(uptime_ms(&view)) {
                true => stands + 1,
                false => 0,
            };
            if stands == STANDS {
                println!("The drive's clock stands: {STANDING}");
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
    let restarted = before.is_none_or(|before| uptime_ms(now) < uptime_ms(before));
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
