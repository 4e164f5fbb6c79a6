//! All that the parts of a drive read of its configuration.

use control::guard::GuardConfig;
use control::plate::{DriveConfig, DrivePlate};
use control::travel::TravelConfig;
use link::telemetry::Header;

/// What the drive runs on. The control's comes first: the firmware keeps it beside the speed task's state.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Configured {
    /// The control's.
    pub drive: DriveConfig,
    /// The guard's.
    pub guard: GuardConfig,
    /// The head of each stream of telemetry.
    pub header: Header,
    /// The soft limits.
    pub travel: TravelConfig,
    /// The plate that they come from.
    pub plate: DrivePlate,
}
