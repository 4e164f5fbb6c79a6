//! Plate data of the mains board: the paper's motors on other amplifiers and other encoders, screw first.
//!
//! Numbers only, no hardware: the emulator's tests build the same drive on the host from this very file.

use super::paper_machine;
use control::encoder::Interface;
use control::guard::GuardPlate;
use control::mt6835;
use control::plate::{
    BasePlate, BoardPlate, BrakePlate, CompensationPlate, DrivePlate, EncoderPlate, FrictionPlate,
    MotorPlate, RejectionPlate, RunawayPlate, ThermalPlate, TravelPlate,
};
use control::scale_watch::ScaleWatchPlate;
use control::sense::Shunts;
use control::thermometer::{Side, TemperaturePlate, Thermometer};

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
/// How long before the top the sensor latches its angle: see the firmware's `hw::encoder::mt6835`.
pub(crate) const FRAME_LEAD_S: f64 = 5.5e-6;

/// Peak phase current that the comparators stop a bridge at, A, and that of the analog watchdogs.
pub(crate) const OVER_CURRENT_A: f64 = 4.5;
pub(crate) const WATCH_CURRENT_A: f64 = 4.75;

/// The drive that the firmware is built for.
pub(crate) const PLATE: DrivePlate = DrivePlate {
    motors: [
        MotorPlate {
            encoder: EncoderPlate {
                interface: Interface::Mt6835,
                counts_per_turn: mt6835::COUNTS_PER_TURN,
                age_s: FRAME_LEAD_S,
                theta_e_at_zero_turns: 0.0,
                reversed: Some(false),
            },
            ..paper_machine::MOTOR
        },
        MotorPlate {
            encoder: EncoderPlate {
                interface: Interface::IncrementalWithIndex,
                ..paper_machine::MOTOR.encoder
            },
            ..paper_machine::MOTOR
        },
    ],
    board: BoardPlate {
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
        over_current_a: WATCH_CURRENT_A,
        bus_min_v: 30.0,
        dead_time_s: 800e-9,
        dead_time_fade_a: 0.05,
        measure_zeros: true,
        min_on_time_s: 2e-6,
        bootstrap_s: 1e-3,
        // Assumed, as there is no such board: two thirds of what the comparators let pass, heat sink of a module. Put yours in.
        thermal: ThermalPlate {
            rated_rms_a: 3.0,
            seconds: 20.0,
        },
        // Above the chopper's 370 V, below the guard's 390 V.
        regeneration_v: [374.0, 386.0],
    },
    tuning: paper_machine::TUNING,
    feed: paper_machine::FEED,
    travel: TravelPlate::UNLIMITED,
    brake: BrakePlate::NONE,
    alignment: paper_machine::ALIGNMENT,
    runaway: RunawayPlate::USUAL,
    compensation: CompensationPlate::NONE,
    friction: FrictionPlate::NONE,
    rejection: RejectionPlate::NONE,
    base: BasePlate::NONE,
    heartbeat_s: 0.5,
};

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
    scale: Some(ScaleWatchPlate::usual(SCALE_COUNT_M, PLATE.feed.lead_m)),
};

/// One count of the table's linear scale, m.
pub(crate) const SCALE_COUNT_M: f64 = 10e-9;
