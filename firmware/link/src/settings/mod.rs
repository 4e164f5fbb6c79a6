//! What a person may set of a drive without building its firmware: each setting with its name, unit, range, default and
//! meaning, defined here and nowhere else.
//!
//! | part | module |
//! | --- | --- |
//! | the settings, by group | here |
//! | settings <-> the control code's plate | [`plate`] |
//! | other ways in which datasheets print the same | [`datasheet`] |
//! | settings in flash | [`store`] |
//! | which of them a drive runs on | [`keep`] |
//! | how a setting is declared | [`table`] |
//!
//! Pins, timers, shunts and dividers are the board's, which stays Rust: see `firmware/src/board`. The drive computes its
//! fixed-point configuration from the settings by the code that the host runs too, so both refuse the same.

pub mod datasheet;
pub mod plate;
pub mod store;
pub mod table;

pub use table::{Entry, Kind, Setting, Value};

use crate::telemetry::Real;
use control::plate::{BasePlate, BrakePlate, HomePlate, RejectionPlate, TravelPlate};
use core::f64::consts::TAU;
use table::{Typed, choice, constant, group, said};

/// V per 1000 rpm of 1 V s/rad.
pub const PER_KRPM: f64 = 1000.0 * TAU / 60.0;

choice! {
    /// How a motor's encoder is read.
    EncoderInterface {
        /// Channels A and B.
        Incremental "incremental",
        /// Channels A, B and an index.
        IncrementalWithIndex "incremental with index",
        /// Frames by SPI.
        Mt6835 "MT6835",
    }
}

choice! {
    /// Which way an encoder counts while its motor turns forwards.
    EncoderDirection {
        /// Not known: the alignment finds it.
        Unknown "unknown",
        /// Up.
        Forwards "forwards",
        /// Down.
        Backwards "backwards",
    }
}

choice! {
    /// A direction of the table.
    Direction {
        /// Towards negative velocity.
        Backwards "backwards",
        /// Towards positive velocity.
        Forwards "forwards",
    }
}

choice! {
    /// Yes or no.
    Switch {
        /// No.
        Off "off",
        /// Yes.
        On "on",
    }
}

group! {
    /// A motor, its encoder and its current channels, as their datasheets print them.
    MotorSettings {
        1 Real resistance_line_to_line_ohm: f64 = 3.4, [0.002, 200.0], "ohm", "Resistance between two leads at 20 to 25 degrees Celsius.";
        2 Real inductance_line_to_line_mh: f64 = 11.8, [0.001, 250.0], "mH", "Inductance between two leads.";
        3 Whole pole_pairs: u32 = 5, [1, 128], "", "Electrical turns a mechanical turn: half the number of poles.";
        4 Real voltage_constant_v_rms_per_krpm: f64 = 0.55 * PER_KRPM, [0.01, 10_000.0], "V/krpm", "Induced voltage between two leads, rms, at 1000 rpm (Ke).";
        5 Real inertia_kg_cm2: f64 = 7.2, [1e-3, 1e6], "kg cm^2", "All that the motor moves: its rotor, the coupling, screw or nut, and the table's mass through the lead.";
        6 Real speed_max_rpm: f64 = 3000.0, [1.0, 60_000.0], "rpm", "Largest speed.";
        7 Real torque_max_nm: f64 = 2.0, [1e-3, 1e4], "N m", "Largest torque.";
        8 Real rated_current_a_rms: f64 = 1.3, [0.01, 1000.0], "A rms", "Current of each lead that the winding bears for ever.";
        9 Real thermal_time_s: f64 = 60.0, [1.0, 1e5], "s", "Thermal time constant of the winding.";
        10 Real alignment_torque_nm: f64 = 0.39, [1e-4, 1e4], "N m", "Largest torque while the rotor is looked for: three tenths of the rated one.";
        11 Choice encoder_interface: EncoderInterface = EncoderInterface::Incremental, EncoderInterface::WORDS, "", "How the encoder is read. What the board's pins can read, its firmware says.";
        12 Whole encoder_counts_per_turn: u32 = 40_000, [2, 1 << 30], "counts", "Counts a turn: four times the lines of an incremental encoder.";
        13 Choice encoder_direction: EncoderDirection = EncoderDirection::Forwards, EncoderDirection::WORDS, "", "Which way it counts while the motor turns electrically forwards.";
        14 Real encoder_zero_deg: f64 = 0.0, [-360.0, 360.0], "electrical degrees", "Electrical angle where the encoder counts zero.";
        15 Real encoder_age_us: f64 = 0.0, [0.0, 200.0], "us", "How much earlier than the currents the angle is taken.";
        16 Real current_gain_a: f64 = 1.0, [0.5, 2.0], "", "Gain of current channel a relative to the board's: 1 where it is not calibrated.";
        17 Real current_gain_b: f64 = 1.0, [0.5, 2.0], "", "The same of channel b.";
        18 Real current_gain_c: f64 = 1.0, [0.5, 2.0], "", "The same of channel c.";
    }
}

