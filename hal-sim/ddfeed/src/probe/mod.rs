//! A session with the chip through a debug probe.

pub mod attach;
mod chip;
mod choose;
mod image;
pub mod line;
pub mod memory;
pub mod patience;

pub use chip::unreachable;
pub use image::Image;

use crate::session::Which;
use anyhow::Result;
use choose::choose;
use patience::watch;
use probe_rs::probe::DebugProbeInfo;
use probe_rs::probe::list::Lister;
use std::time::Duration;

/// How often a running drive is looked at.
const LOOK: Duration = Duration::from_millis(200);

/// The probe that was asked for, or the only one.
///
/// # Errors
/// There is no such probe, or more than one.
pub fn find(which: &Which) -> Result<DebugProbeInfo> {
    let probes = watch("look for probes", patience::LIST, |_: &dyn Fn(())| {
        Ok(Lister::new().list_all())
    })?;
    choose(&probes, which.probe.as_deref()).cloned()
}
