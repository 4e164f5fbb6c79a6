//! The parts of a drive that its lines work on.

use crate::burst::Burst;
use crate::configured::Configured;
use crate::exchange::{DriveExchange, TelemetryExchange};
use crate::keep::Keeper;
use control::exchange::MotorExchange;
use link::view::DriveView;

/// Something that other tasks use too.
pub trait Access<T> {
    /// Alone with it.
    fn with<R>(&mut self, look: impl FnOnce(&mut T) -> R) -> R;
}

impl<T> Access<T> for &mut T {
    fn with<R>(&mut self, look: impl FnOnce(&mut T) -> R) -> R {
        look(self)
    }
}

/// What the lines work on beside their own state.
#[derive(Debug)]
pub struct LinesParts<'a, F, O, J, W> {
    /// What the drive runs on.
    pub configured: &'a Configured,
    /// The words between the parts.
    pub words: &'a DriveExchange,
    /// What the speed task tells.
    pub telemetry: &'a TelemetryExchange,
    /// What the current loops' periods are kept in.
    pub burst: &'a Burst,
    /// The debug view.
    pub view: &'a DriveView,
    /// Screw, nut.
    pub motors: [&'a MotorExchange; 2],
    /// The settings.
    pub keeper: &'a mut Keeper<F>,
    /// The motion.
    pub orders: &'a mut O,
    /// The journal.
    pub journal: &'a mut J,
    /// The board or the simulated machine.
    pub world: &'a mut W,
}
