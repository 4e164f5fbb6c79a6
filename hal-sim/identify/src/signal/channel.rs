//! The balances that a record is compared with.

use plant::Axis;

/// One balance; its residual is what is measured less what the model says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Channel {
    /// Torque on a motor's shaft, N m: electromagnetic less inertia, friction and load.
    Torque(Axis),
    /// d voltage of a motor, V: commanded less what resistance and inductance take.
    VoltageD(Axis),
    /// q voltage of a motor, V: commanded less resistance, inductance and back-EMF.
    VoltageQ(Axis),
    /// Table against the angles of screw and nut, m.
    Table,
}

impl Channel {
    /// All channels of a double drive, in the order of their index.
    pub const ALL: [Channel; 7] = [
        Channel::Torque(Axis::Screw),
        Channel::Torque(Axis::Nut),
        Channel::VoltageD(Axis::Screw),
        Channel::VoltageQ(Axis::Screw),
        Channel::VoltageD(Axis::Nut),
        Channel::VoltageQ(Axis::Nut),
        Channel::Table,
    ];
    /// Number of channels.
    pub const COUNT: usize = 7;

    /// Position in [`Channel::ALL`].
    pub const fn index(self) -> usize {
        match self {
            Channel::Torque(axis) => axis.index(),
            Channel::VoltageD(axis) => 2 + 2 * axis.index(),
            Channel::VoltageQ(axis) => 3 + 2 * axis.index(),
            Channel::Table => 6,
        }
    }

    /// As in a report.
    pub fn name(self) -> &'static str {
        match self {
            Channel::Torque(Axis::Screw) => "screw torque",
            Channel::Torque(Axis::Nut) => "nut torque",
            Channel::VoltageD(Axis::Screw) => "screw d voltage",
            Channel::VoltageQ(Axis::Screw) => "screw q voltage",
            Channel::VoltageD(Axis::Nut) => "nut d voltage",
            Channel::VoltageQ(Axis::Nut) => "nut q voltage",
            Channel::Table => "table position",
        }
    }

    /// SI unit of the residual.
    pub fn unit(self) -> &'static str {
        match self {
            Channel::Torque(_) => "N m",
            Channel::VoltageD(_) | Channel::VoltageQ(_) => "V",
            Channel::Table => "m",
        }
    }
}
