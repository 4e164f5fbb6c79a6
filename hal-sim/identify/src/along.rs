//! What a residual of a double drive may be a shape over.

use crate::balance::rounded_sign;
use crate::hypothesis::{LEAST_ORDER, LEAST_RELATIVE_ORDER};
use crate::leftover::Form;
use crate::machines::Machine;
use crate::signals::Signals;
use plant::Axis;
use std::f64::consts::TAU;

/// A coordinate of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Along {
    /// Angle of a motor.
    Angle(Axis),
    /// Angle of screw against nut.
    RelativeAngle,
    /// Time, in which a frequency repeats.
    Clock,
    /// Speed of a motor.
    Speed(Axis),
    /// Speed of screw against nut.
    RelativeSpeed,
    /// Position of the table.
    TablePosition,
    /// Position of the table, of what brakes it either way.
    TightPlace,
    /// Time, over which something drifts.
    Time,
}

impl Along {
    /// All of them.
    pub const ALL: [Along; 10] = [
        Along::Angle(Axis::Screw),
        Along::Angle(Axis::Nut),
        Along::RelativeAngle,
        Along::Clock,
        Along::Speed(Axis::Screw),
        Along::Speed(Axis::Nut),
        Along::RelativeSpeed,
        Along::TablePosition,
        Along::TightPlace,
        Along::Time,
    ];

    /// Whether a kind of machine has it.
    pub(crate) fn is_on(self, machine: &dyn Machine) -> bool {
        match self {
            Along::Angle(axis) | Along::Speed(axis) => machine.axes().contains(&axis),
            Along::Clock | Along::Time => true,
            _ => machine.has_feed(),
        }
    }

    /// For a reader.
    pub fn name(self) -> &'static str {
        match self {
            Along::Angle(Axis::Screw) => "angle of the screw",
            Along::Angle(Axis::Nut) => "angle of the nut",
            Along::RelativeAngle => "angle of screw against nut",
            Along::Clock | Along::Time => "time",
            Along::Speed(Axis::Screw) => "speed of the screw",
            Along::Speed(Axis::Nut) => "speed of the nut",
            Along::RelativeSpeed => "speed of screw against nut",
            Along::TablePosition => "position of the table",
            Along::TightPlace => "position of the table, against its motion",
        }
    }

    /// What kind of shape there may be, in rows of which `nyquist` is half the rate, Hz.
    pub fn form(self, nyquist: f64) -> Form {
        match self {
            Along::Angle(_) => Form::Repeats(LEAST_ORDER..126.0),
            Along::RelativeAngle => Form::Repeats(LEAST_RELATIVE_ORDER..60.0),
            Along::Clock => Form::Repeats(0.5..0.9 * nyquist),
            _ => Form::Curve,
        }
    }

    /// Whether a shape there repeats; an order is then one per turn, of the clock one per second.
    pub fn repeats(self) -> bool {
        matches!(self, Along::Angle(_) | Along::RelativeAngle | Along::Clock)
    }

    /// Its value at a row: an angle in rad, of the clock one turn a second.
    pub fn value(self, signals: &Signals, row: usize) -> f64 {
        match self {
            Along::Angle(axis) => signals.motors[axis.index()].theta[row],
            Along::RelativeAngle => signals.motors[0].theta[row] - signals.motors[1].theta[row],
            Along::Clock => TAU * signals.time[row],
            Along::Speed(axis) => signals.motors[axis.index()].omega[row],
            Along::RelativeSpeed => signals.relative_speed[row],
            Along::TablePosition | Along::TightPlace => signals.table[row],
            Along::Time => signals.time[row],
        }
    }

    /// What a shape is multiplied with at a row: the direction for what brakes.
    pub fn sign(self, signals: &Signals, row: usize) -> f64 {
        match self {
            Along::TightPlace => rounded_sign(signals.relative_speed[row], 0.0),
            _ => 1.0,
        }
    }
}
