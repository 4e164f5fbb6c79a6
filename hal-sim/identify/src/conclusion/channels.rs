//! The residual in a channel, and in the table's force balance.

use crate::conclusion::verdict::Level;
use crate::signal::channel::Channel;

/// Rms of the residual, in its unit.
#[derive(Debug, Clone, Copy)]
pub struct Figures {
    /// Fit record, declared parameters recalibrated.
    pub fit_before: f64,
    /// Fit record with the effects.
    pub fit_after: f64,
    /// Check record, parameters of the fit record.
    pub check_before: f64,
    /// Check record with the effects.
    pub check_after: f64,
    /// What sensors alone leave.
    pub noise_floor: f64,
    /// Whitened rms with the effects on the fit record; 1 is noise.
    pub whitened: f64,
    /// Share of the residual's lags of up to 0.1 s whose correlation is within the 95 % band of white noise.
    pub whiteness: f64,
}

/// One channel.
#[derive(Debug, Clone)]
pub struct ChannelRest {
    /// Which.
    pub channel: Channel,
    /// In figures.
    pub figures: Figures,
    /// The fit record's residual before and after, at the decimated rate.
    pub residual: [Vec<f64>; 2],
    /// Its rows that count.
    pub open: Vec<bool>,
    /// How loud the check record's residual is, before and after.
    pub levels: [Level; 2],
    /// Frequencies by which it is judged, Hz.
    pub band_hz: [f64; 2],
}

/// The force balance of the table, N: the force that the two torque balances give (half their difference through the
/// lead) less what inertia, friction and load of the table need. It holds nothing that the torques do not.
#[derive(Debug, Clone)]
pub struct TableForce {
    /// In figures.
    pub figures: Figures,
    /// The fit record's residual before and after, at the decimated rate.
    pub residual: [Vec<f64>; 2],
    /// Its rows that count.
    pub open: Vec<bool>,
}
