//! A model of an axis as it grows, and what closed-loop simulation with it leaves.

use super::axis::Axis;

/// Errors of a closed-loop simulation.
#[derive(Debug, Clone, Copy)]
pub struct Errors {
    /// Force after the 100 Hz filter: rms of the error over rms of the force, %.
    pub force_percent: f64,
    /// The same, N.
    pub force_n: f64,
    /// Velocity, rms of the error over rms, %.
    pub velocity_percent: f64,
    /// Position, rms of the error, um.
    pub position_um: f64,
}

/// The model after one more effect.
pub struct Stage {
    /// What was added last.
    pub added: String,
    /// The model.
    pub axis: Axis,
    /// The same with the homing of the test record.
    pub on_test: Axis,
    /// On the record that it was fitted to.
    pub estimate: Errors,
    /// On the test record, nothing fitted there.
    pub test: Errors,
    /// On the test record from its first quarter on, with the homing from that quarter.
    pub homed: Errors,
}
