//! What a residual of a double drive may be a shape over.

use crate::signal::leftover::Form;
use plant::Axis;

/// Lowest order per turn of a motor.
pub const LEAST_ORDER: f64 = 0.3;
/// Lowest order per turn of screw against nut: below it a wave over the few turns of a record is a slope.
pub const LEAST_RELATIVE_ORDER: f64 = 0.4;

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
}
