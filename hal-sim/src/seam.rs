//! What may stand between the board and the control code, and act on the machine: the place of a sensor's fault.

use crate::board::Board;
use control::current_loop::MotorSample;
use control::exchange::MotorExchange;
use control::fault::Fault;
use control::plate::DriveConfig;
use control::speed_task::{SpeedTask, SpeedTaskOutput};
use control::supervisor::Request;
use plant::Axis;
use plant::machine::Machine;

/// Called by [`Drive::period_through`](crate::drive::Drive::period_through) in the order of time. Each does nothing unless it
/// is commanded to.
pub trait Seam {
    /// Before each half (0, 1) of a period passes on the machine.
    fn machine(&mut self, _machine: &mut Machine, _half: u32) {}
    /// What the current amplifiers of `axis` show, A into the motor, before comparators and ADC see it.
    fn currents(&mut self, _axis: Axis, _amps: &mut [f64; 3]) {}
    /// What the board has read for `axis`, before its current loop sees it.
    fn sample(&mut self, _axis: Axis, _sample: &mut MotorSample) {}
    /// After a period of the current loop of `axis`.
    fn looped(&mut self, _axis: Axis, _exchange: &MotorExchange) {}
    /// What is asked of the speed task.
    fn request(&mut self, _request: &mut Request) {}
    /// A current, A, that is added to the reference of `axis` after the speed task has asked it: another controller's.
    fn current(&mut self, _axis: Axis, _seen: &SpeedSeen) -> Option<f64> {
        None
    }
    /// The speed task's step, where an application makes it. `None`: the drive makes it by its own request.
    fn speed(&mut self, _call: SpeedCall<'_>) -> Option<SpeedTaskOutput> {
        None
    }
    /// What the supervision and the analog watchdogs have found, as the speed task begins.
    fn found(&mut self) -> Option<Fault> {
        None
    }
}

/// What a step of the speed task works on.
#[derive(Debug)]
pub struct SpeedCall<'a> {
    /// The control's state.
    pub task: &'a mut SpeedTask,
    /// Its configuration.
    pub config: &'a DriveConfig,
    /// Screw, nut.
    pub motors: [&'a MotorExchange; 2],
    /// The board.
    pub board: &'a mut Board,
}

/// What a speed loop has seen in a step.
#[derive(Clone, Copy, Debug)]
pub struct SpeedSeen {
    /// The shaft's angle by its encoder, turns, 0 to 1.
    pub turn: f64,
    /// Its electrical speed, rad/s.
    pub omega_e: f64,
    /// Reference less that.
    pub error: f64,
    /// The reference that was asked, A.
    pub i_q: f64,
}

/// Nothing between them.
#[derive(Clone, Copy, Debug)]
pub struct Straight;

impl Seam for Straight {}

/// A disturbance of the machine alone.
pub struct Disturbed<F>(pub F);

impl<F: FnMut(&mut Machine, u32)> Seam for Disturbed<F> {
    fn machine(&mut self, machine: &mut Machine, half: u32) {
        (self.0)(machine, half);
    }
}
