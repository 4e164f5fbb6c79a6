//! The parameters of a drive, each declared once: what a person may set without building the firmware.
//!
//! Pins, timers, shunts and dividers are the board's: see [`BoardPlate`](super::BoardPlate).

use super::parameter::{Effect, Entry, Kind, PER_KRPM, Part, Row, Text, Unit, Value};
use super::parameter::{choice, effect, field, get, group, of_si, put, row, si, text};
use super::{BASES, OrderPlate};
use crate::current::encoder::Interface;
use crate::speed::compensation::{ANGLES, TORQUES};
use core::f64::consts::TAU;

choice! {
    /// How a motor's encoder is read.
    EncoderInterface: Interface {
        /// Channels A and B.
        Incremental "incremental" => [Interface::Incremental],
        /// Channels A, B and an index.
        IncrementalWithIndex "incremental with index" => [Interface::IncrementalWithIndex],
        /// Frames by SPI.
        Mt6835 "MT6835" => [Interface::Mt6835],
    }
}

choice! {
    /// Which way an encoder counts while its motor turns forwards.
    EncoderDirection: Option<bool> {
        /// Not known: the alignment finds it.
        Unknown "unknown" => [None],
        /// Up.
        Forwards "forwards" => [Some(false)],
        /// Down.
        Backwards "backwards" => [Some(true)],
    }
}

choice! {
    /// A direction of the table.
    Direction: bool {
        /// Towards negative velocity.
        Backwards "backwards" => [false],
        /// Towards positive velocity.
        Forwards "forwards" => [true],
    }
}

choice! {
    /// Yes or no.
    Switch: bool {
        /// No.
        Off "off" => [false],
        /// Yes.
        On "on" => [true],
    }
}

group! {
    /// What a winding or a bridge bears for long: see [`thermal`](crate::speed::thermal).
    ThermalSettings => ThermalPlate {
        0 Real rated_current_a_rms => rated_rms_a = 1.3, (AmpereRms [0.01, 1000.0]), "Current of each phase that it bears for ever while the rotor turns.";
        1 Real thermal_time_s => seconds = 60.0, (Second [1.0, 1e5]), "Its thermal time constant.";
    }
}

group! {
    /// An encoder.
    EncoderSettings => EncoderPlate {
        0 Choice interface => interface = EncoderInterface::Incremental, (EncoderInterface: Interface), "How the encoder is read. What the board's pins can read, its firmware says.";
        1 Whole counts_per_turn => counts_per_turn = 40_000, (Counts [2, 1 << 30]), "Counts a turn: four times the lines of an incremental encoder.";
        2 Choice direction => reversed = EncoderDirection::Forwards, (EncoderDirection: Option<bool>), "Which way it counts while the motor turns electrically forwards.";
        3 Real zero_deg => theta_e_at_zero_turns = 0.0, (ElectricalDegreeAsTurn [-360.0, 360.0]), "Electrical angle where the encoder counts zero.";
        4 Real age_us => age_s = 0.0, (Microsecond [0.0, 200.0]), "How much earlier than the currents the angle is taken.";
    }
}

