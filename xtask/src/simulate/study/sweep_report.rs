//! What a sweep found, as `sweep.json` holds it.

use serde::Serialize;

/// Ripple over a grid of table and nut speeds.
#[derive(Debug, Serialize)]
pub struct SweepReport {
    /// `paper` (lumped), `coupled`, or the model file's path.
    pub machine: String,
    /// `ideal`, `real` or `declared`.
    pub sensors: String,
    /// Rows of the grid: table velocities, mm/s.
    pub table_mm_s: Vec<f64>,
    /// Columns of the grid: nut speeds, rpm; the first is 0, CDFS.
    pub nut_rpm: Vec<f64>,
    /// Velocity ripple factor, %: a row for each table velocity, a value for each nut speed; none where the drive did
    /// not reach the point.
    pub vrf_percent: Vec<Vec<Option<f64>>>,
}