group! {
    /// Both bridges, which are alike: what of a board may differ from one to the next.
    BridgeSettings {
        1 Real over_current_a: f64 = 4.9, [0.01, 2000.0], "A", "Measured phase current, peak, past which a bridge opens in the same period.";
        2 Choice measure_zeros: Switch = Switch::On, Switch::WORDS, "", "Measure the current zeros before each start.";
        3 Real dead_time_ns: f64 = 0.0, [0.0, 10_000.0], "ns", "Dead time of the timer; 0 switches its compensation off.";
        4 Real dead_time_fade_a: f64 = 0.05, [1e-3, 100.0], "A", "Current at which the compensation of the dead time is full.";
        5 Real min_on_time_us: f64 = 1.0, [0.0, 50.0], "us", "Shortest on-time of the low sides: what the shunts need to settle and be sampled.";
        6 Real bootstrap_ms: f64 = 0.0, [0.0, 1000.0], "ms", "How long the low sides are closed before a bridge is first driven.";
        7 Real rated_current_a_rms: f64 = 3.0, [0.01, 1000.0], "A rms", "Current of each phase that a bridge bears for ever.";
        8 Real thermal_time_s: f64 = 20.0, [1.0, 1e5], "s", "Thermal time constant of a bridge.";
        9 Real bus_min_v: f64 = 30.0, [1.0, 1000.0], "V", "Lowest bus voltage that the voltage is computed for.";
        10 Real brake_fade_from_v: f64 = 372.0, [1.0, 1000.0], "V", "Bus voltage at which braking begins to fade: above what the supply or a chopper holds.";
        11 Real brake_fade_to_v: f64 = 384.0, [1.0, 1000.0], "V", "Bus voltage at which braking has ended: below the board's limit.";
    }
}

group! {
    /// The feed, and how it may be moved.
    FeedSettings {
        1 Real lead_mm: f64 = 5.0, [0.01, 1000.0], "mm", "Travel of the table a turn of screw against nut.";
        2 Real scale_count_nm: f64 = 10.0, [1e-3, 1e6], "nm", "One count of the table's scale.";
        3 Real velocity_max_mm_s: f64 = 100.0, [1e-3, 8000.0], "mm/s", "Largest table velocity.";
        4 Real acceleration_max_mm_s2: f64 = 250.0, [1e-2, 1e6], "mm/s^2", "Largest table acceleration.";
        5 Real jerk_max_mm_s3: f64 = 10_000.0, [1e-1, 1e9], "mm/s^3", "Largest table jerk.";
        6 Real base_acceleration_max_rpm_s: f64 = 700.0 * 60.0 / TAU, [1.0, 1e7], "rpm/s", "Largest acceleration of the base speed, which both motors share.";
        7 Real base_jerk_max_rpm_s2: f64 = 20_000.0 * 60.0 / TAU, [1.0, 1e10], "rpm/s^2", "Largest jerk of the base speed.";
    }
}