group! {
    /// A motor, its encoder and its current channels, as their datasheets print them.
    MotorSettings => MotorPlate {
        1 Real resistance_line_to_line_ohm => resistance_ohm = 3.4, (LineOhm [0.002, 200.0]), "Resistance between two leads at 20 to 25 degrees Celsius.";
        2 Real inductance_line_to_line_mh => inductance_h = 11.8, (LineMillihenry [0.001, 250.0]), "Inductance between two leads.";
        3 Whole pole_pairs => pole_pairs = 5, (One [1, 128]), "Electrical turns a mechanical turn: half the number of poles.";
        4 Real voltage_constant_v_rms_per_krpm => flux_wb = 0.55 * PER_KRPM, (VoltPerKrpm / pole_pairs [0.01, 10_000.0]), "Induced voltage between two leads, rms, at 1000 rpm (Ke).";
        5 Real inertia_kg_cm2 => inertia_kg_m2 = 7.2, (KilogramSquareCentimetre [1e-3, 1e6]), "All that the motor moves: its rotor, the coupling, screw or nut, and the table's mass through the lead.";
        6 Real speed_max_rpm => speed_max_rpm = 3000.0, (Rpm [1.0, 60_000.0]), "Largest speed.";
        7 Real torque_max_nm => torque_max_nm = 2.0, (NewtonMetre [1e-3, 1e4]), "Largest torque.";
        8 Part thermal => thermal = ThermalSettings::DEFAULT, (ThermalSettings: ThermalPlate ""), "What its winding bears for long.";
        10 Real alignment_torque_nm => alignment_torque_nm = 0.39, (NewtonMetre [1e-4, 1e4]), "Largest torque while the rotor is looked for: three tenths of the rated one.";
        11 Part encoder => encoder = EncoderSettings::DEFAULT, (EncoderSettings: EncoderPlate "encoder_"), "The encoder on its shaft.";
        16 Real current_gain_a => current_gain_a = 1.0, (One [0.5, 2.0]), "Gain of current channel a relative to the board's: 1 where it is not calibrated.";
        17 Real current_gain_b => current_gain_b = 1.0, (One [0.5, 2.0]), "The same of channel b.";
        18 Real current_gain_c => current_gain_c = 1.0, (One [0.5, 2.0]), "The same of channel c.";
    }
}

group! {
    /// Both bridges, which are alike: what of a board may differ from one to the next.
    BridgeSettings => BridgePlate {
        1 Real over_current_a => over_current_a = 4.9, (Ampere [0.01, 2000.0]), "Measured phase current, peak, past which a bridge opens in the same period.";
        2 Choice measure_zeros => measure_zeros = Switch::On, (Switch: bool), "Measure the current zeros before each start.";
        3 Real dead_time_ns => dead_time_s = 0.0, (Nanosecond [0.0, 10_000.0]), "Dead time of the timer; 0 switches its compensation off.";
        4 Real dead_time_fade_a => dead_time_fade_a = 0.05, (Ampere [1e-3, 100.0]), "Current at which the compensation of the dead time is full: at least 4 C V / t of the capacitance C of a switch, the bus V and the dead time t. Below that the current swings around zero.";
        5 Real min_on_time_us => min_on_time_s = 1.0, (Microsecond [0.0, 50.0]), "Shortest on-time of the low sides: what the shunts need to settle and be sampled.";
        6 Real bootstrap_ms => bootstrap_s = 0.0, (Millisecond [0.0, 1000.0]), "How long the low sides are closed before a bridge is first driven.";
        7 Part thermal => thermal = ThermalSettings { rated_current_a_rms: 3.0, thermal_time_s: 20.0 }, (ThermalSettings: ThermalPlate ""), "What a bridge bears for long.";
        9 Real bus_min_v => bus_min_v = 30.0, (Volt [1.0, 1000.0]), "Lowest bus voltage that the voltage is computed for.";
        10 Real brake_fade_from_v => brake_fade_from_v = 372.0, (Volt [1.0, 1000.0]), "Bus voltage at which braking begins to fade: above what the supply or a chopper holds.";
        11 Real brake_fade_to_v => brake_fade_to_v = 384.0, (Volt [1.0, 1000.0]), "Bus voltage at which braking has ended: below the board's limit.";
    }
}

group! {
    /// The feed, and how it may be moved.
    FeedSettings => FeedPlate {
        1 Real lead_mm => lead_m = 5.0, (Millimetre [0.01, 1000.0]), "Travel of the table a turn of screw against nut.";
        2 Real scale_count_nm => scale_count_m = 10.0, (Nanometre [1e-3, 1e6]), "One count of the table's scale.";
        3 Real velocity_max_mm_s => velocity_max = 100.0, (MillimetrePerS [1e-3, 8000.0]), "Largest table velocity." at_rest;
        4 Real acceleration_max_mm_s2 => acceleration_max = 250.0, (MillimetrePerS2 [1e-2, 1e6]), "Largest table acceleration." at_rest;
        5 Real jerk_max_mm_s3 => jerk_max = 10_000.0, (MillimetrePerS3 [1e-1, 1e9]), "Largest table jerk." at_rest;
        6 Real base_acceleration_max_rpm_s => base_acceleration_max = 700.0 * 60.0 / TAU, (RpmPerS [1.0, 1e7]), "Largest acceleration of the base speed, which both motors share." at_rest;
        7 Real base_jerk_max_rpm_s2 => base_jerk_max = 20_000.0 * 60.0 / TAU, (RpmPerS2 [1.0, 1e10]), "Largest jerk of the base speed." at_rest;
    }
}

