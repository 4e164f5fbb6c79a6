//! The axial resonance of the table on its screw, by how far the table stays behind the screw while it accelerates.
//!
//! A screw of the stiffness `k` drags a table of the mass `m` against friction, so the table stays behind what screw and nut say:
//!
//! ```text
//! table - lead (theta_screw - theta_nut) = origin + lead error(x) - (m a + c sign(v) + b v + load) / k
//! ```
//!
//! The coefficient of the acceleration is `-m / k`, which is one over the square of the resonance: no mass and no force is needed.
//! The nut's encoder is read half a PWM period after the screw's, so that the speed of both moves the difference, too. A lead error has
//! one and two periods a turn, and each encoder's eccentricity one a turn of its shaft. The slow passes of the common mode show it over the same travel without an acceleration. Where the travel
//! is too short a part of a turn to tell the periods apart, the lead error is a cubic.

use crate::fit::{Estimate, Fit};
use std::f64::consts::TAU;

/// Both encoders' eccentricities, time between both readings, friction's sign, speed, acceleration.
const MOTION: usize = 8;
/// Origin, and the lead error: its scale with four parts of periods, or a cubic.
const PERIODS: usize = 6;
const CUBIC: usize = 4;

/// Largest part of its value that half of the interval of `m / k` may be. A play that the table crosses as it brakes looks like a soft
/// screw, with an interval of a sixth and more. Of 188 drawn machines 138 are clear, and the worst resonance is 4.7 % off.
const CLEAR: f64 = 0.08;

/// Where the table was, over a window.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Behind {
    /// Table less what screw and nut say, m.
    pub(crate) table_m: f64,
    /// What they say, m.
    pub(crate) travel_m: f64,
    /// Sine and cosine of the encoders' angles: screw, nut.
    pub(crate) turns: [f64; 4],
    /// Speed of both motors together, through the lead, m/s.
    pub(crate) together: f64,
    /// 1 forwards, -1 backwards.
    pub(crate) sign: f64,
    /// Speed, m/s.
    pub(crate) speed: f64,
    /// Acceleration, and the commanded, m/s^2.
    pub(crate) acceleration: f64,
    /// See `acceleration`.
    pub(crate) commanded: f64,
}

/// The fits of all windows.
pub(crate) struct AxialFit {
    periods: Fit,
    cubic: Fit,
    lead_m: f64,
}

impl AxialFit {
    /// Of a screw of so much travel a turn, and windows of which `share` have one independent error.
    pub(crate) fn new(lead_m: f64, share: f64) -> Self {
        Self {
            periods: Fit::new(PERIODS + MOTION, share),
            cubic: Fit::new(CUBIC + MOTION, share),
            lead_m,
        }
    }

    /// One more window.
    pub(crate) fn add(&mut self, at: &Behind) {
        let x = at.travel_m;
        let [(sin, cos), (sin_2, cos_2)] =
            [1.0, 2.0].map(|order| (order * TAU * x / self.lead_m).sin_cos());
        let periods = [1.0, x, sin, cos, sin_2, cos_2];
        let cubic = [1.0, x, x * x, x.powi(3)];
        let row = |lead: &[f64], acceleration| {
            let motion = [at.together, at.sign, at.speed, acceleration];
            [lead, &at.turns, &motion].concat()
        };
        for (fit, lead) in [
            (&mut self.periods, periods.as_slice()),
            (&mut self.cubic, &cubic),
        ] {
            let (instruments, row) = (row(lead, at.commanded), row(lead, at.acceleration));
            fit.add_with(&instruments, &row, at.table_m);
        }
    }

    /// The resonance, Hz; `None` where the screw is too stiff for the scale, or the table was not accelerated.
    pub(crate) fn resonance_hz(&self) -> Option<Estimate> {
        let solved = self.periods.solve().or_else(|| self.cubic.solve())?;
        let behind = *solved.last()?;
        let (square, plus_minus) = (-behind.value, behind.plus_minus);
        if square <= 0.0 || plus_minus > CLEAR * square {
            return None;
        }
        let hz = square.sqrt().recip() / TAU;
        Some(Estimate {
            value: hz,
            plus_minus: 0.5 * hz * plus_minus / square,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Windows of a table that goes slowly over its travel, and to and fro, on a screw of `hz` with a lead error of 5 um.
    fn windows(hz: f64) -> AxialFit {
        let mut fit = AxialFit::new(16e-3, 1.0);
        for k in 0..400 {
            let phase = f64::from(k) * 0.1;
            let slow = k < 200;
            let (amplitude, rate) = if slow { (3e-3, 0.1) } else { (1.5e-3, 20.0) };
            let x = amplitude * phase.sin();
            let speed = amplitude * rate * phase.cos();
            let acceleration = -rate * rate * x;
            let error = 5e-6 * (TAU * x / 16e-3).sin();
            let noise = 5e-8 * ((f64::from(k) * 0.618_033_988_75).fract() - 0.5);
            fit.add(&Behind {
                table_m: 3e-4 + error + noise
                    - acceleration / (TAU * hz).powi(2)
                    - 2e-6 * speed.signum(),
                travel_m: x,
                turns: [1.0, 1.7, 2.3, 3.1].map(|rate| (rate * f64::from(k)).sin()),
                together: if k % 20 < 10 { 0.5 } else { -0.5 },
                sign: speed.signum(),
                speed,
                acceleration,
                commanded: acceleration,
            });
        }
        fit
    }

    #[test]
    fn the_resonance_of_a_soft_screw_is_found_beside_a_lead_error() {
        for hz in [30.0, 80.0, 200.0] {
            let found = windows(hz).resonance_hz().unwrap();
            let error = (found.value - hz).abs();
            assert!(
                error < found.plus_minus && error < 0.1 * hz,
                "{found:?}, expected {hz}"
            );
        }
    }

    #[test]
    fn a_screw_that_is_too_stiff_for_the_scale_has_no_resonance() {
        assert_eq!(windows(20_000.0).resonance_hz(), None);
    }
}
