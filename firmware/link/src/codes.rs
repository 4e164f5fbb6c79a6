//! Codes in the debug view, each with its name and a sentence for a person.

pub use control::active_limit::{ActiveLimits, Limit};
pub use control::alignment::Reason as Misalignment;
use control::codes;
pub use control::compensation::fit::{TableFit, TableFits};
pub use control::fault::{Fault, FaultSet, Reaction};
pub use control::journal::{Kind as EventKind, Warning};
pub use control::supervisor::State;

codes! {
    /// Why the chip was last reset.
    ResetReason {
        Power = 1, "power", "Power came up, or fell below the brown-out level.";
        Pin = 2, "reset pin", "The reset pin, by a button or a probe.";
        Software = 3, "software", "The firmware asked for it: after a panic, or a probe through the core.";
        IndependentWatchdog = 4, "watchdog", "The independent watchdog: a task hung.";
        WindowWatchdog = 5, "window watchdog", "The window watchdog, which this firmware does not use.";
        Other = 6, "other", "Something else.";
    }
}

codes! {
    /// What is asked of the drive, in the command's word `run`.
    Run {
        Rest = 0, "rest", "Come to rest and switch the bridges off.";
        Run = 1, "run", "Follow the commanded speeds.";
        Reset = 2, "reset", "Come to rest, and leave a fault whose cause is gone.";
    }
}