group! {
    /// How the rotors may be moved to find where they stand.
    AlignmentSettings => AlignmentPlate {
        1 Real travel_um => travel_m = 50.0, (Micrometre [1.0, 1e5]), "Furthest that the table may move.";
        2 Real speed_rpm => speed_rpm = 200.0, (Rpm [1.0, 10_000.0]), "Speed at which both motors turn together: a fifteenth of the largest.";
    }
}

group! {
    /// The loops' tuning (Eqs 9 to 12).
    TuningSettings => Tuning {
        1 Real damping => damping = 0.7, (One [0.1, 2.0]), "Damping of the current and speed loops.";
        2 Real current_rad_s => current_rad_s = 3000.0, (RadPerS [10.0, 50_000.0]), "Cutoff of the current loops.";
        3 Real speed_rad_s => speed_rad_s = 200.0, (RadPerS [1.0, 10_000.0]), "Cutoff of the speed loops." at_once;
        4 Real observer_rad_s => observer_rad_s = 1000.0, (RadPerS [10.0, 50_000.0]), "Natural frequency of the observers: five times the speed loops' cutoff or more.";
        5 Real observer_damping => observer_damping = 0.9, (One [0.1, 2.0]), "Damping of the observers.";
    }
}

group! {
    /// When a motor's motion is not in hand: limits, and how long each is tolerated.
    WatchSettings => RunawayPlate {
        1 Real over_speed_percent => over_speed = 120.0, (Percent [100.0, 200.0]), "Fastest, of the motor's largest speed." at_rest;
        2 Real over_speed_ms => over_speed_s = 1.6, (Millisecond [0.1, 1000.0]), "Patience with it." at_rest;
        3 Real following_percent => following = 10.0, (Percent [0.1, 100.0]), "Furthest of a speed from its reference, of the motor's largest speed." at_rest;
        4 Real following_ms => following_s = 20.0, (Millisecond [0.1, 1000.0]), "Patience with it." at_rest;
        5 Real current_error_percent => current_error = 35.0, (Percent [1.0, 100.0]), "Furthest of a current from its reference, of the largest torque's." at_rest;
        6 Real current_error_ms => current_error_s = 8.0, (Millisecond [0.1, 1000.0]), "Patience with it." at_rest;
        7 Real angle_deg => angle_deg = 25.0, (ElectricalDegree [1.0, 60.0]), "Angle error that must not be." at_rest;
        8 Real angle_floor_percent => angle_floor = 6.0, (Percent [0.1, 100.0]), "Voltage that the motor's model may be off by at any speed, of the back-EMF at the largest speed." at_rest;
        9 Real resistance_error_percent => resistance_error = 40.0, (Percent [0.0, 200.0]), "By how much the resistance may be off: a hot winding's is 40 % above a cold one's." at_rest;
        10 Real angle_ms => angle_s = 3.2, (Millisecond [0.1, 1000.0]), "Patience with an angle error." at_rest;
        11 Real stall_percent => stall = 1.0, (Percent [0.01, 100.0]), "Slowest that a motor at its torque limit must turn, of its largest speed." at_rest;
        12 Real stall_ms => stall_s = 500.0, (Millisecond [1.0, 10_000.0]), "Patience with one that does not." at_rest;
        13 Real current_sum_percent => current_sum = 15.0, (Percent [0.5, 100.0]), "Furthest of the sum of three currents from zero, of the largest torque's, in two steps in a row." at_rest;
    }
}

group! {
    /// How the drive is commanded.
    CommandSettings => CommandPlate {
        1 Real heartbeat_ms => heartbeat_s = 500.0, (Millisecond [10.0, 10_000.0]), "How long the machine goes on moving by a command that nobody renews." at_rest;
    }
}