group! {
    /// How the rotors may be moved to find where they stand.
    AlignmentSettings {
        1 Real travel_um: f64 = 50.0, [1.0, 1e5], "um", "Furthest that the table may move.";
        2 Real speed_rpm: f64 = 200.0, [1.0, 10_000.0], "rpm", "Speed at which both motors turn together: a fifteenth of the largest.";
    }
}

group! {
    /// The loops' tuning (Eqs 9 to 12).
    TuningSettings {
        1 Real damping: f64 = 0.7, [0.1, 2.0], "", "Damping of the current and speed loops.";
        2 Real current_rad_s: f64 = 3000.0, [10.0, 50_000.0], "rad/s", "Cutoff of the current loops.";
        3 Real speed_rad_s: f64 = 200.0, [1.0, 10_000.0], "rad/s", "Cutoff of the speed loops.";
        4 Real observer_rad_s: f64 = 1000.0, [10.0, 50_000.0], "rad/s", "Natural frequency of the observers: five times the speed loops' cutoff or more.";
        5 Real observer_damping: f64 = 0.9, [0.1, 2.0], "", "Damping of the observers.";
    }
}

group! {
    /// When a motor's motion is not in hand: limits, and how long each is tolerated.
    WatchSettings {
        1 Real over_speed_percent: f64 = 120.0, [100.0, 200.0], "%", "Fastest, of the motor's largest speed.";
        2 Real over_speed_ms: f64 = 1.6, [0.1, 1000.0], "ms", "Patience with it.";
        3 Real following_percent: f64 = 10.0, [0.1, 100.0], "%", "Furthest of a speed from its reference, of the motor's largest speed.";
        4 Real following_ms: f64 = 20.0, [0.1, 1000.0], "ms", "Patience with it.";
        5 Real current_error_percent: f64 = 35.0, [1.0, 100.0], "%", "Furthest of a current from its reference, of the largest torque's.";
        6 Real current_error_ms: f64 = 8.0, [0.1, 1000.0], "ms", "Patience with it.";
        7 Real angle_deg: f64 = 25.0, [1.0, 60.0], "electrical degrees", "Angle error that must not be.";
        8 Real angle_floor_percent: f64 = 6.0, [0.1, 100.0], "%", "Voltage that the motor's model may be off by at any speed, of the back-EMF at the largest speed.";
        9 Real resistance_error_percent: f64 = 40.0, [0.0, 200.0], "%", "By how much the resistance may be off: a hot winding's is 40 % above a cold one's.";
        10 Real angle_ms: f64 = 3.2, [0.1, 1000.0], "ms", "Patience with an angle error.";
        11 Real stall_percent: f64 = 1.0, [0.01, 100.0], "%", "Slowest that a motor at its torque limit must turn, of its largest speed.";
        12 Real stall_ms: f64 = 500.0, [1.0, 10_000.0], "ms", "Patience with one that does not.";
        13 Real current_sum_percent: f64 = 15.0, [0.5, 100.0], "%", "Furthest of the sum of three currents from zero, of the largest torque's, in two steps in a row.";
    }
}

group! {
    /// How the drive is commanded.
    CommandSettings {
        1 Real heartbeat_ms: f64 = 500.0, [10.0, 10_000.0], "ms", "How long the machine goes on moving by a command that nobody renews.";
    }
}

group! {
    /// What repeats with an angle and is compensated.
    CompensationSettings {
        1 Real learning_s: f64 = 0.0, [0.0, 1000.0], "s", "Time constant with which orders are learned, the usual ones of both motors, encoders and the lead where none is set; 0: nothing is learned.";
    }
}

