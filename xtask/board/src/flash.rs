//! `cargo xtask flash | run`: the firmware written to the chip, and its log.

use anyhow::{Context, Result};
use ddfeed::probe::{Image, memory, patience, unreachable};
use link::LOG_CHANNEL;
use link::host::log::{Line, Log, table};
use link::host::rtt::Channel;
use probe_rs::Permissions;
use probe_rs::flashing::{self, DownloadOptions, ElfLoader, ElfOptions, FlashProgress};
use probe_rs::probe::DebugProbeInfo;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

/// The chip, as probe-rs names it.
const CHIP: &str = "STM32G474RETx";
/// How often the log is looked at.
const LISTEN: Duration = Duration::from_millis(20);
/// How long the firmware has to start.
const START: Duration = Duration::from_secs(2);

/// Writes the firmware and starts it.
///
/// # Errors
/// The probe or the chip cannot be reached, it is another chip or a locked one, or it does not take the firmware.
pub fn flash(probe: DebugProbeInfo, elf: &Path) -> Result<()> {
    // First without a session, whose attaching says nothing of a locked chip or another one.
    memory::with_chip(probe.clone(), |_, _: &dyn Fn(())| Ok(()), |()| Ok(()))?;
    let elf = elf.to_owned();
    patience::watch_each(
        "write to the chip",
        move |say| {
            let mut session = memory::open(&probe)?
                .attach(CHIP, Permissions::default())
                .map_err(|error| unreachable(&probe, &error))?;
            say(());
            let mut options = DownloadOptions::default();
            options.progress = FlashProgress::new(|_| say(()));
            options.verify = true;
            flashing::download_file_with_options(
                &mut session,
                &elf,
                ElfLoader(ElfOptions::default()),
                options,
            )
            .with_context(|| format!("{} could not be written to the chip", elf.display()))?;
            session
                .core(0)
                .and_then(|mut core| core.reset())
                .context("the chip was written but does not start")
        },
        |()| Ok(()),
    )?;
    println!("written and started");
    Ok(())
}

/// Prints the log for as long as the session lasts.
///
/// # Errors
/// As [`listen`].
pub fn follow(probe: DebugProbeInfo, image: &Image) -> Result<()> {
    listen(probe, image, |line| {
        println!("{:5} {}", line.level, line.message);
        Ok(())
    })
}

/// Gives `each` line of the log for as long as the session lasts.
///
/// # Errors
/// The probe or the chip is lost, the firmware has no log, or what `each` returns.
pub fn listen(
    probe: DebugProbeInfo,
    image: &Image,
    mut each: impl FnMut(Line) -> Result<()>,
) -> Result<()> {
    let table = table(image.bytes())?;
    let mut log = Log::new(&table);
    let drive = image.drive()?;
    memory::with_chip(
        probe,
        move |mut memory, say: &dyn Fn(Vec<u8>)| {
            let start = Instant::now();
            let channel = loop {
                match Channel::find(&mut memory, drive.rtt, LOG_CHANNEL)? {
                    Some(channel) => break channel,
                    None if start.elapsed() > START => {
                        anyhow::bail!("the firmware's log does not start: does the firmware run?")
                    }
                    None => thread::sleep(LISTEN),
                }
            };
            loop {
                let mut bytes = Vec::new();
                channel.drain(&mut memory, &mut bytes)?;
                say(bytes);
                thread::sleep(LISTEN);
            }
        },
        |bytes| log.take(&bytes).into_iter().try_for_each(&mut each),
    )
}
