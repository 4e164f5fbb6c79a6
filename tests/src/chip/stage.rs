//! A power stage's gate driver between its ENABLE and its nFAULT, as a DRV8323 is: it sleeps, it wakes, and a gate-drive fault latches
//! (SLVSDJ3D 8.3.6 and 8.4.1, quoted by the sources of the wiring page).

use super::CORE_HZ;

/// Cycles from ENABLE's rise until the driver works: 1 ms.
const WAKE: u64 = CORE_HZ / 1000;
/// ENABLE is low for so long to clear a gate-drive fault: 8 to 40 us, the longest taken.
const CLEARS: u64 = CORE_HZ * 40 / 1_000_000;

/// A stage.
#[derive(Clone, Copy, Debug)]
pub struct Stage {
    /// Its bus is on.
    pub supplied: bool,
    /// A contact in its ENABLE wire is open: the emergency stop, or a torn wire.
    pub enable_cut: bool,
    gate_fault: bool,
    /// ENABLE at the driver, and since when.
    enabled: bool,
    since: u64,
}

impl Stage {
    /// Its bus is on, and it sleeps.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            supplied: true,
            enable_cut: false,
            gate_fault: false,
            enabled: false,
            since: 0,
        }
    }

    /// The chip drives its end of the ENABLE wire to this level.
    pub fn drive_enable(&mut self, high: bool, now: u64) {
        let enabled = high && !self.enable_cut && self.supplied;
        if enabled == self.enabled {
            return;
        }
        if enabled && now.saturating_sub(self.since) >= CLEARS {
            self.gate_fault = false;
        }
        (self.enabled, self.since) = (enabled, now);
    }

    /// The driver finds a gate that does not follow: it stays a fault.
    pub fn latch_gate_fault(&mut self) {
        self.gate_fault = true;
    }

    /// It works: its amplifiers too.
    #[must_use]
    pub fn is_awake(&self, now: u64) -> bool {
        self.enabled && now - self.since >= WAKE
    }

    /// It pulls nFAULT, which it does until it is awake.
    #[must_use]
    pub fn pulls_fault(&self, now: u64) -> bool {
        self.gate_fault || !self.is_awake(now)
    }
}

impl Default for Stage {
    fn default() -> Self {
        Self::new()
    }
}
