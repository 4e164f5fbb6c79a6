//! What a residual of a double drive may be a shape over.

use crate::signal::channel::Channel;
use crate::signal::leftover::Form;
use plant::Axis;

/// Lowest order per turn of a motor.
pub const LEAST_ORDER: f64 = 0.3;
/// Lowest order per turn of screw against nut: below it a wave over the few turns of a record is a slope.
pub const LEAST_RELATIVE_ORDER: f64 = 0.4;

/// What a shape is multiplied with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Factor {
    /// Direction of a motor, of what brakes it.
    Direction(Axis),
    /// Direction of screw against nut.
    RelativeDirection,
    /// Speed of a motor, of its flux or viscous friction.
    Speed(Axis),
    /// Current of a motor, of its resistance.
    Current(Axis),
}

impl Factor {
    /// Whether it makes something of what a channel shows.
    fn is_in(self, channel: Channel) -> bool {
        match self {
            Factor::Direction(axis) => channel == Channel::Torque(axis),
            Factor::RelativeDirection => {
                matches!(channel, Channel::Torque(_) | Channel::Table)
            }
            Factor::Speed(axis) => {
                channel == Channel::Torque(axis) || channel == Channel::VoltageQ(axis)
            }
            Factor::Current(axis) => channel == Channel::VoltageQ(axis),
        }
    }
}

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
    /// Angle of a motor since its last reversal, of what brakes it.
    SinceReversal(Axis),
    /// Time, over which something drifts.
    Time,
    /// Time, of what has a factor.
    TimeTimes(Factor),
    /// Speed of a motor, of what has a factor.
    SpeedTimes(Axis, Factor),
    /// Angle of a motor, of what has a factor.
    AngleTimes(Axis, Factor),
}

impl Along {
    /// All of them.
    pub const ALL: [Along; 12] = [
        Along::Angle(Axis::Screw),
        Along::Angle(Axis::Nut),
        Along::RelativeAngle,
        Along::Clock,
        Along::Speed(Axis::Screw),
        Along::Speed(Axis::Nut),
        Along::RelativeSpeed,
        Along::TablePosition,
        Along::TightPlace,
        Along::SinceReversal(Axis::Screw),
        Along::SinceReversal(Axis::Nut),
        Along::Time,
    ];

    /// Products of two of them.
    pub const PRODUCTS: [Along; 13] = [
        Along::TimeTimes(Factor::RelativeDirection),
        Along::TimeTimes(Factor::Direction(Axis::Screw)),
        Along::TimeTimes(Factor::Direction(Axis::Nut)),
        Along::TimeTimes(Factor::Speed(Axis::Screw)),
        Along::TimeTimes(Factor::Speed(Axis::Nut)),
        Along::TimeTimes(Factor::Current(Axis::Screw)),
        Along::TimeTimes(Factor::Current(Axis::Nut)),
        Along::SpeedTimes(Axis::Screw, Factor::Current(Axis::Screw)),
        Along::SpeedTimes(Axis::Nut, Factor::Current(Axis::Nut)),
        Along::SpeedTimes(Axis::Screw, Factor::RelativeDirection),
        Along::SpeedTimes(Axis::Nut, Factor::RelativeDirection),
        Along::AngleTimes(Axis::Screw, Factor::Speed(Axis::Screw)),
        Along::AngleTimes(Axis::Nut, Factor::Speed(Axis::Nut)),
    ];

    /// What it is multiplied with.
    pub fn factor(self) -> Option<Factor> {
        match self {
            Along::TightPlace => Some(Factor::RelativeDirection),
            Along::SinceReversal(axis) => Some(Factor::Direction(axis)),
            Along::TimeTimes(factor)
            | Along::SpeedTimes(_, factor)
            | Along::AngleTimes(_, factor) => Some(factor),
            _ => None,
        }
    }

    /// Whether a channel can show it.
    pub fn is_in(self, channel: Channel) -> bool {
        self == Along::TightPlace || self.factor().is_none_or(|factor| factor.is_in(channel))
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
            Along::SinceReversal(Axis::Screw) => "angle of the screw since its reversal",
            Along::SinceReversal(Axis::Nut) => "angle of the nut since its reversal",
            Along::TimeTimes(factor) => match factor {
                Factor::Direction(Axis::Screw) => "time, against the motion of the screw",
                Factor::Direction(Axis::Nut) => "time, against the motion of the nut",
                Factor::RelativeDirection => "time, against the motion of the table",
                Factor::Speed(Axis::Screw) => "time, times speed of the screw",
                Factor::Speed(Axis::Nut) => "time, times speed of the nut",
                Factor::Current(Axis::Screw) => "time, times current of the screw",
                Factor::Current(Axis::Nut) => "time, times current of the nut",
            },
            Along::SpeedTimes(Axis::Screw, Factor::Current(_)) => {
                "speed of the screw, times its current"
            }
            Along::SpeedTimes(Axis::Nut, Factor::Current(_)) => {
                "speed of the nut, times its current"
            }
            Along::SpeedTimes(Axis::Screw, _) => {
                "speed of the screw, against the motion of the table"
            }
            Along::SpeedTimes(Axis::Nut, _) => "speed of the nut, against the motion of the table",
            Along::AngleTimes(Axis::Screw, _) => "angle of the screw, times its speed",
            Along::AngleTimes(Axis::Nut, _) => "angle of the nut, times its speed",
        }
    }

    /// What kind of shape there may be, in rows of which `nyquist` is half the rate, Hz.
    pub fn form(self, nyquist: f64) -> Form {
        match self {
            Along::Angle(_) | Along::AngleTimes(..) => Form::Repeats(LEAST_ORDER..126.0),
            Along::RelativeAngle => Form::Repeats(LEAST_RELATIVE_ORDER..60.0),
            Along::Clock => Form::Repeats(0.5..0.9 * nyquist),
            _ => Form::Curve,
        }
    }

    /// Whether a shape there repeats; an order is then one per turn, of the clock one per second.
    pub fn repeats(self) -> bool {
        matches!(
            self,
            Along::Angle(_) | Along::AngleTimes(..) | Along::RelativeAngle | Along::Clock
        )
    }
}
