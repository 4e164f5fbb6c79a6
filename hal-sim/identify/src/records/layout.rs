//! Which channels a machine's record has.

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
    /// A motor in a speed loop of which only a current is known.
    #[serde(rename = "motor")]
    Motor,
    /// One permanent-magnet motor with its electrical side.
    #[serde(rename = "pmsm")]
    Pmsm,
}

/// Whether a file must have a channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// It must.
    Required,
    /// It need not.
    Optional,
    /// It, or all channels of another alternative of the same group: (group, alternative).
    OneOf(&'static str, u8),
}

/// A channel of a machine's record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layout {
    /// Its name, SI unit last.
    pub name: &'static str,
    /// Whether a file must have it.
    pub need: Need,
    /// What it is.
    pub about: &'static str,
}

const fn required(name: &'static str, about: &'static str) -> Layout {
    Layout {
        name,
        need: Need::Required,
        about,
    }
}

const fn optional(name: &'static str, about: &'static str) -> Layout {
    Layout {
        name,
        need: Need::Optional,
        about,
    }
}

const fn one_of(
    name: &'static str,
    group: &'static str,
    alternative: u8,
    about: &'static str,
) -> Layout {
    Layout {
        name,
        need: Need::OneOf(group, alternative),
        about,
    }
}

/// What is recorded of either motor of a double drive, in the order of [`COLUMNS`].
const DRIVE_ABOUT: [&str; 7] = [
    "mechanical angle as the encoder reads it, many turns",
    "measured current of phase a",
    "measured current of phase b",
    "d voltage commanded for the control period that ends now, power-invariant",
    "q voltage commanded for the control period that ends now, power-invariant",
    "output of the speed loop, power-invariant",
    "speed reference, mechanical",
];

const FEED_AXIS: [Layout; 6] = [
    one_of("position_m", "position", 0, "position of the carriage"),
    one_of(
        "speed_m_s",
        "position",
        1,
        "speed of the carriage; without `position_m` the position is its integral",
    ),
    optional("reference_m", "position reference"),
    one_of("output_v", "drive", 0, "the controller's output"),
    one_of(
        "force_n",
        "drive",
        1,
        "motor force, where the log has no output",
    ),
    optional("pulses_v", "voltage added to the controller's output"),
];

const MOTOR: [Layout; 5] = [
    one_of("position_rad", "angle", 0, "mechanical angle"),
    one_of(
        "speed_rad_s",
        "angle",
        1,
        "mechanical speed; without `position_rad` the angle is its integral",
    ),
    required("current_a", "torque-making (q) current"),
    optional("speed_ref_rad_s", "speed reference, mechanical"),
    optional("bus_v", "bus voltage"),
];

const PMSM: [Layout; 22] = [
    one_of("angle_rad", "angle", 0, "mechanical angle, many turns"),
    one_of(
        "electrical_angle_rad",
        "angle",
        1,
        "electrical angle; the mechanical one is it over `pole_pairs`",
    ),
    one_of(
        "speed_rad_s",
        "angle",
        2,
        "mechanical speed; without an angle the angle is its integral",
    ),
    one_of("id_a", "currents", 0, "d current"),
    one_of("iq_a", "currents", 0, "q current"),
    one_of("ia_a", "currents", 1, "current of phase a"),
    one_of("ib_a", "currents", 1, "current of phase b"),
    optional(
        "ic_a",
        "current of phase c; without it minus the sum of the others",
    ),
    one_of("ud_v", "voltages", 0, "commanded d voltage"),
    one_of("uq_v", "voltages", 0, "commanded q voltage"),
    one_of("ualpha_v", "voltages", 1, "commanded voltage along phase a"),
    one_of(
        "ubeta_v",
        "voltages",
        1,
        "commanded voltage a quarter turn ahead",
    ),
    one_of("ua_v", "voltages", 2, "voltage of phase a"),
    one_of("ub_v", "voltages", 2, "voltage of phase b"),
    one_of("uc_v", "voltages", 2, "voltage of phase c"),
    one_of("duty_a", "voltages", 3, "duty of phase a, 0 to 1"),
    one_of("duty_b", "voltages", 3, "duty of phase b, 0 to 1"),
    one_of("duty_c", "voltages", 3, "duty of phase c, 0 to 1"),
    optional("bus_v", "bus voltage; required where duties are given"),
    optional("id_ref_a", "reference of the d current"),
    optional("iq_ref_a", "reference of the q current"),
    optional("speed_ref_rad_s", "speed reference, mechanical"),
];