group! {
    /// Friction that is known and fed forward at one place; its speeds and angles are of its own surface, mechanical.
    FrictionSettings {
        1 Real coulomb_nm: f64 = 0.0, [0.0, 1e4], "N m", "Friction while it slides; 0: none is fed forward.";
        2 Real sticks_nm: f64 = 0.0, [0.0, 1e4], "N m", "What it takes more to break away.";
        3 Real stribeck_rad_s: f64 = 1.0, [1e-3, 1e4], "rad/s", "Speed at which that has fallen to 1/e.";
        4 Real presliding_mrad: f64 = 1.0, [1e-3, 1e4], "mrad", "Way over which it turns at a reversal, by all but 1/e.";
    }
}

group! {
    /// What keeps a disturbance from the table.
    RejectionSettings {
        1 Real disturbance_rad_s: f64 = 0.0, [0.0, 10_000.0], "rad/s", "Cutoff of the disturbance observers, which find the torque that nobody knows; 0: there is none.";
        2 Real notch_hz: f64 = 0.0, [0.0, 20_000.0], "Hz", "Frequency that is left out of the current references: the axial mode's; 0: none.";
        3 Real notch_damping: f64 = RejectionPlate::NONE.notch.damping, [0.01, 2.0], "", "Damping of the notch's poles: half its width over its frequency.";
        4 Real notch_depth: f64 = RejectionPlate::NONE.notch.depth, [0.0, 1.0], "", "What passes at its frequency.";
    }
}

group! {
    /// The base speed, where a command gives none: `nut_k_rpm` for table velocities up to `table_k_mm_s`, rising, the last for all
    /// above.
    BaseSettings {
        1 Real wander_rpm: f64 = 0.0, [0.0, 10_000.0], "rpm", "By how much a base speed wanders away from 0 and back, so that no ripple stays on a resonance; 0: it does not.";
        2 Real wander_s: f64 = BasePlate::NONE.wander_s, [0.1, 10_000.0], "s", "Time of a wander to and fro.";
        3 Real table_1_mm_s: f64 = 0.0, [0.0, 10_000.0], "mm/s", "Largest table velocity of base speed 1; 0: there is none.";
        4 Real nut_1_rpm: f64 = 0.0, [-60_000.0, 60_000.0], "rpm", "Base speed 1.";
        5 Real table_2_mm_s: f64 = 0.0, [0.0, 10_000.0], "mm/s", "Largest table velocity of base speed 2; 0: there is none.";
        6 Real nut_2_rpm: f64 = 0.0, [-60_000.0, 60_000.0], "rpm", "Base speed 2.";
        7 Real table_3_mm_s: f64 = 0.0, [0.0, 10_000.0], "mm/s", "Largest table velocity of base speed 3; 0: there is none.";
        8 Real nut_3_rpm: f64 = 0.0, [-60_000.0, 60_000.0], "rpm", "Base speed 3.";
        9 Real table_4_mm_s: f64 = 0.0, [0.0, 10_000.0], "mm/s", "Largest table velocity of base speed 4; 0: there is none.";
        10 Real nut_4_rpm: f64 = 0.0, [-60_000.0, 60_000.0], "rpm", "Base speed 4.";
        11 Real table_5_mm_s: f64 = 0.0, [0.0, 10_000.0], "mm/s", "Largest table velocity of base speed 5; 0: there is none.";
        12 Real nut_5_rpm: f64 = 0.0, [-60_000.0, 60_000.0], "rpm", "Base speed 5.";
        13 Real table_6_mm_s: f64 = 0.0, [0.0, 10_000.0], "mm/s", "Largest table velocity of base speed 6; 0: there is none.";
        14 Real nut_6_rpm: f64 = 0.0, [-60_000.0, 60_000.0], "rpm", "Base speed 6.";
        15 Real table_7_mm_s: f64 = 0.0, [0.0, 10_000.0], "mm/s", "Largest table velocity of base speed 7; 0: there is none.";
        16 Real nut_7_rpm: f64 = 0.0, [-60_000.0, 60_000.0], "rpm", "Base speed 7.";
        17 Real table_8_mm_s: f64 = 0.0, [0.0, 10_000.0], "mm/s", "Largest table velocity of base speed 8; 0: there is none.";
        18 Real nut_8_rpm: f64 = 0.0, [-60_000.0, 60_000.0], "rpm", "Base speed 8.";
    }
}

