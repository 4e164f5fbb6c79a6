//! Plate data of the mains board: the paper's motors on other amplifiers and other encoders, screw first.
//!
//! Numbers only, no hardware: the emulator's tests build the same drive on the host from this very file.

use super::paper_machine;
use control::current::mt6835;
use control::current::sense::Shunts;
use control::plate::groups::{
    BridgeSettings, EncoderInterface, EncoderSettings, MotorSettings, ThermalSettings,
};
use control::plate::{BoardPlate, DrivePlate, Settings};
use control::watch::guard::GuardPlate;
use control::watch::scale_watch::ScaleWatchPlate;
use control::watch::thermometer::{Side, TemperaturePlate, Thermometer};

/// Shunts, ohm.
const SHUNT_OHM: f64 = 0.075;
/// From the shunt's 0 to the amplifier: 1 kohm to the shunt and 7 kohm to the supply lift the signal into its range, and take an
/// eighth of it.
const PASSED: f64 = 7.0 / 8.0;
/// Analog supply and reference, V.
const SUPPLY_V: f64 = 3.3;
/// Gain of the amplifiers.
const AMPLIFIER_GAIN: f64 = 4.0;
/// Counts of the ADCs and DACs.
const COUNTS: f64 = 4096.0;
/// How long before the top the sensor latches its angle, us: see the firmware's `hw::encoder::mt6835`.
pub(crate) const FRAME_LEAD_US: f64 = 5.5;

/// Peak phase current that the comparators stop a bridge at, A, and that of the analog watchdogs.
pub(crate) const OVER_CURRENT_A: f64 = 4.5;
pub(crate) const WATCH_CURRENT_A: f64 = 4.75;

/// The bus, V, and the dead time.
const BUS_V: f64 = 310.0;
const DEAD_TIME_NS: f64 = 800.0;
/// Capacitance of a switch of a leg. Assumed, as there is no such board: the most of 100 to 300 pF. Put yours in.
///
/// A current of `2 C V / t` turns a leg within the dead time `t`, and loses half of it; a smaller one loses as much less. Twice
/// that current is where the compensation is full: around zero it then gives what the leg loses, and no more.
const SWITCH_PF: f64 = 300.0;

/// The drive's own settings.
pub(crate) const SETTINGS: Settings = Settings {
    screw: MotorSettings {
        encoder: EncoderSettings {
            interface: EncoderInterface::Mt6835,
            counts_per_turn: mt6835::COUNTS_PER_TURN,
            age_us: FRAME_LEAD_US,
            ..EncoderSettings::DEFAULT
        },
        ..paper_machine::MOTOR
    },
    nut: MotorSettings {
        encoder: EncoderSettings {
            interface: EncoderInterface::IncrementalWithIndex,
            ..EncoderSettings::DEFAULT
        },
        ..paper_machine::MOTOR
    },
    bridge: BridgeSettings {
        over_current_a: WATCH_CURRENT_A,
        bus_min_v: 30.0,
        dead_time_ns: DEAD_TIME_NS,
        dead_time_fade_a: 4.0 * SWITCH_PF * BUS_V / DEAD_TIME_NS * 1e-3,
        min_on_time_us: 2.0,
        bootstrap_ms: 1.0,
        // Assumed, as there is no such board: two thirds of what the comparators let pass, heat sink of a module. Put yours in.
        thermal: ThermalSettings {
            rated_current_a_rms: 3.0,
            thermal_time_s: 20.0,
        },
        // Above the chopper's 370 V, below the guard's 390 V.
        brake_fade_from_v: 374.0,
        brake_fade_to_v: 386.0,
        ..BridgeSettings::DEFAULT
    },
    tuning: paper_machine::TUNING,
    alignment: paper_machine::ALIGNMENT,
    ..Settings::DEFAULT
};

/// The board.
const BOARD: BoardPlate = BoardPlate {
    timer_hz: 170e6,
    pwm_hz: 20e3,
    speed_divider: 4,
    shunts: Shunts::Three,
    // Negative: a current into the motor comes up from minus through the shunt and lowers its upper end (SimpleFOC issue 386: all
    // gains negative behind amplifiers that do not invert; ST's kit computes `Ia = offset - ADC`).
    amps_per_count: -SUPPLY_V / COUNTS / (SHUNT_OHM * PASSED * AMPLIFIER_GAIN),
    zero_counts: (1.0 - PASSED) * AMPLIFIER_GAIN * COUNTS,
    bus_volts_per_count: 0.11,
    adc_counts: 4096,
};

/// The drive that the firmware is built for.
pub(crate) const PLATE: DrivePlate = SETTINGS.plate(&BOARD);

/// A Pt1000 on each heat sink, to the reference over 2.2 kohm.
const HEAT_SINK: TemperaturePlate = TemperaturePlate {
    sensor: Thermometer::Platinum { r0_ohm: 1000.0 },
    side: Side::Ground,
    divider_ohm: 2.2e3,
    max_celsius: 85.0,
    min_celsius: -30.0,
};

/// What the board bears: a bus of 310 V from the mains.
pub(crate) const GUARDS: GuardPlate = GuardPlate {
    bus_max_v: 390.0,
    bus_min_v: 60.0,
    bus_volts_per_count: PLATE.board.bus_volts_per_count,
    adc_counts: PLATE.board.adc_counts,
    temperatures: [HEAT_SINK; 2],
    index: [false, true],
    scale: Some(ScaleWatchPlate::usual(
        PLATE.feed.scale_count_m,
        PLATE.feed.lead_m,
    )),
};
