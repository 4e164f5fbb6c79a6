//! Plate data of the default drive: the paper's motors on the default board, screw first.
//!
//! Numbers only, no hardware: the emulator's tests build the same drive on the host from this very file.

use super::machine;
use control::guard::GuardPlate;
use control::plate::{BoardPlate, DrivePlate};
use control::sense::Shunts;
use control::thermometer::{Side, TemperaturePlate, Thermometer};

/// The drive that the firmware is built for.
#[allow(dead_code, reason = "one build of the firmware has one of the two")]
pub(crate) const PLATE: DrivePlate = DrivePlate {
    motors: [machine::MOTOR; 2],
    board: BoardPlate {
        timer_hz: 170e6,
        pwm_hz: 20e3,
        speed_divider: 4,
        shunts: Shunts::Two,
        amps_per_count: 10.0 / 4096.0,
        zero_counts: 2048.0,
        bus_volts_per_count: 0.11,
        adc_counts: 4096,
        bus_min_v: 30.0,
        dead_time_s: 1e-6,
        dead_time_fade_a: 0.05,
        measure_zeros: true,
        min_on_time_s: 2e-6,
        bootstrap_s: 1e-3,
    },
    tuning: machine::TUNING,
    feed: machine::FEED,
};

/// The same with its bridges at 40 kHz: the feature `pwm-40khz`. The speed task keeps its 5 kHz.
#[allow(dead_code, reason = "one build of the firmware has one of the two")]
pub(crate) const PLATE_40_KHZ: DrivePlate = DrivePlate {
    board: BoardPlate {
        pwm_hz: 40e3,
        speed_divider: 8,
        ..PLATE.board
    },
    ..PLATE
};

/// The power stages' own sensor: 10 kohm NTC to ground, 4.7 kohm to the reference.
const HEAT_SINK: TemperaturePlate = TemperaturePlate {
    sensor: Thermometer::Ntc {
        r25_ohm: 10e3,
        beta_k: 3977.0,
    },
    side: Side::Ground,
    divider_ohm: 4.7e3,
    max_celsius: 90.0,
    min_celsius: -30.0,
};

/// What the board bears: a bus of 310 V from the mains.
pub(crate) const GUARDS: GuardPlate = GuardPlate {
    bus_max_v: 400.0,
    bus_min_v: 60.0,
    bus_volts_per_count: PLATE.board.bus_volts_per_count,
    adc_counts: PLATE.board.adc_counts,
    temperatures: [HEAT_SINK; 2],
    index: [false, false],
};

/// One count of the table's linear scale, m: a quarter of the period of a scale that is interpolated to 40 nm.
pub(crate) const SCALE_COUNT_M: f64 = 10e-9;
