//! A host's lines to the emulated drive: the wires of its serial port, and RTT in its memory. Time passes while a host waits.

use crate::bench::Bench;
use crate::chip::CORE_HZ;
use anyhow::{Error, Result, anyhow};
use link::host::client::Line;
use link::host::rtt::Channel;
use link::{LINK_DOWN_CHANNEL, LINK_UP_CHANNEL};
use std::cell::RefCell;
use std::io;
use std::rc::Rc;
use std::time::{Duration, Instant};

/// Between two looks of a host, s.
const LOOK_S: f64 = 100e-6;

fn failed(error: Error) -> io::Error {
    io::Error::other(format!("{error:#}"))
}

/// The chip's clock, from when a line began.
fn chip_time(began: Instant, bench: &RefCell<Bench>) -> Instant {
    let cycles = bench.borrow().emulator.time();
    began + Duration::from_secs_f64(cycles as f64 / CORE_HZ as f64)
}

/// Waits for bytes, at most for `patience` of the chip's time.
fn wait(
    bench: &RefCell<Bench>,
    waiting: &mut Vec<u8>,
    bytes: &mut [u8],
    patience: Duration,
    mut look: impl FnMut(&mut Bench) -> Result<Vec<u8>>,
) -> io::Result<usize> {
    let mut bench = bench.borrow_mut();
    let mut passed = 0.0;
    loop {
        waiting.extend(look(&mut bench).map_err(failed)?);
        if !waiting.is_empty() || passed >= patience.as_secs_f64() {
            break;
        }
        bench.pass(LOOK_S).map_err(io::Error::other)?;
        passed += LOOK_S;
    }
    let count = waiting.len().min(bytes.len());
    bytes[..count].copy_from_slice(&waiting[..count]);
    waiting.drain(..count);
    Ok(count)
}

/// The wires of the serial port.
pub struct Wires {
    bench: Rc<RefCell<Bench>>,
    waiting: Vec<u8>,
    began: Instant,
}

impl Wires {
    /// Those of `bench`.
    #[must_use]
    pub fn new(bench: &Rc<RefCell<Bench>>) -> Self {
        Self {
            bench: Rc::clone(bench),
            waiting: Vec::new(),
            began: Instant::now(),
        }
    }
}

impl Line for Wires {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.bench.borrow_mut().emulator.chip().host_sends(bytes);
        Ok(())
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        wait(&self.bench, &mut self.waiting, bytes, patience, |bench| {
            Ok(bench.emulator.chip().host_takes())
        })
    }

    fn now(&self) -> Instant {
        chip_time(self.began, &self.bench)
    }
}

/// RTT's channels in the chip's memory, as a debug probe reaches them.
pub struct RttLine {
    bench: Rc<RefCell<Bench>>,
    up: Channel,
    down: Channel,
    waiting: Vec<u8>,
    began: Instant,
}

impl RttLine {
    /// Those of `bench`, whose firmware has started.
    ///
    /// # Errors
    /// The firmware has not set them up.
    pub fn new(bench: &Rc<RefCell<Bench>>) -> Result<Self> {
        let mut inside = bench.borrow_mut();
        let block = inside.drive.rtt;
        let missing = || anyhow!("RTT is not set up");
        let memory = &mut inside.emulator;
        let up = Channel::find(memory, block, LINK_UP_CHANNEL)?.ok_or_else(missing)?;
        let down = Channel::find_down(memory, block, LINK_DOWN_CHANNEL)?.ok_or_else(missing)?;
        drop(inside);
        Ok(Self {
            bench: Rc::clone(bench),
            up,
            down,
            waiting: Vec::new(),
            began: Instant::now(),
        })
    }
}

impl Line for RttLine {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut bench = self.bench.borrow_mut();
        let mut rest = bytes;
        while !rest.is_empty() {
            let count = self.down.fill(&mut bench.emulator, rest).map_err(failed)?;
            rest = &rest[count..];
            if !rest.is_empty() {
                bench.pass(LOOK_S).map_err(io::Error::other)?;
            }
        }
        Ok(())
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        let up = self.up;
        wait(&self.bench, &mut self.waiting, bytes, patience, |bench| {
            let mut came = Vec::new();
            up.drain(&mut bench.emulator, &mut came)?;
            Ok(came)
        })
    }

    fn now(&self) -> Instant {
        chip_time(self.began, &self.bench)
    }
}