impl Machine {
    /// All of them.
    pub const ALL: [Machine; 4] = [
        Machine::DoubleDrive,
        Machine::FeedAxis,
        Machine::Motor,
        Machine::Pmsm,
    ];

    /// As in a mapping file.
    pub fn name(self) -> &'static str {
        match self {
            Machine::DoubleDrive => "double drive",
            Machine::FeedAxis => "feed axis",
            Machine::Motor => "motor",
            Machine::Pmsm => "pmsm",
        }
    }

    /// What it is.
    pub fn about(self) -> &'static str {
        match self {
            Machine::DoubleDrive => {
                "two motors on one ball screw; one turns the screw, the other the nut"
            }
            Machine::FeedAxis => "one motor that moves a carriage in a position loop",
            Machine::Motor => {
                "a motor of which only the torque-making current and the angle are known"
            }
            Machine::Pmsm => "one permanent-magnet motor with its electrical side",
        }
    }

    /// Its channels but time.
    pub fn channels(self) -> Vec<Layout> {
        match self {
            Machine::DoubleDrive => COLUMNS[1..]
                .iter()
                .enumerate()
                .map(|(k, name)| {
                    let about = match k {
                        14 => "position of the table's linear scale",
                        _ => DRIVE_ABOUT[k % 7],
                    };
                    match name.ends_with("iq_ref_a") {
                        true => optional(name, about),
                        false => required(name, about),
                    }
                })
                .collect(),
            Machine::FeedAxis => FEED_AXIS.to_vec(),
            Machine::Motor => MOTOR.to_vec(),
            Machine::Pmsm => PMSM.to_vec(),
        }
    }

    /// Constants of a record besides its channels, with what they are.
    pub fn constants(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Machine::FeedAxis => &[
                (
                    "force_per_volt_n",
                    "motor force per volt of the controller's output, N/V",
                ),
                ("kp_per_s", "gain of the position loop, 1/s"),
                ("kv_v_s_per_m", "gain of the velocity loop, V s/m"),
            ],
            _ => &[],
        }
    }
}

/// Largest plausible value of a channel by its unit. The largest servo drives have 200 A, 1200 V DC links, 30,000 rpm
/// spindles and travels of 10 m.
pub(super) fn most(name: &str) -> f64 {
    const MOST: [(&str, f64); 8] = [
        ("_rad_s", 5000.0),
        ("_m_s", 50.0),
        ("_rad", 1e7),
        ("_a", 200.0),
        ("_v", 2000.0),
        ("_n", 1e6),
        ("_m", 10.0),
        ("_s", 1e6),
    ];
    if name.starts_with("duty") {
        return 1.5;
    }
    MOST.iter()
        .find(|(unit, _)| name.ends_with(unit))
        .map_or(f64::INFINITY, |(_, most)| *most)
}

/// The unit of a channel by its name's ending.
pub(super) fn unit(name: &str) -> &'static str {
    const UNITS: [(&str, &str); 8] = [
        ("_rad_s", "rad/s"),
        ("_m_s", "m/s"),
        ("_rad", "rad"),
        ("_a", "A"),
        ("_v", "V"),
        ("_n", "N"),
        ("_m", "m"),
        ("_s", "s"),
    ];
    if name.starts_with("duty") {
        return "1";
    }
    UNITS
        .iter()
        .find(|(ending, _)| name.ends_with(ending))
        .map_or("1", |(_, unit)| unit)
}