group! {
    /// What repeats with a motor's turn in its torque, as currents: `Re((re + j im) e^(j order angle))` is added.
    TorqueOrderSettings {
        1 Real order_1: f64 = 0.0, [0.0, 1000.0], "", "Repetitions in a turn of torque 1; 0: none.";
        2 Real re_1_a: f64 = 0.0, [-2000.0, 2000.0], "A", "Cosine's part of it: known, or learned before.";
        3 Real im_1_a: f64 = 0.0, [-2000.0, 2000.0], "A", "Minus the sine's part of it: known, or learned before.";
        4 Real order_2: f64 = 0.0, [0.0, 1000.0], "", "Repetitions in a turn of torque 2; 0: none.";
        5 Real re_2_a: f64 = 0.0, [-2000.0, 2000.0], "A", "Cosine's part of it: known, or learned before.";
        6 Real im_2_a: f64 = 0.0, [-2000.0, 2000.0], "A", "Minus the sine's part of it: known, or learned before.";
        7 Real order_3: f64 = 0.0, [0.0, 1000.0], "", "Repetitions in a turn of torque 3; 0: none.";
        8 Real re_3_a: f64 = 0.0, [-2000.0, 2000.0], "A", "Cosine's part of it: known, or learned before.";
        9 Real im_3_a: f64 = 0.0, [-2000.0, 2000.0], "A", "Minus the sine's part of it: known, or learned before.";
        10 Real order_4: f64 = 0.0, [0.0, 1000.0], "", "Repetitions in a turn of torque 4; 0: none.";
        11 Real re_4_a: f64 = 0.0, [-2000.0, 2000.0], "A", "Cosine's part of it: known, or learned before.";
        12 Real im_4_a: f64 = 0.0, [-2000.0, 2000.0], "A", "Minus the sine's part of it: known, or learned before.";
        13 Real order_5: f64 = 0.0, [0.0, 1000.0], "", "Repetitions in a turn of torque 5; 0: none.";
        14 Real re_5_a: f64 = 0.0, [-2000.0, 2000.0], "A", "Cosine's part of it: known, or learned before.";
        15 Real im_5_a: f64 = 0.0, [-2000.0, 2000.0], "A", "Minus the sine's part of it: known, or learned before.";
        16 Real order_6: f64 = 0.0, [0.0, 1000.0], "", "Repetitions in a turn of torque 6; 0: none.";
        17 Real re_6_a: f64 = 0.0, [-2000.0, 2000.0], "A", "Cosine's part of it: known, or learned before.";
        18 Real im_6_a: f64 = 0.0, [-2000.0, 2000.0], "A", "Minus the sine's part of it: known, or learned before.";
        19 Real order_7: f64 = 0.0, [0.0, 1000.0], "", "Repetitions in a turn of torque 7; 0: none.";
        20 Real re_7_a: f64 = 0.0, [-2000.0, 2000.0], "A", "Cosine's part of it: known, or learned before.";
        21 Real im_7_a: f64 = 0.0, [-2000.0, 2000.0], "A", "Minus the sine's part of it: known, or learned before.";
        22 Real order_8: f64 = 0.0, [0.0, 1000.0], "", "Repetitions in a turn of torque 8; 0: none.";
        23 Real re_8_a: f64 = 0.0, [-2000.0, 2000.0], "A", "Cosine's part of it: known, or learned before.";
        24 Real im_8_a: f64 = 0.0, [-2000.0, 2000.0], "A", "Minus the sine's part of it: known, or learned before.";
    }
}

