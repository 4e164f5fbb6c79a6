//! The gains of Eqs 9 to 12 that follow from the loops' tuning and a motor's plate.

use super::{MotorPlate, Tuning};

/// Gains by Eqs 9 to 12, in the paper's units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Eq 9, V/A.
    pub k_pc: f64,
    /// Eq 10, V/(A s).
    pub k_ic: f64,
    /// Eq 11, A per electrical rad/s.
    pub k_pw: f64,
    /// Eq 12, A per electrical rad.
    pub k_iw: f64,
}

impl MotorPlate {
    /// Eqs 9 to 12 for this motor.
    #[must_use]
    pub const fn gains(&self, tuning: &Tuning) -> Gains {
        let Tuning {
            damping,
            current_rad_s: w_c,
            speed_rad_s: w_w,
            ..
        } = *tuning;
        let torque_per_speed =
            self.inertia_kg_m2 / (self.pole_pairs as f64 * self.pole_pairs as f64 * self.flux_wb);
        Gains {
            k_pc: 2.0 * damping * self.inductance_h * w_c - self.resistance_ohm,
            k_ic: self.inductance_h * w_c * w_c,
            k_pw: 2.0 * damping * w_w * torque_per_speed,
            k_iw: w_w * w_w * torque_per_speed,
        }
    }
}
