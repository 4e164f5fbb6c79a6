//! The paper's own linear theory: `S(s)` of Appendix A, and the ripple that it predicts.

use control::plate::Gains;
use plant::Axis;
use plant::model::{Model, MotorModel};
use rustfft::num_complex::Complex64;

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

/// Table velocities, m/s, that the torque harmonics of both motors cause by `S(s)` at table velocity `velocity`, m/s,
/// and nut speed `base`, mechanical rad/s: `seconds` long, `rate_hz` apart, the mean left out. A motor that stands
/// still has a constant torque error, which its integrator takes.
#[must_use]
pub fn ripple(
    model: &Model,
    gains: [Gains; 2],
    velocity: f64,
    base: f64,
    seconds: f64,
    rate_hz: f64,
) -> Vec<f64> {
    let r = model.feed.travel_per_radian();
    let speeds = [base + velocity / r, base];
    let mut lines = Vec::new();
    for axis in Axis::ALL {
        let (motor, speed) = (model.motor(axis), speeds[axis.index()]);
        let sensitivity = Sensitivity::new(motor, &gains[axis.index()]);
        let p = f64::from(motor.pole_pairs);
        let sign = if axis == Axis::Screw { 1.0 } else { -1.0 };
        for harmonic in motor.torque_harmonics.iter().filter(|_| speed != 0.0) {
            let omega = harmonic.order * p * speed;
            let torque =
                Complex64::from_polar(harmonic.amplitude_nm, harmonic.phase_rad * omega.signum());
            lines.push((
                omega.abs(),
                sensitivity.at(omega.abs()) * torque * (sign * r / p),
            ));
        }
    }
    let samples = (seconds * rate_hz) as usize;
    (0..samples)
        .map(|k| {
            let t = k as f64 / rate_hz;
            lines
                .iter()
                .map(|(omega, line)| (line * Complex64::cis(omega * t)).re)
                .sum()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::BoardConfig;
    use crate::plates::{PAPER_TUNING, plates};
    use crate::vrf::vrf_percent;
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
        let (omega, peak) = (50..1000)
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
            let vrf = vrf_percent(&ripple(&model, gains, 2.5e-3, base, 4.0, 1e4), 2.5e-3);
            assert!(
                (vrf - expected).abs() < 0.02,
                "{vrf} at {rpm} rpm, reference {expected}"
            );
        }
    }
}
