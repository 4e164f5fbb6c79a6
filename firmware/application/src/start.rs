//! What a start leaves in the journal.

use crate::keep::Found;
use control::journal::{Journal, Kind, Warning};
use control::plate::DrivePlate;
use link::codes::ResetReason;

/// The drive has started on that plate. Gives the warnings that a person should read.
pub fn log_start(
    journal: &mut Journal,
    reason: ResetReason,
    found: Found,
    plate: &DrivePlate,
) -> impl Iterator<Item = Warning> + use<> {
    journal.add(0, Kind::Start, reason.word(), [0; 2]);
    let values = [found.unfit.into(), 0];
    journal.add(0, Kind::Settings, found.origin.word(), values);
    let warnings = Warning::of(plate.motors.each_ref(), &plate.bridge, &plate.brake);
    for warning in warnings.clone() {
        journal.add(0, Kind::Warning, warning.word(), [0; 2]);
    }
    warnings
}
