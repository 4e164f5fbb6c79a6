//! `attach`: the debug view of a running drive.

use super::LOOK;
use super::memory::with_chip;
use anyhow::Result;
use link::codes::ResetReason;
use link::host::{Drive, View};
use probe_rs::probe::DebugProbeInfo;
use std::thread;

/// Shows the drive until the session is ended.
///
/// # Errors
/// The probe or the chip is lost.
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
