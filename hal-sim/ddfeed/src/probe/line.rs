//! The link through a debug probe: RTT's channels in the chip's memory, which nothing halts.

use super::{find, memory};
use crate::session::Which;
use anyhow::{Context, Result, anyhow};
use link::host::Memory;
use link::host::client::Line;
use link::host::refused::Lost;
use link::host::rtt::{Channel, locate};
use link::{LINK_DOWN_CHANNEL, LINK_UP_CHANNEL};
use std::io;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::thread;
use std::time::Duration;

/// RAM of the chip, where RTT's control block is: start and bytes (RM0440 2.2.2).
const RAM: (u32, u32) = (0x2000_0000, 96 * 1024);
/// Between two looks at the channels.
const LOOK: Duration = Duration::from_millis(1);

/// A line to the drive at the probe.
pub struct ProbeLine {
    to: Sender<Vec<u8>>,
    from: Receiver<Result<Vec<u8>>>,
    waiting: Vec<u8>,
}

/// Opens the line of the drive at the probe that was asked for.
///
/// # Errors
/// There is no such probe or chip, or its firmware has no link.
pub fn open(which: &Which) -> Result<ProbeLine> {
    let probe = find(which)?;
    let (to, outgoing) = channel::<Vec<u8>>();
    let (incoming, from) = channel();
    let said = incoming.clone();
    thread::spawn(move || {
        let done = memory::with_chip(
            probe,
            move |mut memory, say: &dyn Fn(Vec<u8>)| carry(&mut memory, &outgoing, say),
            |bytes| {
                said.send(Ok(bytes))
                    .map_err(|_| anyhow!("the session has ended"))
            },
        );
        if let Err(error) = done {
            // A session that has ended does not hear it.
            let _ = incoming.send(Err(error));
        }
    });
    let mut line = ProbeLine {
        to,
        from,
        waiting: Vec::new(),
    };
    // The first look says that the channels are there, or why not.
    line.waiting = line.from.recv().context("the probe's driver gave up")??;
    Ok(line)
}

/// Carries bytes both ways until the session ends.
fn carry(
    memory: &mut impl Memory,
    outgoing: &Receiver<Vec<u8>>,
    say: &dyn Fn(Vec<u8>),
) -> Result<()> {
    let absent = || {
        Lost(
            "no drive with a link is running on the chip: flash it with `cargo xtask flash`"
                .to_owned(),
        )
    };
    let block = locate(memory, RAM.0, RAM.1)?.ok_or_else(absent)?;
    let up = Channel::find(memory, block, LINK_UP_CHANNEL)?.ok_or_else(absent)?;
    let down = Channel::find_down(memory, block, LINK_DOWN_CHANNEL)?.ok_or_else(absent)?;
    let mut waits: Vec<u8> = Vec::new();
    loop {
        loop {
            match outgoing.try_recv() {
                Ok(bytes) => waits.extend(bytes),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return Ok(()),
            }
        }
        if !waits.is_empty() {
            let count = down.fill(memory, &waits)?;
            waits.drain(..count);
        }
        let mut came = Vec::new();
        up.drain(memory, &mut came)?;
        // Also nothing, so that the probe is known to answer.
        say(came);
        thread::sleep(LOOK);
    }
}

fn gone(error: &anyhow::Error) -> io::Error {
    io::Error::other(format!("{error:#}"))
}

impl Line for ProbeLine {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.to
            .send(bytes.to_vec())
            .map_err(|_| io::Error::other("the probe's session has ended"))
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        while self.waiting.is_empty() {
            match self.from.recv_timeout(patience) {
                Ok(came) => self.waiting = came.map_err(|error| gone(&error))?,
                Err(RecvTimeoutError::Timeout) => return Ok(0),
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(io::Error::other("the probe's session has ended"));
                }
            }
            if self.waiting.is_empty() {
                return Ok(0);
            }
        }
        let count = self.waiting.len().min(bytes.len());
        bytes[..count].copy_from_slice(&self.waiting[..count]);
        self.waiting.drain(..count);
        Ok(count)
    }
}
