//! Plate data of the default drive: two Teknic Hudson M-2331P on two BOOSTXL-DRV8323RH, screw first.
//!
//! Numbers only, no hardware: the emulator's tests build the same drive on the host from this very file. A number in
//! brackets is a source on the board's wiring page, `firmware/boards/nucleo_g474re.md`, which says more of each.

use super::paper_machine;
use control::encoder::Interface;
use control::guard::GuardPlate;
use control::plate::{
    AlignmentPlate, BasePlate, BoardPlate, BrakePlate, CompensationPlate, DrivePlate, EncoderPlate,
    FrictionPlate, MotorPlate, RejectionPlate, RunawayPlate, ThermalPlate, TravelPlate,
};
use control::scale_watch::ScaleWatchPlate;
use control::sense::Shunts;
use control::thermometer::{Side, TemperaturePlate, Thermometer};
use core::f64::consts::{SQRT_2, TAU};

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

/// Of two phases to each other, as the motor's manual gives them \[7\]: ohm, H, and peak V of the induced voltage for each
/// rad/s.
const LINE_OHM: f64 = 0.61;
const LINE_H: f64 = 0.89e-3;
const LINE_V_S: f64 = 13.65 / (1000.0 * TAU / 60.0);
const POLE_PAIRS: u32 = 4;
/// Continuous torque \[7\], N m: 145 oz in.
const RATED_NM: f64 = 145.0 * 7.061_551_8e-3;

/// Hudson M-2331P-LN-16D with its own encoder \[7\].
const MOTOR: MotorPlate = MotorPlate {
    resistance_ohm: LINE_OHM / 2.0,
    inductance_h: LINE_H / 2.0,
    pole_pairs: POLE_PAIRS,
    // A phase's peak is sqrt(3) below the line's, and the power-invariant flux sqrt(3/2) above it.
    flux_wb: LINE_V_S / (POLE_PAIRS as f64 * SQRT_2),
    // Assumed: rotor, coupling, a screw of 16 mm by 500 mm and its share of a table of 20 kg. Put yours in.
    inertia_kg_m2: 1.0e-4,
    // What 48 V reach with full torque; 24 V reach about half of it.
    speed_max_rpm: 2500.0,
    torque_max_nm: 1.5 * RATED_NM,
    // The manual rates the case, not the winding [7]: a time constant of a minute is assumed, a small servo's winding.
    thermal: ThermalPlate {
        rated_rms_a: RATED_NM * SQRT_2 / (LINE_V_S * paper_machine::SQRT_3),
        seconds: 60.0,
    },
    current_gains: [1.0; 3],
    encoder: EncoderPlate {
        interface: Interface::Incremental,
        counts_per_turn: 16_000,
        ..paper_machine::MOTOR.encoder
    },
};

/// The drive that the firmware is built for.
#[allow(dead_code, reason = "one build of the firmware has one of the two")]
pub(crate) const PLATE: DrivePlate = DrivePlate {
    motors: [MOTOR; 2],
    board: BoardPlate {
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
        over_current_a: WATCH_CURRENT_A,
        bus_min_v: 8.0,
        // The driver's own 100 ns begin when a gate has fallen; these, when the timer says so.
        dead_time_s: 500e-9,
        dead_time_fade_a: 0.2,
        measure_zeros: true,
        // Half of it is before the sample: dead time, the driver's delay, the amplifier's 300 ns and its filter.
        min_on_time_s: 4e-6,
        // A charge pump feeds the high sides.
        bootstrap_s: 0.0,
        // 15 A rms [5]; the board's time constant is assumed.
        thermal: ThermalPlate {
            rated_rms_a: 15.0,
            seconds: 20.0,
        },
        // Above a shunt regulator's 50 V, below the guard's 52 V.
        regeneration_v: [50.4, 51.6],
    },
    tuning: paper_machine::TUNING,
    feed: paper_machine::FEED,
    travel: TravelPlate::UNLIMITED,
    brake: BrakePlate::NONE,
    alignment: AlignmentPlate {
        torque_nm: [0.3 * RATED_NM; 2],
        travel_m: 50e-6,
        speed_rpm: MOTOR.speed_max_rpm / 10.0,
    },
    runaway: RunawayPlate::USUAL,
    compensation: CompensationPlate::NONE,
    friction: FrictionPlate::NONE,
    rejection: RejectionPlate::NONE,
    base: BasePlate::NONE,
    heartbeat_s: 0.5,
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
    scale: Some(ScaleWatchPlate::usual(SCALE_COUNT_M, PLATE.feed.lead_m)),
};

/// One count of the table's linear scale, m \[10\].
pub(crate) const SCALE_COUNT_M: f64 = 100e-9;
