//! Which columns a machine's record has.

use plant::recording::COLUMNS;
use serde::Deserialize;

/// What was recorded.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
pub enum Machine {
    /// Two motors on one screw; the columns of `plant::recording`.
    #[default]
    #[serde(rename = "double drive")]
    DoubleDrive,
    /// One motor that moves a carriage in a position loop.
    #[serde(rename = "feed axis")]
    FeedAxis,
    /// A motor alone in a speed loop.
    #[serde(rename = "motor")]
    Motor,
}

/// One of our columns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Column {
    /// Its name, unit last.
    pub(super) name: &'static str,
    /// 0 where a file does not have it.
    pub(super) optional: bool,
}

const fn column(name: &'static str) -> Column {
    Column {
        name,
        optional: false,
    }
}

impl Machine {
    /// Its columns but time.
    pub(super) fn columns(self) -> Vec<Column> {
        match self {
            Machine::DoubleDrive => COLUMNS[1..].iter().map(|name| column(name)).collect(),
            Machine::FeedAxis => vec![
                column("position_m"),
                column("reference_m"),
                column("output_v"),
                Column {
                    name: "pulses_v",
                    optional: true,
                },
            ],
            Machine::Motor => vec![column("position_rad"), column("current_a")],
        }
    }

    /// Numbers that stand beside the columns.
    pub(super) fn constants(self) -> &'static [&'static str] {
        match self {
            Machine::FeedAxis => &["force_per_volt_n", "kp_per_s", "kv_v_s_per_m"],
            _ => &[],
        }
    }
}

impl Column {
    /// Largest value that a feed drive has; beyond it a unit is wrong.
    pub(super) fn most(self) -> f64 {
        const MOST: [(&str, f64); 6] = [
            ("_rad_s", 5000.0),
            ("_rad", 1e7),
            ("_a", 200.0),
            ("_v", 2000.0),
            ("_m", 10.0),
            ("_s", 1e6),
        ];
        MOST.iter()
            .find(|(unit, _)| self.name.ends_with(unit))
            .map_or(f64::INFINITY, |(_, most)| *most)
    }
}
