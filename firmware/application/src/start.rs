//! What a start leaves in the journal.

use crate::keep::Found;
use control::journal::{Journal, Kind, Warning};
use control::plate::BrakePlate;
use link::codes::ResetReason;

/// The drive has started. Gives the warning that a person should read.
pub fn log_start(
    journal: &mut Journal,
    reason: ResetReason,
    found: Found,
    brake: &BrakePlate,
) -> Option<Warning> {
    journal.add(0, Kind::Start, reason.word(), [0; 2]);
    let values = [found.unfit.into(), 0];
    journal.add(0, Kind::Settings, found.origin.word(), values);
    let warning = Warning::of(brake);
    if let Some(warning) = warning {
        journal.add(0, Kind::Warning, warning.word(), [0; 2]);
    }
    warning
}