group! {
    /// The same of an encoder's error or the lead's, as a part of the speed.
    SpeedOrderSettings {
        1 Real order_1: f64 = 0.0, [0.0, 1000.0], "", "Repetitions in a turn of error 1; 0: none.";
        2 Real re_1: f64 = 0.0, [-0.0625, 0.0625], "", "Cosine's part of it: known, or learned before.";
        3 Real im_1: f64 = 0.0, [-0.0625, 0.0625], "", "Minus the sine's part of it: known, or learned before.";
        4 Real order_2: f64 = 0.0, [0.0, 1000.0], "", "Repetitions in a turn of error 2; 0: none.";
        5 Real re_2: f64 = 0.0, [-0.0625, 0.0625], "", "Cosine's part of it: known, or learned before.";
        6 Real im_2: f64 = 0.0, [-0.0625, 0.0625], "", "Minus the sine's part of it: known, or learned before.";
    }
}

/// How the table's place is found until somebody sets it.
const HOME: HomePlate = TravelPlate::UNLIMITED.home;

group! {
    /// The table's way: homing to an end switch, and soft limits of the homed position.
    TravelSettings {
        1 Choice home_direction: Direction = Direction::Backwards, Direction::WORDS, "", "Which end switch homing goes to.";
        2 Real home_velocity_mm_s: f64 = HOME.velocity * 1e3, [1e-3, 8000.0], "mm/s", "Table velocity on the way to it, at most the feed's.";
        3 Real home_leaving_mm_s: f64 = HOME.leaving_velocity * 1e3, [1e-3, 8000.0], "mm/s", "Table velocity off it again: what the table moves in a millisecond is what its place is uncertain by.";
        4 Real home_furthest_mm: f64 = HOME.furthest_m * 1e3, [1e-2, 1e5], "mm", "Furthest that the switch is looked for.";
        5 Real home_position_mm: f64 = HOME.position_m * 1e3, [-1e5, 1e5], "mm", "Position of the table where the switch closes as it is left.";
        6 Real soft_least_mm: f64 = 0.0, [-1e5, 1e5], "mm", "Least homed position; as much as soft_most_mm: there are no soft limits.";
        7 Real soft_most_mm: f64 = 0.0, [-1e5, 1e5], "mm", "Most homed position.";
    }
}

group! {
    /// The brake that holds the table while the bridges are off.
    BrakeSettings {
        1 Choice fitted: Switch = Switch::Off, Switch::WORDS, "", "There is one, at the board's output for it.";
        2 Real closing_ms: f64 = BrakePlate::NONE.closing_s * 1e3, [0.0, 5000.0], "ms", "From when it is told until it holds: the motors hold as long.";
        3 Real opening_ms: f64 = BrakePlate::NONE.opening_s * 1e3, [0.0, 5000.0], "ms", "Until it has let go: the table begins to move after it.";
        4 Choice load_drives_back: Switch = Switch::Off, Switch::WORDS, "", "The load moves the table while nothing holds it: such an axis takes a brake.";
    }
}

/// Declares the groups, each with its number.
macro_rules! settings {
    ($($number:literal $name:ident: $group:ident,)*) => {
        /// All settings of a drive.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Settings {
            $(#[doc = concat!("Group `", stringify!($name), "`.")] pub $name: $group,)*
        }

        impl Settings {
            /// What holds until somebody sets it: the paper's motors (Wang et al. 2020, Table 1) on 310 V.
            pub const DEFAULT: Self = Self { $($name: $group::DEFAULT,)* };

            /// All of them, in the order of their numbers.
            pub fn all() -> impl Iterator<Item = Setting> {
                static GROUPS: [(u8, &str, &[Entry]); [$($number),*].len()] =
                    [$(($number, said(stringify!($name)), $group::ENTRIES),)*];
                GROUPS.iter().flat_map(|&(number, group, entries)| {
                    entries.iter().map(move |entry| Setting {
                        id: u16::from_be_bytes([number, entry.number]),
                        group,
                        entry,
                    })
                })
            }

            /// The value of a setting; `None` if there is none of that number.
            #[must_use]
            pub fn get(&self, id: u16) -> Option<Value> {
                let [group, number] = id.to_be_bytes();
                match group {
                    $($number => self.$name.get(number),)*
                    _ => None,
                }
            }

            fn put(&mut self, id: u16, value: Value) -> Option<()> {
                let [group, number] = id.to_be_bytes();
                match group {
                    $($number => self.$name.put(number, value),)*
                    _ => None,
                }
            }
        }
    };
}

