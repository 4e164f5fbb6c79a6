//! A session with the chip through a debug probe.

mod image;
mod log;
mod view;

use crate::session::Session as Task;
use anyhow::{Context, Result, anyhow, bail};
use image::Image;
use probe_rs::probe::list::Lister;
use probe_rs::probe::{DebugProbeInfo, Probe};
use probe_rs::{Core, MemoryInterface, Permissions, Session, flashing};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;
use view::{Memory, View};

/// The chip, as probe-rs names it.
const CHIP: &str = "STM32G474RETx";
/// A probe or chip that has not answered by then does not.
const PATIENCE: Duration = Duration::from_secs(4);
/// How often a running drive is looked at.
const LOOK: Duration = Duration::from_millis(200);

/// Does `task` with the only probe that is there.
pub fn run(task: Task) -> Result<()> {
    // First, so that a missing probe is said at once and not after a build.
    let probe = only(&within_patience("look for probes", || {
        Ok(Lister::new().list_all())
    })?)?;
    let elf = crate::firmware::build()?;
    let image = Image::read(&elf)?;
    let mut session = within_patience("attach to the chip", move || attach(probe))?;
    match task {
        Task::Flash => flash(&mut session, &elf),
        Task::Run => {
            flash(&mut session, &elf)?;
            log::follow(&mut session.core(0)?, &image)
        }
        Task::Attach => {
            let mut core = session.core(0)?;
            loop {
                println!("{}", View::read(&mut Target(&mut core), image.view()?)?);
                thread::sleep(LOOK);
            }
        }
    }
}

/// The one probe of `probes`.
fn only(probes: &[DebugProbeInfo]) -> Result<DebugProbeInfo> {
    match probes {
        [] => bail!(
            "no debug probe found: connect the board's ST-LINK by USB; on Linux the udev rules of probe-rs must let \
             this user open it"
        ),
        [one] => Ok(one.clone()),
        more => {
            let names: Vec<String> = more.iter().map(ToString::to_string).collect();
            bail!(
                "{} debug probes found, and one is expected: unplug all but the board's ({})",
                more.len(),
                names.join("; ")
            )
        }
    }
}

fn attach(info: DebugProbeInfo) -> Result<Session> {
    let name = info.to_string();
    let probe: Probe = info.open().with_context(|| {
        format!("the probe {name} does not open: is another debugger using it?")
    })?;
    probe.attach(CHIP, Permissions::default()).map_err(|error| {
        anyhow!(
            "the probe {name} does not reach an {CHIP}: {error}. Is the board powered, is it this chip, and is its \
             read-out protection off?"
        )
    })
}

fn flash(session: &mut Session, elf: &std::path::Path) -> Result<()> {
    flashing::download_file(
        session,
        elf,
        flashing::ElfLoader(flashing::ElfOptions::default()),
    )
    .with_context(|| format!("{} could not be written to the chip", elf.display()))?;
    session
        .core(0)?
        .reset()
        .context("the chip was written but does not start")?;
    println!("written and started");
    Ok(())
}

/// Does `work` in a thread of its own, for a probe may never answer.
fn within_patience<T: Send + 'static>(
    what: &str,
    work: impl FnOnce() -> Result<T> + Send + 'static,
) -> Result<T> {
    let (sender, receiver) = mpsc::channel();
    thread::spawn(move || sender.send(work()));
    let seconds = PATIENCE.as_secs();
    receiver.recv_timeout(PATIENCE).map_err(|_| {
        anyhow!("could not {what} within {seconds} s: unplug the probe and plug it in again")
    })?
}

/// The chip's memory, read while it runs.
struct Target<'a, 'probe>(&'a mut Core<'probe>);

impl Memory for Target<'_, '_> {
    fn words(&mut self, address: u32, words: &mut [u32]) -> Result<()> {
        self.0
            .read_32(u64::from(address), words)
            .with_context(|| format!("the chip's memory at {address:#010x} cannot be read"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_probe_is_said_in_a_sentence() {
        let error = only(&[]).unwrap_err().to_string();
        assert!(error.starts_with("no debug probe found"), "{error}");
    }

    #[test]
    fn a_probe_that_never_answers_is_given_up() {
        let error = within_patience("wait", || {
            thread::sleep(PATIENCE * 2);
            Ok(())
        });
        assert!(error.unwrap_err().to_string().contains("within 4 s"));
    }
}
