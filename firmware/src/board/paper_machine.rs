//! The paper's machine (Wang et al. 2020, Table 1), of which a board takes what is its own: see `Settings::DEFAULT`.

use control::plate::groups::{AlignmentSettings, MotorSettings, ThermalSettings, TuningSettings};

/// A phase's rms current to the vector's length.
pub(crate) const SQRT_3: f64 = 1.732_050_807_568_877_2;

/// The motors with encoders of 10,000 lines: 2 MHz of counts at 3000 rpm, which RS-422 and a timer's filter carry, as the 52 MHz
/// of 20 bits they do not. The largest torque is one and a half times the rated one: 3 A of phase current, which leaves the mains
/// board's comparators room for a step's overshoot.
#[allow(dead_code, reason = "one build of the firmware has one of the boards")]
pub(crate) const MOTOR: MotorSettings = MotorSettings {
    // The rated torque of 1.3 N m. The time constant is assumed, a small servo motor's winding: put yours in.
    thermal: ThermalSettings {
        rated_current_a_rms: 1.3 / (5.0 * 0.11 * SQRT_3),
        ..ThermalSettings::DEFAULT
    },
    ..MotorSettings::DEFAULT
};

/// Table 1's cutoffs, with an observer well above the speed loop.
pub(crate) const TUNING: TuningSettings = TuningSettings {
    observer_damping: 0.7,
    ..TuningSettings::DEFAULT
};

/// A table that moves by less than 50 um.
#[allow(dead_code, reason = "one build of the firmware has one of the boards")]
pub(crate) const ALIGNMENT: AlignmentSettings = AlignmentSettings {
    speed_rpm: 300.0,
    ..AlignmentSettings::DEFAULT
};