settings! {
    1 screw: MotorSettings,
    2 nut: MotorSettings,
    3 bridge: BridgeSettings,
    4 feed: FeedSettings,
    5 alignment: AlignmentSettings,
    6 tuning: TuningSettings,
    7 watch: WatchSettings,
    8 command: CommandSettings,
    9 compensation: CompensationSettings,
    10 screw_friction: FrictionSettings,
    11 nut_friction: FrictionSettings,
    12 feed_friction: FrictionSettings,
    13 screw_torque: TorqueOrderSettings,
    14 nut_torque: TorqueOrderSettings,
    15 screw_encoder: SpeedOrderSettings,
    16 nut_encoder: SpeedOrderSettings,
    17 lead: SpeedOrderSettings,
    18 rejection: RejectionSettings,
    19 base: BaseSettings,
    20 travel: TravelSettings,
    21 brake: BrakeSettings,
}

/// Why a value is refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SettingError {
    /// There is no setting of that number.
    Unknown {
        /// The number.
        id: u16,
    },
    /// It is of another kind: a word where a number is wanted.
    Kind {
        /// The setting.
        id: u16,
    },
    /// It is beyond the setting's range.
    Range {
        /// The setting.
        id: u16,
        /// What was asked, in the setting's unit.
        value: f64,
    },
}

impl core::fmt::Display for SettingError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let id = match *self {
            Self::Unknown { id } => return write!(f, "there is no setting of number {id:#06x}"),
            Self::Kind { id } | Self::Range { id, .. } => id,
        };
        let Some(setting) = Settings::all().find(|setting| setting.id == id) else {
            return write!(f, "there is no setting of number {id:#06x}");
        };
        if let Self::Range { value, .. } = self {
            write!(f, "{setting} is {value}, but ")?;
        } else {
            write!(f, "{setting} has a value of another kind: ")?;
        }
        write!(f, "{} possible", setting.possible())
    }
}

impl core::error::Error for SettingError {}

impl core::fmt::Display for Setting {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}.{}", self.group, self.entry.name)
    }
}

/// What a setting may be, in words that end before "possible".
struct Possible(Setting);

impl Setting {
    /// What it may be, in words: `0.5 to 2 mm are`.
    pub fn possible(&self) -> impl core::fmt::Display {
        Possible(*self)
    }

    /// It says what is compensated: friction, what repeats with an angle, disturbances, the axial mode.
    #[must_use]
    pub fn compensates(&self) -> bool {
        let [group, _] = self.id.to_be_bytes();
        matches!(group, 10..=18)
    }

    /// The setting of a name: `feed.lead_mm`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let (group, name) = name.split_once('.')?;
        Settings::all().find(|setting| setting.group == group && setting.entry.name == name)
    }
}

impl core::fmt::Display for Possible {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Entry { kind, unit, .. } = self.0.entry;
        let space = if unit.is_empty() { "" } else { " " };
        match kind {
            Kind::Real([least, most]) => write!(f, "{least} to {most}{space}{unit} are"),
            Kind::Whole([least, most]) => {
                write!(f, "whole numbers from {least} to {most}{space}{unit} are")
            }
            Kind::Choice(words) => {
                for (k, word) in words.iter().enumerate() {
                    write!(f, "{}\"{word}\"", if k == 0 { "" } else { ", " })?;
                }
                write!(f, " are")
            }
        }
    }
}

impl Settings {
    /// Sets one; what it means together with the others is checked when a plate is made of them.
    ///
    /// # Errors
    /// [`SettingError`]; nothing is changed then.
    pub fn set(&mut self, id: u16, value: Value) -> Result<(), SettingError> {
        let setting = Self::all()
            .find(|setting| setting.id == id)
            .ok_or(SettingError::Unknown { id })?;
        setting.check(value)?;
        self.put(id, value).ok_or(SettingError::Kind { id })
    }

