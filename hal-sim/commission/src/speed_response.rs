//! The speed loops' response to small steps of the common speed, beside the model's.
//!
//! The drive makes a speed reference `r` into ramps, whose inertia it feeds forward. So the response to `r` is not the loop's. The part
//! of the loop that the drive does not know by itself is its plant `G`, from the reference of the current along q to the measured speed:
//! the closed current loop, the inertia, delays, and whatever hangs on the motor. The reference is its instrument, as noise and torque
//! ripple do not depend on it (instrumental variables: Söderström and Stoica, "Instrumental Variable Methods for System
//! Identification", 1983):
//!
//! ```text
//! G(w) = sum of V(w) R*(w) / sum of I(w) R*(w)      over all steps, of the differences of speed, current and reference
//! L(w) = K(w) O(w) G(w)                             PI and observer are the drive's own
//! ```
//!
//! The table goes slowly one way meanwhile, or the pair's friction would stick and make one inertia of both motors.

use crate::electrical::{SPEEDS, slowest_rad_s};
use crate::loop_response::{LoopResponse, OpenLoop, frequencies, spectrum};
use crate::session::{Point, Session};
use crate::tune::Loops;
use anyhow::Result;
use link::host::dialogue::Dialogue;
use link::settings::Settings;
use nalgebra::Complex;
use std::f64::consts::{PI, TAU};

/// Steps of each height, half of them up; the table goes one way for half of them.
const STEPS: usize = 24;
/// How long the reference takes to step, times the cutoff of the speed loops: the spectrum of the short one reaches beyond the crossing
/// of 2 cutoffs, and that of the long one is higher below.
const RAMPS: [f64; 2] = [2.5, 6.25];
/// A step is over so many times `1 / cutoff` after its ramp, and so many seconds.
const OVER: f64 = 8.0;
const OVER_S: f64 = 0.03;
/// Steps begin at all places of a turn: each waits for this part of a turn more than the one before (the golden section). Otherwise a
/// ripple that repeats from step to step would count as an answer to them.
const WAITS: f64 = 0.618_034;
/// Share of a step's time at its end over which its spectrum is faded out.
const FADE: f64 = 0.2;
/// Largest step, of the common speed.
const LARGEST: f64 = 0.2;
/// A short step is at least so many times what the encoder's counts make of the mean of all.
const ABOVE_COUNTS: f64 = 20.0;
/// Largest standard error of a plant's gain that a frequency is used with.
const ERROR: f64 = 0.15;
/// Share of the travel that the table goes.
const TRAVEL: f64 = 0.4;
/// Points of a curve, and from the cutoff the frequencies of its ends, of the cutoff.
const POINTS: u32 = 50;
const FROM: f64 = 0.3;
const TO: f64 = 10.0;
/// Speeds are shown as means of so many samples.
const SHOWN: usize = 5;

/// What is stepped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedPlan {
    /// Common speed, rad/s.
    pub base_rad_s: f64,
    /// Heights of the steps, short and long, rad/s.
    pub steps_rad_s: [f64; 2],
    /// From the end of a step to the next, s.
    pub hold_s: f64,
    /// How fast the table goes, m/s.
    pub table_m_s: f64,
}

impl SpeedPlan {
    /// For a table that may move by `travel_m` to each side, and a step of the speed task of `step_s`.
    #[must_use]
    pub fn of(settings: &Settings, travel_m: f64, step_s: f64) -> Self {
        let (cutoff, feed) = (settings.tuning.speed_rad_s, &settings.feed);
        let base_rad_s = SPEEDS[0] * slowest_rad_s(settings);
        let acceleration = feed.base_acceleration_max_rpm_s * TAU / 60.0;
        let jerk = feed.base_jerk_max_rpm_s2 * TAU / 60.0;
        let [short_s, long_s] = RAMPS.map(|ramp| ramp / cutoff);
        let hold_s = OVER / cutoff + OVER_S;
        // A ramp of a limited jerk and acceleration that takes so long.
        let height = |seconds: f64| {
            if jerk * seconds <= 2.0 * acceleration {
                0.25 * jerk * seconds * seconds
            } else {
                acceleration * (seconds - acceleration / jerk)
            }
        };
        // White noise of a count in an angle, as the second difference at the crossing sees it.
        let coarser =
            (settings.screw.encoder.counts_per_turn).min(settings.nut.encoder.counts_per_turn);
        let count = TAU / f64::from(coarser) / 12f64.sqrt();
        let samples = (hold_s + long_s) / step_s;
        let noise = (2.0 * cutoff).powi(2) * step_s * count * (samples / STEPS as f64).sqrt();
        let most = LARGEST * base_rad_s;
        let short = height(short_s).max(ABOVE_COUNTS * noise).min(most);
        let seconds = (2 * STEPS) as f64 * (hold_s + long_s);
        Self {
            base_rad_s,
            steps_rad_s: [short, height(long_s).max(short).min(most)],
            hold_s,
            table_m_s: (2.0 * TRAVEL * travel_m / seconds)
                .min(0.25 * feed.velocity_max_mm_s * 1e-3),
        }
    }
}

