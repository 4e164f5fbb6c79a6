//! The paper's own linear theory: `S(s)` of Appendix A, and the ripple that it predicts.

use control::plate::Gains;
use fft::Complex64;
use plant::Axis;
use plant::model::{Model, MotorModel};

/// The sensitivity function `S(s)` of one motor: electrical speed per torque, rad/s per N m (Eqs A2, A4, A5).
#[derive(Clone, Copy, Debug)]
pub struct Sensitivity {
    /// Numerator's coefficients of s, s^2, s^3.
    numerator: [f64; 3],
    /// Denominator's coefficients of 1 to s^4.
    denominator: [f64; 5],
}

impl Sensitivity {
    /// `S(s)` of `motor` under the gains of Eqs 9 to 12.
    #[must_use]
    pub fn new(motor: &MotorModel, gains: &Gains) -> Self {
        let (l, r, j, b) = (
            motor.inductance_h,
            motor.resistance_ohm,
            motor.inertia_kg_m2,
            motor.viscous_nm_s,
        );
        let p = f64::from(motor.pole_pairs);
        let flux = motor.flux_wb * p * p;
        let Gains {
            k_pc,
            k_ic,
            k_pw,
            k_iw,
        } = *gains;
        Self {
            numerator: [k_ic * p, (k_pc + r) * p, l * p],
            denominator: [
                k_ic * k_iw * flux,
                b * k_ic + (k_ic * k_pw + k_iw * k_pc) * flux,
                k_pc * k_pw * flux + b * (k_pc + r) + j * k_ic,
                b * l + j * (k_pc + r),
                j * l,
            ],
        }
    }

    /// `S(j*omega)` at `omega` rad/s.
    #[must_use]
    pub fn at(&self, omega: f64) -> Complex64 {
        let s = Complex64::new(0.0, omega);
        let polynomial = |c: &[f64]| c.iter().rev().fold(Complex64::ZERO, |sum, &c| sum * s + c);
        s * polynomial(&self.numerator) / polynomial(&self.denominator)
    }
}

/// Velocity ripple factor (Eq 19), %, that the torque harmonics of both motors cause by `S(s)` at table velocity
/// `velocity`, m/s, and nut speed `base`, mechanical rad/s.
///
/// The two motors' ripples beat, and a record that holds a beat shows about the sum of their peak-to-peak values: that
/// sum is given. A motor that stands still has a constant torque error, which its integrator takes.
#[must_use]
pub fn ripple_percent(model: &Model, gains: &[Gains; 2], velocity: f64, base: f64) -> f64 {
    let r = model.feed.travel_per_radian();
    let speeds = [base + velocity / r, base];
    let sum: f64 = Axis::ALL
        .iter()
        .map(|&axis| {
            speed_ripple(
                model.motor(axis),
                &gains[axis.index()],
                speeds[axis.index()],
            )
        })
        .sum();
    100.0 * r * sum / velocity.abs()
}

/// Peak-to-peak mechanical speed, rad/s, of one motor that turns at `speed`, mechanical rad/s.
fn speed_ripple(motor: &MotorModel, gains: &Gains, speed: f64) -> f64 {
    const SAMPLES_A_TURN: usize = 4096;
    if speed == 0.0 {
        return 0.0;
    }
    let p = f64::from(motor.pole_pairs);
    let sensitivity = Sensitivity::new(motor, gains);
    let lines: Vec<(f64, Complex64)> = motor
        .torque_harmonics
        .iter()
        .map(|harmonic| {
            let torque =
                Complex64::from_polar(harmonic.amplitude_nm, harmonic.phase_rad * speed.signum());
            (
                harmonic.order,
                sensitivity.at((harmonic.order * p * speed).abs()) * torque / p,
            )
        })
        .collect();
    // Whole orders repeat with the electrical turn; others are given some turns to meet.
    let turns = if lines.iter().all(|(order, _)| order.fract() == 0.0) {
        1
    } else {
        16
    };
    let (low, high) = (0..turns * SAMPLES_A_TURN)
        .map(|k| std::f64::consts::TAU * k as f64 / SAMPLES_A_TURN as f64)
        .map(|theta_e| {
            lines
                .iter()
                .map(|(order, line)| (line * Complex64::cis(order * theta_e)).re)
                .sum::<f64>()
        })
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        });
    if lines.is_empty() { 0.0 } else { high - low }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::BoardConfig;
    use crate::plates::{PAPER_TUNING, plates};
    use plant::machine::Coupling;

    fn paper() -> (Model, [Gains; 2]) {
        let model = Model::paper();
        let plate = plates(
            &model,
            Coupling::Lumped,
            &BoardConfig::default(),
            PAPER_TUNING,
        );
        let gains = plate.motors.map(|motor| motor.gains(&PAPER_TUNING));
        (model, gains)
    }

    #[test]
    fn peaks_where_the_reference_peaks() {
        let (model, gains) = paper();
        let s = Sensitivity::new(&model.screw, &gains[0]);
        let (omega, peak) = (50i32..1000)
            .map(|w| (w, s.at(f64::from(w)).norm()))
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap();
        assert!(
            (peak - 24.6).abs() < 0.05 && (omega - 201).abs() <= 1,
            "{peak} at {omega}"
        );
    }

    #[test]
    fn ripple_is_that_of_the_reference() {
        let (model, gains) = paper();
        for (rpm, expected) in [(0.0, 20.75), (300.0, 14.87), (500.0, 9.30), (800.0, 6.02)] {
            let base = rpm * std::f64::consts::TAU / 60.0;
            let vrf = ripple_percent(&model, &gains, 2.5e-3, base);
            assert!(
                (vrf - expected).abs() < 0.01,
                "{vrf} at {rpm} rpm, reference {expected}"
            );
        }
    }
}
