//! Codes in the debug view, each with its name and a sentence for a person.

pub use control::active_limit::{ActiveLimits, Limit};
pub use control::alignment::Reason as Misalignment;
use control::codes;
pub use control::compensation::fit::{TableFit, TableFits};
pub use control::fault::{Fault, FaultSet, Reaction};
pub use control::journal::{Kind as EventKind, Warning};
pub use control::supervisor::{Demand, State};

codes! {
    /// Why the chip was last reset.
    ResetReason {
        Power = 1, "power", "Power came up, or fell below the brown-out level.";
        Pin = 2, "reset pin", "The reset pin, by a button or a probe.";
        Software = 3, "software", "The firmware asked for it: to start with other settings, after a panic, or a probe through the core.";
        IndependentWatchdog = 4, "watchdog", "The independent watchdog: a task hung.";
        WindowWatchdog = 5, "window watchdog", "The window watchdog, which this firmware does not use.";
        Other = 6, "other", "Something else.";
    }
}

codes! {
    /// Which settings the drive runs on.
    Origin {
        Own = 1, "its own", "The drive runs on its board's own settings: none are stored.";
        Stored = 2, "stored", "The drive runs on the settings that are stored in its flash.";
        Unfit = 3, "its own, as those that are stored do not fit", "The drive runs on its board's own settings: those that are stored do not fit it. Set them anew.";
        Changed = 4, "changed, not stored", "The drive runs on settings that were changed since it started. `drive settings store` keeps them over a restart.";
    }
}