/// One step, from before its ramp until its end.
#[derive(Clone, Debug, Default)]
pub struct SpeedStep {
    points: Vec<Point>,
    /// It is a long one upwards, which is shown.
    shown: bool,
}

/// Measures both motors of an armed drive, which turn together. `table_kg_m2` is the table's part of the motors' inertia, which does not
/// move with the common speed. `None` for a motor whose steps the ripple of its torque hides.
///
/// # Errors
/// A refusal, a fault, or a drive that is lost.
pub async fn measure<D: Dialogue>(
    session: &mut Session<D>,
    travel_m: f64,
    table_kg_m2: f64,
    progress: &mut dyn FnMut(f64),
) -> Result<[Option<LoopResponse>; 2]> {
    let settings = *session.settings();
    let (period_s, step_s) = (session.pwm_period_s(), session.speed_step_s());
    let plan = SpeedPlan::of(&settings, travel_m, step_s);
    let mut steps = Vec::new();
    for (half, sign) in [1.0, -1.0].into_iter().enumerate() {
        let velocity = sign * plan.table_m_s;
        session.go(velocity, plan.base_rad_s, &mut |_| ()).await?;
        session.hold(plan.hold_s, &mut |_| ()).await?;
        for n in 0..STEPS {
            progress(0.5 * (half as f64 + n as f64 / STEPS as f64));
            let (long, up) = (n / 2 % 2, n % 2 == 0);
            let height = if up { plan.steps_rad_s[long] } else { 0.0 };
            let mut step = SpeedStep {
                shown: long == 1 && up,
                ..SpeedStep::default()
            };
            let each = &mut |point: &Point| step.points.push(*point);
            session.go(velocity, plan.base_rad_s + height, each).await?;
            session.hold(plan.hold_s, each).await?;
            steps.push(step);
            let turn_s = TAU / plan.base_rad_s;
            let waits = (steps.len() as f64 * WAITS).fract();
            session.hold(waits * turn_s, &mut |_| ()).await?;
        }
    }
    session.go(0.0, 0.0, &mut |_| ()).await?;
    session.rest().await?;
    let motors = [&settings.screw, &settings.nut];
    Ok([0, 1].map(|k| {
        let moves = 1.0 - 1e4 * table_kg_m2 / motors[k].inertia_kg_cm2;
        let loops = Loops::of(motors[k], &settings, period_s, step_s).moving(moves);
        LoopResponse::of_speed(
            &steps,
            k,
            &plan,
            &loops,
            step_s,
            settings.tuning.speed_rad_s,
        )
    }))
}

/// A motor's signals over a step, each its differences from sample to sample.
struct Differences {
    reference: Vec<f64>,
    current: Vec<f64>,
    speed: Vec<f64>,
}

impl Differences {
    /// `None` if samples are missing.
    fn of(step: &SpeedStep, motor: usize, samples: usize, step_s: f64) -> Option<Self> {
        let points = step.points.get(..samples + 3)?;
        let whole = points
            .windows(2)
            .all(|two| (two[1].time - two[0].time) < 1.5 * step_s);
        let of = |k: usize| &points[k].motors[motor];
        // A speed is the angle's central difference.
        let speed = |k: usize| (of(k + 1).angle - of(k - 1).angle) / (2.0 * step_s);
        whole.then(|| Self {
            reference: (1..=samples)
                .map(|k| of(k + 1).speed_ref - of(k).speed_ref)
                .collect(),
            current: (1..=samples)
                .map(|k| of(k + 1).i_q_ref - of(k).i_q_ref)
                .collect(),
            speed: (1..=samples).map(|k| speed(k + 1) - speed(k)).collect(),
        })
    }