group! {
    /// What repeats with an angle and is compensated.
    CompensationSettings => LearningPlate {
        1 Real learning_s => learning_s = 0.0, (Second [0.0, 1000.0]), "Time constant with which orders are learned, the usual ones of both motors, encoders and the lead where none is set; 0: nothing is learned.";
    }
}

group! {
    /// Friction that is known and fed forward at one place; its speeds and angles are of its own surface, mechanical.
    FrictionSettings => RubbingPlate {
        1 Real coulomb_nm => coulomb_nm = 0.0, (NewtonMetre [0.0, 1e4]), "Friction while it slides; 0: none is fed forward." at_once;
        2 Real sticks_nm => sticks_nm = 0.0, (NewtonMetre [0.0, 1e4]), "What it takes more to break away." at_once;
        3 Real stribeck_rad_s => stribeck_rad_s = 1.0, (RadPerS [1e-3, 1e4]), "Speed at which that has fallen to 1/e." at_once;
        4 Real presliding_mrad => presliding_rad = 1.0, (Milliradian [1e-3, 1e4]), "Way over which it turns at a reversal, by all but 1/e." at_once;
    }
}

group! {
    /// A notch in both motors' current references.
    NotchSettings => NotchPlate {
        0 Real hz => hz = 0.0, (Hertz [0.0, 20_000.0]), "Frequency that is left out of the current references: the axial mode's; 0: none." at_rest;
        1 Real damping => damping = 0.3, (One [0.01, 2.0]), "Damping of the notch's poles: half its width over its frequency." at_rest;
        2 Real depth => depth = 0.1, (One [0.0, 1.0]), "What passes at its frequency." at_rest;
    }
}

group! {
    /// What keeps a disturbance from the table: see [`disturbance`](crate::speed::disturbance) and [`notch`](crate::speed::notch).
    RejectionSettings => RejectionPlate {
        1 Real disturbance_rad_s => disturbance_rad_s = 0.0, (RadPerS [0.0, 10_000.0]), "Cutoff of the disturbance observers, which find the torque that nobody knows; 0: there is none." at_rest;
        2 Part notch => notch = NotchSettings::DEFAULT, (NotchSettings: NotchPlate "notch_"), "What of the current references is left out.";
    }
}

group! {
    /// A base speed for table velocities.
    BasePointSettings => BasePoint {
        0 Real table_mm_s "table_#_mm_s" => velocity = 0.0, (MillimetrePerS [0.0, 10_000.0]), "Largest table velocity of base speed #; 0: there is none." at_once;
        1 Real nut_rpm "nut_#_rpm" => base = 0.0, (RpmAsRadPerS [-60_000.0, 60_000.0]), "Base speed #." at_once;
    }
}

group! {
    /// The base speed, where a command gives none.
    BaseSettings => BasePlate {
        1 Real wander_rpm => wander_rad_s = 0.0, (RpmAsRadPerS [0.0, 10_000.0]), "By how much a base speed wanders away from 0 and back, so that no ripple stays on a resonance; 0: it does not." at_rest;
        2 Real wander_s => wander_s = 10.0, (Second [0.1, 10_000.0]), "Time of a wander to and fro." at_rest;
        3 Parts table => table = [BasePointSettings::DEFAULT; BASES], (BasePointSettings: BasePoint 2; 0 1 2 3 4 5 6 7), "For the table velocities up to each, rising; the last for all above.";
    }
}

group! {
    /// What repeats with a motor's turn in its torque, as a current: `Re((re + j im) e^(j order angle))` is added.
    TorqueOrder in OrderPlate {
        0 Real order "order_#" => order = 0.0, (One [0.0, 1000.0]), "Repetitions in a turn of torque #; 0: none.";
        1 Real re "re_#_a" => re = 0.0, (Ampere [-2000.0, 2000.0]), "Cosine's part of it without a load: known, or learned before.";
        2 Real im "im_#_a" => im = 0.0, (Ampere [-2000.0, 2000.0]), "Minus the sine's part of it without a load: known, or learned before.";
    }
}

