//! What the simulations of the later papers' results found, as `report.json` holds it.

use super::creep::CreepReport;
use super::switching::SwitchingReport;
use super::torsion::TorsionReport;
use super::tracking::TrackingReport;
use super::warmth::WarmthReport;
use serde::Serialize;

/// All of them.
#[derive(Debug, Serialize)]
pub struct LiteratureReport {
    /// Seed of all noise.
    pub seed: u64,
    /// The lowest stable velocity.
    pub creep: CreepReport,
    /// A sine at creep speed.
    pub tracking: TrackingReport,
    /// Losses against the common speed.
    pub warmth: WarmthReport,
    /// A load that switches on the nut.
    pub switching: SwitchingReport,
    /// Torsion of the screw.
    pub torsion: TorsionReport,
}