    /// Spectra at `turned` rad a sample of reference, current and speed.
    fn spectra(&self, turned: f64) -> [Complex<f64>; 3] {
        [&self.reference, &self.current, &self.speed].map(|values| faded_spectrum(values, turned))
    }
}

/// At `turned` rad a sample, faded out at the end.
fn faded_spectrum(values: &[f64], turned: f64) -> Complex<f64> {
    let fades = FADE * values.len() as f64;
    let weight = |n: usize| {
        let left = ((values.len() - n) as f64 / fades).min(1.0);
        0.5 - 0.5 * (PI * left).cos()
    };
    let faded = values
        .iter()
        .enumerate()
        .map(|(n, value)| weight(n) * value);
    spectrum(faded, turned)
}

/// The plant at `turned` rad a sample, with the relative standard error of its gain; `None` if nothing was excited.
fn plant(steps: &[Differences], turned: f64) -> Option<(Complex<f64>, f64)> {
    let spectra: Vec<_> = steps.iter().map(|step| step.spectra(turned)).collect();
    let sum = |of: &dyn Fn(&[Complex<f64>; 3]) -> Complex<f64>| {
        spectra.iter().map(of).sum::<Complex<f64>>()
    };
    let current = sum(&|[r, i, _]| i * r.conj());
    let gain = sum(&|[r, _, v]| v * r.conj()) / current;
    let unexplained: f64 = spectra
        .iter()
        .map(|[_, i, v]| (v - gain * i).norm_sqr())
        .sum();
    let excited: f64 = spectra.iter().map(|[r, ..]| r.norm_sqr()).sum();
    let variance = unexplained / steps.len().saturating_sub(1).max(1) as f64;
    let error = (variance * excited).sqrt() / current.norm() / gain.norm();
    // A central difference of angles is a little low.
    let central = turned / turned.sin();
    (gain.norm() > 0.0 && error.is_finite()).then(|| (gain * central, error))
}

impl LoopResponse {
    /// Of a motor's steps: screw 0, nut 1. `loops` are the model's, `step_s` is the step of the speed task.
    #[must_use]
    pub fn of_speed(
        steps: &[SpeedStep],
        motor: usize,
        plan: &SpeedPlan,
        loops: &Loops,
        step_s: f64,
        cutoff_rad_s: f64,
    ) -> Option<Self> {
        let samples = steps
            .iter()
            .map(|step| step.points.len())
            .min()?
            .checked_sub(3)?;
        let all: Vec<_> = steps
            .iter()
            .filter_map(|step| Differences::of(step, motor, samples, step_s))
            .collect();
        let (mut response, mut model) = (OpenLoop::default(), OpenLoop::default());
        for w in frequencies([FROM, TO].map(|part| part * cutoff_rad_s), POINTS) {
            let clear = w * step_s < 0.5 * PI && w * step_s * samples as f64 > TAU;
            let Some((found, error)) = plant(&all, w * step_s).filter(|_| clear) else {
                continue;
            };
            if error < ERROR {
                response.add(w / TAU, loops.speed_with(w, found));
                model.add(w / TAU, loops.speed(w));
            }
        }
        let shown: Vec<_> = steps
            .iter()
            .filter(|step| step.shown)
            .filter_map(|step| Differences::of(step, motor, samples, step_s))
            .collect();
        let [from, height] = [plan.base_rad_s, plan.steps_rad_s[1]];
        if response.is_empty() || shown.is_empty() {
            return None;
        }
        let mean = |of: &dyn Fn(&Differences) -> &Vec<f64>| -> Vec<f64> {
            let count = shown.len() as f64 * height;
            (0..samples)
                .map(|n| shown.iter().map(|step| of(step)[n]).sum::<f64>() / count)
                .collect()
        };
        let predicted = followed(&mean(&|step| &step.reference), loops, step_s);
        let rpm = |speed: f64| speed * 60.0 / TAU;
        Some(Self {
            unit: "rpm".to_owned(),
            from: rpm(from),
            to: rpm(from + height),
            steps: all.len(),
            time_s: (0..samples)
                .step_by(SHOWN)
                .map(|n| n as f64 * step_s)
                .collect(),
            ..Self::beside(
                thinned(&added(&mean(&|step| &step.speed))),
                thinned(&predicted),
                response,
                model,
                Some(loops.speed_crossing()).filter(|crossing| crossing.bandwidth_rad_s > 0.0),
            )
        })
    }
}