group! {
    /// How what repeats with a motor's turn in its torque changes with the motor's load: what an ampere along q adds to it.
    TorqueSlope => TorqueSlopePlate {
        0 Real re "re_#_per_a" => re = 0.0, (One [-1.0, 1.0]), "Change of the cosine's part an ampere of the motor's load: known, or learned before.";
        1 Real im "im_#_per_a" => im = 0.0, (One [-1.0, 1.0]), "Change of minus the sine's part an ampere of the motor's load: known, or learned before.";
    }
}

group! {
    /// The same of an encoder's error or the lead's, as a part of the speed.
    SpeedOrder in OrderPlate {
        0 Real order "order_#" => order = 0.0, (One [0.0, 1000.0]), "Repetitions in a turn of error #; 0: none.";
        1 Real re "re_#" => re = 0.0, (One [-0.0625, 0.0625]), "Cosine's part of it: known, or learned before.";
        2 Real im "im_#" => im = 0.0, (One [-0.0625, 0.0625]), "Minus the sine's part of it: known, or learned before.";
    }
}

group! {
    /// What repeats with a motor's turn in its torque.
    TorqueOrderSettings => TorqueOrderPlates {
        1 Parts orders => orders = [TorqueOrder::DEFAULT; TORQUES], (TorqueOrder: OrderPlate 3; 0 1 2 3 4 5 6 7), "The orders.";
        25 Parts slopes => slopes = [TorqueSlope::DEFAULT; TORQUES], (TorqueSlope: TorqueSlopePlate 2; 0 1 2 3 4 5 6 7), "How they change with the load.";
    }
}

group! {
    /// What repeats with a turn of an encoder or of screw against nut in a speed.
    SpeedOrderSettings => SpeedOrderPlates {
        1 Parts orders => orders = [SpeedOrder::DEFAULT; ANGLES], (SpeedOrder: OrderPlate 3; 0 1 2 3), "The orders.";
    }
}

group! {
    /// How an end switch gives the scale its zero.
    HomeSettings => HomePlate {
        0 Choice direction => forwards = Direction::Backwards, (Direction: bool), "Which end switch homing goes to." at_once;
        1 Real velocity_mm_s => velocity = 10.0, (MillimetrePerS [1e-3, 8000.0]), "Table velocity on the way to it, at most the feed's." at_once;
        2 Real leaving_mm_s => leaving_velocity = 1.0, (MillimetrePerS [1e-3, 8000.0]), "Table velocity off it again: what the table moves in a millisecond is what its place is uncertain by." at_once;
        3 Real furthest_mm => furthest_m = 1000.0, (Millimetre [1e-2, 1e5]), "Furthest that the switch is looked for." at_once;
        4 Real position_mm => position_m = 0.0, (Millimetre [-1e5, 1e5]), "Position of the table where the switch closes as it is left." at_once;
    }
}

group! {
    /// The table's travel: homing to an end switch, and soft limits of the homed position.
    TravelSettings => TravelPlate {
        1 Part home => home = HomeSettings::DEFAULT, (HomeSettings: HomePlate "home_"), "How its place is found.";
        6 Real soft_least_mm => soft_least_m = 0.0, (Millimetre [-1e5, 1e5]), "Least homed position; as much as soft_most_mm: there are no soft limits." at_rest;
        7 Real soft_most_mm => soft_most_m = 0.0, (Millimetre [-1e5, 1e5]), "Most homed position." at_rest;
    }
}

group! {
    /// The brake that holds the table while the bridges are off.
    BrakeSettings => BrakePlate {
        1 Choice fitted => fitted = Switch::Off, (Switch: bool), "There is one, at the board's output for it.";
        2 Real closing_ms => closing_s = 50.0, (Millisecond [0.0, 5000.0]), "From when it is told until it holds: the motors hold as long." at_rest;
        3 Real opening_ms => opening_s = 100.0, (Millisecond [0.0, 5000.0]), "Until it has let go: the table begins to move after it." at_rest;
        4 Choice load_drives_back => load_drives_back = Switch::Off, (Switch: bool), "The load moves the table while nothing holds it: such an axis takes a brake.";
    }
}
