//! The independent watchdog, fed only when every task has made progress, and the reason for the last reset.

use link::codes::ResetReason;
use stm32g4xx_hal::independent_watchdog::IndependentWatchdog;
use stm32g4xx_hal::rcc::Rcc;
use stm32g4xx_hal::stm32::IWDG;
use stm32g4xx_hal::time::ExtU32;

/// Longest time without progress of all tasks before the chip is reset, ms.
pub(crate) const TIMEOUT_MS: u32 = 20;

/// Feeds the watchdog for as long as each of `TASKS` counters moves.
pub(crate) struct Watchdog<const TASKS: usize> {
    watchdog: IndependentWatchdog,
    seen: [u32; TASKS],
}

impl<const TASKS: usize> Watchdog<TASKS> {
    /// Starts it; nothing but a reset stops it.
    pub(crate) fn start(iwdg: IWDG) -> Self {
        let mut watchdog = IndependentWatchdog::new(iwdg);
        watchdog.start(TIMEOUT_MS.millis());
        Self {
            watchdog,
            seen: [0; TASKS],
        }
    }

    /// Feeds the watchdog if each of the tasks' counters differs from the last call's, and says which did not.
    pub(crate) fn feed(&mut self, progress: [u32; TASKS]) -> Result<(), usize> {
        let stuck = progress
            .iter()
            .zip(&self.seen)
            .position(|(now, before)| now == before);
        self.seen = progress;
        match stuck {
            Some(task) => Err(task),
            None => {
                self.watchdog.feed();
                Ok(())
            }
        }
    }
}

/// Reads the reason and clears it for the next reset.
pub(crate) fn reset_reason(rcc: &mut Rcc) -> ResetReason {
    let reason = rcc.get_reset_reason();
    rcc.clear_reset_reason();
    // The pin's flag is set with every other reason, for the chip pulls its own pin.
    if reason.independent_watchdog {
        ResetReason::IndependentWatchdog
    } else if reason.window_watchdog {
        ResetReason::WindowWatchdog
    } else if reason.software {
        ResetReason::Software
    } else if reason.brown_out {
        ResetReason::Power
    } else if reason.reset_pin {
        ResetReason::Pin
    } else {
        ResetReason::Other
    }
}
