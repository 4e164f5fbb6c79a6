//! A bench whose probe is served: its time passes between what a debugger asks.

use super::server::Server;
use crate::bench::Bench;
use crate::emulator::HaltedTime;
use std::time::{Duration, Instant};

/// Time of the chip between two looks at the debugger, s.
const SLICE_S: f64 = 20e-6;
/// How long a halted chip is left alone where no debugger asks.
const REST: Duration = Duration::from_millis(1);
/// Time of a halted chip that passes at once, s.
const MOST_AT_ONCE_S: f64 = 10e-3;

/// Bench and probe.
pub struct Served {
    /// The chip and its machine.
    pub bench: Bench,
    /// Where a debugger finds them.
    pub server: Server,
    looked: Instant,
}

impl Served {
    /// A bench behind `server`.
    #[must_use]
    pub fn new(bench: Bench, server: Server) -> Self {
        Self {
            bench,
            server,
            looked: Instant::now(),
        }
    }

    /// Answers the debugger, or lets some time pass. A halted core's board keeps to the host's clock; one that runs is slower.
    ///
    /// # Errors
    /// What the firmware did that the chip does not have, or the address is lost.
    pub fn turn(&mut self) -> Result<(), String> {
        let passed = self.looked.elapsed();
        self.looked = Instant::now();
        let came = self
            .server
            .serve(&mut self.bench.emulator)
            .map_err(|error| format!("the probe's address is lost: {error}"))?;
        if !self.bench.emulator.chip().debug.halted() {
            return if came {
                Ok(())
            } else {
                self.bench.pass(SLICE_S)
            };
        }
        match self.bench.emulator.halted_time {
            HaltedTime::Running => self.bench.pass(passed.as_secs_f64().min(MOST_AT_ONCE_S))?,
            HaltedTime::Frozen => {}
        }
        if !came {
            self.server.rest(REST);
        }
        Ok(())
    }
}
