//! `cargo xtask flash | run`: the firmware written to the chip, and its log.

use anyhow::{Context, Result};
use ddfeed::probe::{Image, memory, patience, unreachable};
use link::LOG_CHANNEL;
use link::host::log::{Line, Log, table};
use link::host::rtt::Channel;
use probe_rs::flashing::{DownloadOptions, ElfLoader, ElfOptions, FlashProgress};
use probe_rs::probe::DebugProbeInfo;
use probe_rs::{Permissions, Session};
use std::io::Cursor;
use std::thread;
use std::time::{Duration, Instant};

/// The chip, as probe-rs names it.
const CHIP: &str = "STM32G474RETx";
/// Where its flash begins (RM0440 2.2.2).
const BEGIN: u64 = 0x0800_0000;
/// How often the log is looked at.
const LISTEN: Duration = Duration::from_millis(20);
/// How long the firmware has to start.
const START: Duration = Duration::from_secs(2);

/// Writes the firmware and starts it.
///
/// # Errors
/// The probe or the chip cannot be reached, it is another chip or a locked one, or it does not take the firmware.
pub fn flash(probe: DebugProbeInfo, image: &Image) -> Result<()> {
    // First without a session, whose attaching says nothing of a locked chip or another one.
    memory::with_chip(probe.clone(), |_, _: &dyn Fn(())| Ok(()), |()| Ok(()))?;
    let elf = image.bytes().to_vec();
    let mut begun = false;
    patience::watch_each(
        "write to the chip",
        move |say| {
            let mut session = memory::open(&probe)?
                .attach(CHIP, Permissions::default())
                .map_err(|error| unreachable(&probe, &error))?;
            say(());
            write(&mut session, elf, say)?;
            session
                .core(0)
                .and_then(|mut core| core.reset())
                .context("the chip was written but does not start: power the board off and on")
        },
        |()| {
            begun = true;
            Ok(())
        },
    )
    .map_err(|error| match begun {
        true => error.context(
            "the firmware could not be written to the chip. What is there now is incomplete, and does not start: flash it again. If that fails \
             too, look for write protection (option bytes, by STM32CubeProgrammer) and at the board's supply",
        ),
        false => error,
    })?;
    println!("written and started");
    Ok(())
}

/// Writes all but the flash's first page, and then that one. The vector table is in it, and the first erasure takes it: without it
/// the chip does not start, so that what was written in part never runs.
fn write(session: &mut Session, elf: Vec<u8>, say: &dyn Fn(())) -> Result<()> {
    let mut whole = session.target().flash_loader();
    let format = ElfLoader(ElfOptions::default());
    whole.load_image(session, &mut Cursor::new(elf), format, None)?;
    let algorithm = session.target().flash_algorithms.first();
    let page = algorithm.context("the chip has no algorithm for its flash")?;
    let page_end = BEGIN + u64::from(page.flash_properties.page_size);
    let [mut first, mut rest] = [(); 2].map(|()| session.target().flash_loader());
    for (address, bytes) in whole.data() {
        let within = usize::try_from(page_end.saturating_sub(address))?.min(bytes.len());
        let (head, tail) = bytes.split_at(within);
        if !head.is_empty() {
            first.add_data(address, head)?;
        }
        if !tail.is_empty() {
            rest.add_data(address + within as u64, tail)?;
        }
    }
    for (part, is_erased) in [(rest, false), (first, true)] {
        let mut options = DownloadOptions::default();
        options.progress = FlashProgress::new(|_| say(()));
        options.verify = true;
        options.skip_erase = is_erased;
        part.commit(session, options)?;
    }
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
                        anyhow::bail!(
                            "the firmware's log does not start within {:.0} s, so the firmware does not run: power the board off and \
                             on, and ask the board with `cargo xtask bringup`",
                            START.as_secs_f64()
                        )
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
