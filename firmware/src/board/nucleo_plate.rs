//! Plate data of the default drive: two Teknic Hudson M-2331P on two BOOSTXL-DRV8323RH, screw first.
//!
//! Numbers only, no hardware: the emulator's tests build the same drive on the host from this very file. A number in
//! brackets is a source on the board's wiring page, `firmware/boards/nucleo_g474re.md`, which says more of each.

use super::paper_machine;
use control::current::sense::Shunts;
use control::plate::groups::{
    AlignmentSettings, BridgeSettings, EncoderSettings, FeedSettings, MotorSettings,
    ThermalSettings,
};
use control::plate::parameter::PER_KRPM;
use control::plate::{BoardPlate, DrivePlate, Settings};
use control::watch::guard::GuardPlate;
use control::watch::scale_watch::ScaleWatchPlate;
use control::watch::thermometer::{Side, TemperaturePlate, Thermometer};
use core::f64::consts::SQRT_2;

/// Reference of the ADCs, V.
const SUPPLY_V: f64 = 3.3;
/// Counts of the ADCs and DACs.
const COUNTS: f64 = 4096.0;

/// The power stages' shunts, ohm [4, 5], and the gain of their amplifiers, set by R22 [4, 5].
const SHUNT_OHM: f64 = 0.007;
const AMPLIFIER_GAIN: f64 = 10.0;
/// Their bus divider, ohm [4, 5].
const DIVIDER_OHM: [f64; 2] = [82e3, 4.99e3];

/// Peak phase current that the comparators stop a bridge at, A. The amplifiers are linear up to 20 A \[2\], the stage bears
/// 15 A rms \[5\], and one and a half times the motors' torque takes 13.6 A.
pub(crate) const OVER_CURRENT_A: f64 = 18.0;
/// The same of the analog watchdogs, which see both signs.
pub(crate) const WATCH_CURRENT_A: f64 = 19.0;

/// Of two phases to each other, as the motor's manual gives them \[7\]: peak V of the induced voltage at 1000 rpm.
const LINE_V_PEAK_PER_KRPM: f64 = 13.65;
/// Continuous torque \[7\], N m: 145 oz in.
const RATED_NM: f64 = 145.0 * 7.061_551_8e-3;

/// Hudson M-2331P-LN-16D with its own encoder \[7\].
const MOTOR: MotorSettings = MotorSettings {
    resistance_line_to_line_ohm: 0.61,
    inductance_line_to_line_mh: 0.89,
    pole_pairs: 4,
    voltage_constant_v_rms_per_krpm: LINE_V_PEAK_PER_KRPM / SQRT_2,
    // Assumed: rotor, coupling, a screw of 16 mm by 500 mm and its share of a table of 20 kg. Put yours in.
    inertia_kg_cm2: 1.0,
    // What 48 V reach with full torque; 24 V reach about half of it.
    speed_max_rpm: 2500.0,
    torque_max_nm: 1.5 * RATED_NM,
    // The manual rates the case, not the winding [7]: a time constant of a minute is assumed, a small servo's winding.
    thermal: ThermalSettings {
        rated_current_a_rms: RATED_NM * SQRT_2 * PER_KRPM
            / (LINE_V_PEAK_PER_KRPM * paper_machine::SQRT_3),
        thermal_time_s: 60.0,
    },
    alignment_torque_nm: 0.3 * RATED_NM,
    encoder: EncoderSettings {
        counts_per_turn: 16_000,
        ..EncoderSettings::DEFAULT
    },
    ..MotorSettings::DEFAULT
};

/// The bus, V, at which the dead time's compensation fits best, and the dead time.
const BUS_V: f64 = 36.0;
const DEAD_TIME_NS: f64 = 500.0;
/// Output charge of a switch over its voltage, pF: 83 nC at 30 V. These are the figures of TI's CSD18540Q5B (60 V, 1.8 mohm; ZHCSCO6B),
/// as the data sheet of the stages' CSD88599Q5DC (60 V, 1.7 mohm) was not at hand. Put yours in.
const SWITCH_PF: f64 = 83e3 / 30.0;