/// Values of their differences.
fn added(differences: &[f64]) -> Vec<f64> {
    let add = |sum: &mut f64, value: &f64| {
        *sum += value;
        Some(*sum)
    };
    differences.iter().scan(0.0, add).collect()
}

/// Means of so many samples that are shown.
fn thinned(values: &[f64]) -> Vec<f64> {
    values
        .chunks(SHOWN)
        .map(|some| some.iter().sum::<f64>() / some.len() as f64)
        .collect()
}

/// The model's speed after a reference of these differences, in the reference's unit.
fn followed(reference: &[f64], loops: &Loops, step_s: f64) -> Vec<f64> {
    // Zeros behind it keep the end of the response from its beginning.
    let length = 2 * reference.len();
    let line = |k: usize| TAU * k as f64 / length as f64;
    let lines: Vec<_> = (1..reference.len())
        .map(|k| {
            let sum = spectrum(reference.iter().copied(), line(k));
            sum * loops.speed_closed(line(k) / step_s)
        })
        .collect();
    // The loop follows a constant wholly.
    let rest: f64 = reference.iter().sum();
    let differences: Vec<f64> = (0..reference.len())
        .map(|n| {
            let parts = lines.iter().zip(1..);
            let sum: f64 = parts
                .map(|(value, k)| (value * Complex::cis(line(k) * n as f64)).re)
                .sum();
            (rest + 2.0 * sum) / length as f64
        })
        .collect();
    added(&differences)
}

#[cfg(test)]
mod tests {
    use super::*;
    use link::settings::Settings;

    const STEP_S: f64 = 200e-6;

    /// A speed that is an integral of the current, half a step late: the plant `a e^(-j w T / 2) / (j w)`, with a ripple of 100 Hz.
    #[test]
    fn an_integrator_is_measured_through_ripple() {
        let (gain, samples) = (40.0, 1000);
        let steps: Vec<SpeedStep> = (0..48)
            .map(|n| {
                let (mut speed, mut angle) = (0.0, 0.0);
                let up = if n % 2 == 0 { 1.0 } else { -1.0 };
                let points = (0..samples + 3).map(|k| {
                    let pulse = |from: i32, to: i32| f64::from(u8::from((from..to).contains(&k)));
                    let current = up * (pulse(50, 75) - 0.2 * pulse(75, 150)) + 0.4;
                    let reference = up * f64::from((k - 50).clamp(0, 40)) / 40.0;
                    let ripple = f64::from(k) * STEP_S * TAU * 100.0 + f64::from(n) * 2.4;
                    let mut point = Point {
                        time: f64::from(k) * STEP_S,
                        ..Point::default()
                    };
                    point.motors[1].angle = angle + 1e-5 * ripple.sin();
                    point.motors[1].i_q_ref = current;
                    point.motors[1].speed_ref = reference;
                    let before = speed;
                    speed += gain * STEP_S * (current - 0.4);
                    angle += 0.5 * (before + speed) * STEP_S;
                    point
                });
                SpeedStep {
                    points: points.collect(),
                    shown: false,
                }
            })
            .collect();
        let all: Vec<_> = steps
            .iter()
            .map(|step| Differences::of(step, 1, samples as usize, STEP_S).unwrap())
            .collect();
        for hz in [10.0, 30.0, 60.0] {
            let w = TAU * hz;
            let (found, error) = plant(&all, w * STEP_S).unwrap();
            // A current acts from its sample to the next.
            let expected = Complex::new(0.0, w).inv() * gain * Complex::cis(-0.5 * w * STEP_S);
            let off = found / expected;
            assert!(
                (off.norm() - 1.0).abs() < 0.02 && off.arg().abs() < 0.02 && error < ERROR,
                "{hz} Hz: {found} +- {error}, expected {expected}"
            );
        }
    }

    /// The model's speed follows a reference wholly in the end.
    #[test]
    fn a_reference_is_followed() {
        let settings = Settings::DEFAULT;
        let loops = Loops::of(&settings.screw, &settings, 50e-6, STEP_S);
        let reference: Vec<f64> = (0..800)
            .map(|k| if (20..60).contains(&k) { 0.025 } else { 0.0 })
            .collect();
        let speed = followed(&reference, &loops, STEP_S);
        assert!((speed[799] - 1.0).abs() < 0.01, "{}", speed[799]);
        assert!(speed[10].abs() < 0.01, "{}", speed[10]);
    }
}
