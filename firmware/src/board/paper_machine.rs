//! The paper's machine: motors, tuning and feed, of which a board takes what is its own. Numbers only.

use control::encoder::Interface;
use control::plate::{AlignmentPlate, EncoderPlate, FeedPlate, MotorPlate, ThermalPlate, Tuning};

/// A phase's rms current to the vector's length.
pub(crate) const SQRT_3: f64 = 1.732_050_807_568_877_2;

/// The motors of Table 1 (Wang et al. 2020) with encoders of 10,000 lines: 2 MHz of counts at 3000 rpm, which RS-422 and a
/// timer's filter carry, as the 52 MHz of 20 bits they do not.
pub(crate) const MOTOR: MotorPlate = MotorPlate {
    resistance_ohm: 1.7,
    inductance_h: 5.9e-3,
    pole_pairs: 5,
    flux_wb: 0.11,
    inertia_kg_m2: 7.2e-4,
    speed_max_rpm: 3000.0,
    // One and a half times the rated torque: 3 A of phase current, which leaves the mains board's comparators room for a
    // step's overshoot.
    torque_max_nm: 2.0,
    // The rated torque of 1.3 N m. The time constant is assumed, a small servo motor's winding: put yours in.
    thermal: ThermalPlate {
        rated_rms_a: 1.3 / (5.0 * 0.11 * SQRT_3),
        seconds: 60.0,
    },
    current_gains: [1.0; 3],
    encoder: EncoderPlate {
        interface: Interface::Incremental,
        counts_per_turn: 40_000,
        age_s: 0.0,
        theta_e_at_zero_turns: 0.0,
        reversed: Some(false),
    },
};

/// Table 1's cutoffs, with an observer well above the speed loop.
pub(crate) const TUNING: Tuning = Tuning {
    damping: 0.7,
    current_rad_s: 3000.0,
    speed_rad_s: 200.0,
    observer_rad_s: 1000.0,
    observer_damping: 0.7,
};

/// A lead of 5 mm.
pub(crate) const FEED: FeedPlate = FeedPlate {
    lead_m: 5e-3,
    velocity_max: 0.1,
    acceleration_max: 0.25,
    jerk_max: 10.0,
    base_acceleration_max: 700.0,
    base_jerk_max: 20_000.0,
};

/// Three tenths of the rated torque of 1.3 N m, and a table that moves by less than 50 um.
#[allow(dead_code, reason = "one build of the firmware has one of the boards")]
pub(crate) const ALIGNMENT: AlignmentPlate = AlignmentPlate {
    torque_nm: [0.39; 2],
    travel_m: 50e-6,
    speed_rpm: 300.0,
};
