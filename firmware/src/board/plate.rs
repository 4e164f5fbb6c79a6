//! Plate data of the default drive: the paper's motors on the default board, screw first.
//!
//! Numbers only, no hardware: the emulator's tests build the same drive on the host from this very file.

use control::plate::{BoardPlate, DrivePlate, EncoderPlate, FeedPlate, MotorPlate, Tuning};
use control::sense::Shunts;

/// The motors of Table 1 (Wang et al. 2020) with 20-bit encoders.
const MOTOR: MotorPlate = MotorPlate {
    resistance_ohm: 1.7,
    inductance_h: 5.9e-3,
    pole_pairs: 5,
    flux_wb: 0.11,
    inertia_kg_m2: 7.2e-4,
    speed_max_rpm: 3000.0,
    // One and a half times the rated torque: 3 A of phase current, which leaves the comparators' 4.5 A room for a
    // step's overshoot.
    torque_max_nm: 2.0,
    current_gains: [1.0; 3],
    encoder: EncoderPlate {
        counts_per_turn: 1 << 20,
        theta_e_at_zero_turns: 0.0,
    },
};

/// The drive that the firmware is built for.
pub(crate) const PLATE: DrivePlate = DrivePlate {
    motors: [MOTOR; 2],
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
    },
    tuning: Tuning {
        damping: 0.7,
        current_rad_s: 3000.0,
        speed_rad_s: 200.0,
        observer_rad_s: 1000.0,
        observer_damping: 0.7,
    },
    feed: FeedPlate {
        lead_m: 5e-3,
        velocity_max: 0.1,
        acceleration_max: 0.25,
        jerk_max: 10.0,
        base_acceleration_max: 700.0,
        base_jerk_max: 20_000.0,
    },
};

/// One count of the table's linear scale, m: a quarter of the period of a scale that is interpolated to 40 nm.
pub(crate) const SCALE_COUNT_M: f64 = 10e-9;
