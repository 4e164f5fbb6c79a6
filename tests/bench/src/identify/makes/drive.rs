//! A drive with field-oriented control and a logger, by textbook gains.

use super::motor::{Motor, State};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;
use std::fmt::Write;

/// Steps of the motor in a control period.
const STEPS: usize = 5;
/// Bandwidths of the speed loop and of its observer, Hz.
const SPEED_HZ: f64 = 12.0;
const OBSERVER_HZ: f64 = 120.0;

/// In what frame a logger has the voltages.
#[derive(Debug, Clone, Copy)]
pub(super) enum Log {
    /// `ud_v`, `uq_v` of the control.
    Rotor,
    /// `ualpha_v`, `ubeta_v` as they were output.
    Stator,
    /// `ua_v`, `ub_v`, `uc_v` as they were output.
    Phases,
}

/// See the module.
#[derive(Debug)]
pub(super) struct Drive {
    pub(super) control_hz: f64,
    /// Control periods between two rows.
    pub(super) every: usize,
    pub(super) current_hz: f64,
    /// Of the encoder, a turn.
    pub(super) counts: f64,
    pub(super) noise_a: f64,
    pub(super) lsb_a: f64,
    /// Error of the encoder's zero, electrical radians.
    pub(super) zero: f64,
    pub(super) log: Log,
    /// Whether d-q and alpha-beta values have the amplitude of a phase.
    pub(super) amplitude: bool,
}

fn turned([x, y]: [f64; 2], angle: f64) -> [f64; 2] {
    let (sin, cos) = angle.sin_cos();
    [x * cos - y * sin, x * sin + y * cos]
}

/// Phases a, b and c of a vector in the stator's frame.
fn phases([alpha, beta]: [f64; 2]) -> [f64; 3] {
    let scale = (2.0_f64 / 3.0).sqrt();
    let across = 3.0_f64.sqrt() / 2.0 * beta;
    [
        scale * alpha,
        scale * (across - 0.5 * alpha),
        scale * (-across - 0.5 * alpha),
    ]
}

impl Drive {
    /// A run through speeds, each held so long, as text with commas.
    pub(super) fn record(
        &self,
        rng: &mut impl Rng,
        motor: &Motor,
        speeds: &[f64],
        hold_s: f64,
    ) -> String {
        let period = 1.0 / self.control_hz;
        let lsb = TAU / self.counts;
        let scale = if self.amplitude {
            (2.0_f64 / 3.0).sqrt()
        } else {
            1.0
        };
        let names = match self.log {
            Log::Rotor => "ud_v,uq_v",
            Log::Stator => "ualpha_v,ubeta_v",
            Log::Phases => "ua_v,ub_v,uc_v",
        };
        let mut text = format!("t_s,angle_rad,ia_a,ib_a,{names},speed_ref_rad_s\n");
        let torque_per_a = motor.pole_pairs * motor.flux;
        let ramp =
            (6.0 * motor.top_speed()).min(0.5 * motor.rated_a() * torque_per_a / motor.inertia);
        let [current, speed, observer] =
            [self.current_hz, SPEED_HZ, OBSERVER_HZ].map(|hz| TAU * hz);
        let mut state = State::default();
        let (mut seen, mut seen_speed) = (0.0, 0.0);
        let (mut asked, mut sum_speed) = (0.0, 0.0);
        let mut sums = [0.0; 2];
        let mut computed = [0.0; 2];
        let (mut logged, mut stator) = ([0.0; 2], [0.0; 2]);
        let rows = (speeds.len() as f64 * hold_s * self.control_hz) as usize;
        for row in 0..rows {
            // Samples at the start of the period.
            let angle = (state.angle / lsb).round() * lsb + self.zero / motor.pole_pairs;
            let true_angle = motor.pole_pairs * state.angle;
            let mut read = phases(turned([state.d, state.q], true_angle));
            for phase in &mut read[..2] {
                let noise: f64 = StandardNormal.sample(rng);
                *phase = ((*phase + self.noise_a * noise) / self.lsb_a).round() * self.lsb_a;
            }
            let [a, b, _] = read;
            let vector = [1.5_f64.sqrt() * a, (a + 2.0 * b) * 0.5_f64.sqrt()];
            let [d, q] = turned(vector, -motor.pole_pairs * angle);
            if row % self.every == 0 {
                let _ = write!(text, "{:.7},{angle:.9},{a:.6},{b:.6}", row as f64 * period);
                let _ = match self.log {
                    Log::Rotor => {
                        write!(text, ",{:.6},{:.6}", logged[0] * scale, logged[1] * scale)
                    }
                    Log::Stator => {
                        write!(text, ",{:.6},{:.6}", stator[0] * scale, stator[1] * scale)
                    }
                    Log::Phases => {
                        let [a, b, c] = phases(stator);
                        write!(text, ",{a:.6},{b:.6},{c:.6}")
                    }
                };
                let _ = writeln!(text, ",{asked:.6}");
            }
            // Observer and speed loop.
            let error = angle - (seen + seen_speed * period);
            seen += seen_speed * period + 1.4 * observer * period * error;
            seen_speed += observer * observer * period * error;
            let aim = speeds[((row as f64 * period / hold_s) as usize).min(speeds.len() - 1)];
            let step = (aim - asked).clamp(-ramp * period, ramp * period);
            asked += step;
            let gain = motor.inertia / torque_per_a;
            let behind = asked - seen_speed;
            sum_speed += 0.25 * speed * speed * gain * period * behind;
            let asked_q = (speed * gain * behind + sum_speed + gain * step / period)
                .clamp(-motor.rated_a(), motor.rated_a());
            // Current loops with decoupling.
            let electrical = motor.pole_pairs * seen_speed;
            let errors = [-d, asked_q - q];
            for (sum, error) in sums.iter_mut().zip(errors) {
                *sum += motor.resistance * current * period * error;
            }
            let gain = motor.inductance * current;
            let next = [
                gain * errors[0] + sums[0] - electrical * motor.inductance * q,
                gain * errors[1] + sums[1] + electrical * (motor.inductance * d + motor.flux),
            ];
            // What was computed in the period before is output now, at the angle of the period's middle.
            logged = std::mem::replace(&mut computed, next);
            stator = turned(
                logged,
                motor.pole_pairs * (angle + 0.5 * period * seen_speed),
            );
            for _ in 0..STEPS {
                motor.step(&mut state, stator, period / STEPS as f64);
            }
        }
        text
    }
}