/// The drive's own settings.
pub(crate) const SETTINGS: Settings = Settings {
    screw: MOTOR,
    nut: MOTOR,
    bridge: BridgeSettings {
        over_current_a: WATCH_CURRENT_A,
        bus_min_v: 8.0,
        // The driver's own 100 ns begin when a gate has fallen; these, when the timer reports it.
        dead_time_ns: DEAD_TIME_NS,
        // Twice the current that turns a leg within the dead time: see the mains board's plate.
        dead_time_fade_a: 4.0 * SWITCH_PF * BUS_V / DEAD_TIME_NS * 1e-3,
        // Half of it is before the sample: dead time, the driver's delay, the amplifier's 300 ns and its filter.
        min_on_time_us: 4.0,
        // A charge pump feeds the high sides.
        bootstrap_ms: 0.0,
        // 15 A rms [5]; the board's time constant is assumed.
        thermal: ThermalSettings {
            rated_current_a_rms: 15.0,
            thermal_time_s: 20.0,
        },
        // Above a shunt regulator's 50 V, below the guard's 52 V.
        brake_fade_from_v: 50.4,
        brake_fade_to_v: 51.6,
        ..BridgeSettings::DEFAULT
    },
    // The scale's count [10].
    feed: FeedSettings {
        scale_count_nm: 100.0,
        ..FeedSettings::DEFAULT
    },
    alignment: AlignmentSettings {
        speed_rpm: MOTOR.speed_max_rpm / 10.0,
        ..AlignmentSettings::DEFAULT
    },
    tuning: paper_machine::TUNING,
    ..Settings::DEFAULT
};

/// The board.
const BOARD: BoardPlate = BoardPlate {
    timer_hz: 170e6,
    pwm_hz: 20e3,
    speed_divider: 4,
    shunts: Shunts::Three,
    // Positive: a current into the motor comes up from ground through the shunt, and raises the output [3].
    amps_per_count: SUPPLY_V / COUNTS / (SHUNT_OHM * AMPLIFIER_GAIN),
    // Half of the power stage's own supply [2].
    zero_counts: COUNTS / 2.0,
    bus_volts_per_count: SUPPLY_V / COUNTS * (DIVIDER_OHM[0] + DIVIDER_OHM[1]) / DIVIDER_OHM[1],
    adc_counts: 4096,
};

/// The drive that the firmware is built for.
#[allow(dead_code, reason = "one build of the firmware has one of the two")]
pub(crate) const PLATE: DrivePlate = SETTINGS.plate(&BOARD);

/// The same with its bridges at 40 kHz: the feature `pwm-40khz`. The speed task keeps its 5 kHz.
#[allow(dead_code, reason = "one build of the firmware has one of the two")]
pub(crate) const PLATE_40_KHZ: DrivePlate = SETTINGS.plate(&BoardPlate {
    pwm_hz: 40e3,
    speed_divider: 8,
    ..BOARD
});

/// TDK B57703M0103A017 (EPCOS B57703M: B25/100 3988 K) beside each stage's switches: to ground, 4.7 kohm to the reference.
const HEAT_SINK: TemperaturePlate = TemperaturePlate {
    sensor: Thermometer::Ntc {
        r25_ohm: 10e3,
        beta_k: 3988.0,
    },
    side: Side::Ground,
    divider_ohm: 4.7e3,
    max_celsius: 80.0,
    min_celsius: -30.0,
};

/// What the board bears. TI's own software stops these stages at 54.5 V \[4\], 54 V is their limit \[5\]; the switches end at
/// 60 V. Below 18 V a 24 V supply is in its current limit.
pub(crate) const GUARDS: GuardPlate = GuardPlate {
    bus_max_v: 52.0,
    bus_min_v: 18.0,
    bus_volts_per_count: PLATE.board.bus_volts_per_count,
    adc_counts: PLATE.board.adc_counts,
    temperatures: [HEAT_SINK; 2],
    index: [false, false],
    scale: Some(ScaleWatchPlate::usual(
        PLATE.feed.scale_count_m,
        PLATE.feed.lead_m,
    )),
};