    /// The settings in which `other` differs, in the order of their numbers.
    pub fn differences(&self, other: &Self) -> impl Iterator<Item = (Setting, Value, Value)> {
        Self::all().filter_map(|setting| {
            let (ours, theirs) = (self.get(setting.id)?, other.get(setting.id)?);
            (ours != theirs).then_some((setting, ours, theirs))
        })
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;

    #[test]
    fn each_has_its_own_number_and_name_and_a_default_within_its_range() {
        let all: std::vec::Vec<_> = Settings::all().collect();
        for (k, setting) in all.iter().enumerate() {
            for other in &all[k + 1..] {
                assert_ne!(setting.id, other.id, "{setting} and {other}");
                assert_ne!(setting.to_string(), other.to_string());
            }
            let entry = setting.entry;
            assert_eq!(setting.check(entry.default), Ok(()), "{setting}");
            assert_eq!(Settings::DEFAULT.get(setting.id), Some(entry.default));
            assert!(entry.doc.ends_with('.'), "{setting}: {}", entry.doc);
            assert_eq!(Setting::named(&setting.to_string()).unwrap().id, setting.id);
        }
    }

    /// What is stored and sent by number must not change its meaning: new settings get new numbers.
    #[test]
    fn numbers_stay() {
        for (name, id) in [
            ("screw.resistance_line_to_line_ohm", 0x0101),
            ("nut.encoder_zero_deg", 0x020e),
            ("bridge.over_current_a", 0x0301),
            ("feed.lead_mm", 0x0401),
            ("tuning.observer_damping", 0x0605),
            ("watch.stall_ms", 0x070c),
            ("command.heartbeat_ms", 0x0801),
            ("feed_friction.presliding_mrad", 0x0c04),
            ("nut_torque.im_8_a", 0x0e18),
            ("lead.re_2", 0x1105),
            ("rejection.notch_depth", 0x1204),
            ("base.nut_8_rpm", 0x1312),
        ] {
            assert_eq!(Setting::named(name).map(|setting| setting.id), Some(id));
        }
        let compensates = |name: &str| Setting::named(name).unwrap().compensates();
        assert!(compensates("screw_friction.coulomb_nm") && compensates("lead.order_1"));
        assert!(compensates("rejection.notch_hz"));
        assert!(!compensates("compensation.learning_s") && !compensates("base.wander_rpm"));
    }

    #[test]
    fn what_is_refused_changes_nothing_and_is_named_with_what_is_possible() {
        let mut settings = Settings::DEFAULT;
        for (name, value, said) in [
            (
                "feed.lead_mm",
                Value::Real(Real::new(0.0)),
                "feed.lead_mm is 0, but 0.01 to 1000 mm are possible",
            ),
            (
                "feed.lead_mm",
                Value::Real(Real::new(f64::NAN)),
                "feed.lead_mm is NaN, but 0.01 to 1000 mm are possible",
            ),
            (
                "nut.pole_pairs",
                Value::Whole(129),
                "nut.pole_pairs is 129, but whole numbers from 1 to 128 are possible",
            ),
            (
                "bridge.measure_zeros",
                Value::Whole(1),
                "bridge.measure_zeros has a value of another kind: \"off\", \"on\" are possible",
            ),
        ] {
            let id = Setting::named(name).unwrap().id;
            assert_eq!(settings.set(id, value).unwrap_err().to_string(), said);
        }
        assert_eq!(
            settings.set(0x0999, Value::Whole(1)),
            Err(SettingError::Unknown { id: 0x0999 })
        );
        assert_eq!(settings, Settings::DEFAULT);
        let id = Setting::named("nut.pole_pairs").unwrap().id;
        settings.set(id, Value::Whole(7)).unwrap();
        assert_eq!(settings.nut.pole_pairs, 7);
        assert_eq!(settings.differences(&Settings::DEFAULT).count(), 1);
    }
}
