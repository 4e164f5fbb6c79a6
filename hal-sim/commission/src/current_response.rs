//! The current loops' response to a step of the current along d, sampled in every PWM period, beside the model's.
//!
//! A current along d makes no torque, so the motors go on turning at their speed. Both levels of the step are far from zero current,
//! where the dead time's compensation is not whole. With `y` the response as a part of the step, and its differences at the period `T`,
//!
//! ```text
//! closed loop: T(w) = sum of (y[n] - y[n-1]) exp(-j w n T)      open loop: L = T / (1 - T)
//! ```
//!
//! `L` is computed only where `T` and `1 - T` are well above the noise.

use crate::electrical::{SPEEDS, largest, slowest_rad_s};
use crate::loop_response::{LoopResponse, OpenLoop, frequencies, spectrum};
use crate::session::Session;
use crate::tune::Loops;
use anyhow::Result;
use link::burst::{BurstRequest, SAMPLES, Signal, Trigger};
use link::host::burst::Burst;
use link::host::dialogue::Dialogue;
use link::scale;
use link::settings::{MotorSettings, Settings};
use nalgebra::Complex;
use serde::Serialize;
use std::f64::consts::TAU;

/// Steps that are averaged.
const STEPS: usize = 8;
/// The levels, of the largest current along d.
const FROM: f64 = 0.3;
const TO: f64 = 0.8;
/// Largest voltage that the step begins with, of the bus: the circle must not cut it.
const OF_BUS: f64 = 0.2;
/// What a current takes to be steady, s.
const SETTLE_S: f64 = 0.05;
/// Samples of a burst before its trigger.
const BEFORE: u16 = 64;
/// The first voltage of the step acts in the period that ends with the trigger's sample. The current that it answers to was sampled
/// two periods earlier.
const VOLTAGE_LAG: usize = 2;
/// The response is over after so many times `1 / cutoff` of the current loop.
const OVER: f64 = 12.0;
/// Points of a curve.
const POINTS: u32 = 60;
/// Minimum of the closed loop's gain, and of its distance from 1, that an open loop is computed from.
const MINIMUM: f64 = 0.15;

/// One step of a current along d.
#[derive(Clone, Debug, PartialEq)]
pub struct CurrentStep {
    /// Current along d, A, a sample a PWM period.
    pub current_a: Vec<f64>,
    /// The sample of the trigger: the first voltage of the step acted in the period that ends with it.
    pub trigger: usize,
}

impl CurrentStep {
    /// Of a burst around it; `angle` is [`encoder_angle`](crate::encoder_angle).
    #[must_use]
    pub fn of(burst: &Burst, motor: &MotorSettings, angle: (f64, f64)) -> Self {
        Self {
            current_a: direct_current(burst, motor, angle),
            trigger: burst.before,
        }
    }
}

/// The current along d of a burst, A.
fn direct_current(burst: &Burst, motor: &MotorSettings, (zero, direction): (f64, f64)) -> Vec<f64> {
    let pole_pairs = f64::from(motor.pole_pairs);
    let turn = f64::from(motor.encoder.counts_per_turn);
    let speed = burst.signal(Signal::Speed);
    let rpm = speed.iter().sum::<f64>() / speed.len().max(1) as f64;
    // The currents are newer than the angle.
    let aged = pole_pairs * rpm * TAU / 60.0 * motor.encoder.age_us * 1e-6;
    let [a, b] = [Signal::PhaseA, Signal::PhaseB].map(|of| burst.signal(of));
    let counts = burst.counts();
    let phases = a.iter().zip(b);
    phases
        .zip(counts)
        .map(|((a, b), counts)| {
            let angle = direction * counts / turn * TAU;
            let (sin, cos) = (pole_pairs * angle + zero + aged).sin_cos();
            cos * 1.5f64.sqrt() * a + sin * (a + 2.0 * b) / 2f64.sqrt()
        })
        .collect()
}

impl LoopResponse {
    /// Of equal steps of the current along d between these currents, A, of a loop with that period and cutoff, rad/s; `None` if a
    /// step is too short.
    #[must_use]
    pub fn of_current(
        steps: &[CurrentStep],
        [from_a, to_a]: [f64; 2],
        loops: &Loops,
        period_s: f64,
        cutoff_rad_s: f64,
    ) -> Option<Self> {
        let begins = |step: &CurrentStep| step.trigger.checked_sub(VOLTAGE_LAG);
        let room = |step: &CurrentStep| {
            Some(step.current_a.len() - begins(step)?.min(step.current_a.len()))
        };
        let room = steps.iter().map(room).min()??;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let samples = room.min((OVER / (cutoff_rad_s * period_s)).ceil() as usize);
        if samples < 8 {
            return None;
        }
        let mut measured = vec![0.0; samples];
        for step in steps {
            let (before, after) = step.current_a.split_at(begins(step)?);
            if before.is_empty() {
                return None;
            }
            let rest = before.iter().sum::<f64>() / before.len() as f64;
            for (sum, current) in measured.iter_mut().zip(after) {
                *sum += (current - rest) / (to_a - from_a) / steps.len() as f64;
            }
        }
        let predicted = loops.current_step(samples);
        let (mut response, mut model) = (OpenLoop::default(), OpenLoop::default());
        // The model has no noise: its crossing is looked for where the measured loop is not clear too.
        let mut whole = OpenLoop::default();
        let ends = [1.0 / (samples as f64 * period_s), 0.25 / period_s];
        for hz in frequencies(ends, POINTS) {
            let open = |step: &[f64]| open_loop(step, TAU * hz * period_s);
            let Some(expected) = open(&predicted) else {
                continue;
            };
            whole.add(hz, expected);
            if let Some(found) = open(&measured) {
                response.add(hz, found);
                model.add(hz, expected);
            }
        }
        Some(Self {
            unit: "A".to_owned(),
            from: from_a,
            to: to_a,
            steps: steps.len(),
            time_s: (0..samples).map(|n| n as f64 * period_s).collect(),
            ..Self::beside(measured, predicted, response, model, whole.crossing())
        })
    }
}

/// The open loop of a step's response at `turned` rad a sample, where both parts are well above the noise.
fn open_loop(response: &[f64], turned: f64) -> Option<Complex<f64>> {
    let closed = closed_loop(response, turned);
    let rest = Complex::from(1.0) - closed;
    (closed.norm() >= MINIMUM && rest.norm() >= MINIMUM).then(|| closed / rest)
}

/// The closed loop at `turned` rad a sample.
fn closed_loop(response: &[f64], turned: f64) -> Complex<f64> {
    let mut before = 0.0;
    let changes = response
        .iter()
        .map(|now| now - std::mem::replace(&mut before, *now));
    spectrum(changes, turned)
}

/// A step that a motor's current loop is measured with.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StepPlan {
    /// 0 is the screw, 1 the nut.
    pub motor: u8,
    /// From this current along d, A.
    pub from_a: f64,
    /// To this one, A.
    pub to_a: f64,
    /// By so much the voltage along d jumps, V.
    pub jump_v: f64,
    /// Speed of both motors, rad/s.
    pub base_rad_s: f64,
    /// Steps that are averaged.
    pub steps: usize,
    /// How long each level is held before its step, s.
    pub settle_s: f64,
}

impl StepPlan {
    /// Of the screw's motor (0) or the nut's (1) on that bus.
    #[must_use]
    pub fn of(settings: &Settings, motor: u8, bus_v: f64, loops: &Loops) -> Self {
        let motors = [&settings.screw, &settings.nut];
        let largest = largest(motors[usize::from(motor != 0)], settings);
        let [k_pc, ..] = loops.gains();
        let wide = ((TO - FROM) * largest).min(OF_BUS * bus_v / k_pc.abs());
        Self {
            motor,
            from_a: FROM * largest,
            to_a: FROM * largest + wide,
            jump_v: k_pc * wide,
            base_rad_s: SPEEDS[0] * slowest_rad_s(settings),
            steps: STEPS,
            settle_s: SETTLE_S,
        }
    }

    /// The burst around the step, where the voltage along d is `rests_at_v` before it; `None` if no word holds its level.
    #[must_use]
    pub fn burst(&self, rests_at_v: f64) -> Option<BurstRequest> {
        let level = scale::word(rests_at_v + 0.5 * self.jump_v, Signal::VoltageD.fraction())?;
        Some(BurstRequest {
            motor: self.motor,
            trigger: Trigger::Rises.word(),
            signal: Signal::VoltageD.word(),
            level,
            before: BEFORE,
            divider: 1,
        })
    }
}

/// Measures both motors of an armed drive, which turn together. `None` for a motor whose step was not seen.
///
/// # Errors
/// A refusal, a fault, or a drive that is lost.
pub async fn measure<D: Dialogue>(
    session: &mut Session<D>,
    progress: &mut dyn FnMut(f64),
) -> Result<[Option<LoopResponse>; 2]> {
    let settings = *session.settings();
    let (period_s, step_s) = (session.pwm_period_s(), session.speed_step_s());
    let mut found = [None, None];
    for (k, motor) in (0u8..).zip([&settings.screw, &settings.nut]) {
        let loops = Loops::of(motor, &settings, period_s, step_s);
        let plan = StepPlan::of(&settings, k, session.bus_v(), &loops);
        session.go(0.0, plan.base_rad_s, &mut |_| ()).await?;
        let mut steps = Vec::new();
        for n in 0..plan.steps {
            progress(0.5 * (f64::from(k) + n as f64 / plan.steps as f64));
            steps.extend(step(session, &plan).await?);
        }
        session.direct([0.0; 2]).await?;
        if steps.len() == plan.steps {
            let cutoff = settings.tuning.current_rad_s;
            let levels = [plan.from_a, plan.to_a];
            found[usize::from(k)] =
                LoopResponse::of_current(&steps, levels, &loops, period_s, cutoff);
        }
    }
    session.go(0.0, 0.0, &mut |_| ()).await?;
    session.rest().await?;
    Ok(found)
}

/// One step; `None` if the voltage has not shown it.
async fn step<D: Dialogue>(
    session: &mut Session<D>,
    plan: &StepPlan,
) -> Result<Option<CurrentStep>> {
    let k = usize::from(plan.motor);
    let along_d = |amps: f64| if k == 0 { [amps, 0.0] } else { [0.0, amps] };
    session.direct(along_d(plan.from_a)).await?;
    session.hold(plan.settle_s, &mut |_| ()).await?;
    let (mut sum, mut count) = (0.0, 0.0);
    session
        .hold(plan.settle_s, &mut |point| {
            sum += point.motors[k].voltage[0];
            count += 1.0;
        })
        .await?;
    let Some(request) = plan.burst(sum / f64::max(count, 1.0)) else {
        return Ok(None);
    };
    session.arm_burst(request).await?;
    session.direct(along_d(plan.to_a)).await?;
    let burst = session.take_burst().await?;
    let motors = [&session.settings().screw, &session.settings().nut];
    let angle = session.encoder_angle(k);
    Ok(burst.map(|burst| CurrentStep::of(&burst, motors[k], angle)))
}

const _: () = assert!((BEFORE as usize) < SAMPLES);

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 50e-6;

    fn loops() -> Loops {
        let settings = Settings::DEFAULT;
        Loops::of(&settings.screw, &settings, PERIOD_S, 200e-6)
    }

    fn response(current_a: &dyn Fn(usize) -> f64) -> LoopResponse {
        let step = CurrentStep {
            current_a: (0..SAMPLES).map(current_a).collect(),
            trigger: usize::from(BEFORE),
        };
        let cutoff = Settings::DEFAULT.tuning.current_rad_s;
        LoopResponse::of_current(&[step], [1.0, 3.0], &loops(), PERIOD_S, cutoff).unwrap()
    }

    /// A current that goes the part `1 - a` of its way in each sample is the open loop `(1 - a) / (z - 1)`. Its gain is 1 where
    /// `2 sin(w T / 2) = 1 - a`, and its margin there is `90 degrees - w T / 2`.
    #[test]
    fn a_first_order_response_is_a_sampled_integrator() {
        let decay = (-1.0f64 / 8.0).exp();
        let begins = usize::from(BEFORE) - VOLTAGE_LAG;
        let found = response(&|n| 3.0 - 2.0 * decay.powf(n.saturating_sub(begins) as f64));
        let turned = 2.0 * ((1.0 - decay) / 2.0).asin();
        let crossing = found.crossing.unwrap();
        let bandwidth = crossing.bandwidth_rad_s * PERIOD_S / turned;
        assert!((bandwidth - 1.0).abs() < 2e-3, "{crossing:?}");
        let margin = 90.0 - (turned / 2.0).to_degrees();
        assert!((crossing.margin_deg - margin).abs() < 0.2, "{crossing:?}");
        for (hz, gain) in found.hz.iter().zip(&found.gain_db) {
            let expected = (1.0 - decay) / (2.0 * (TAU * hz * PERIOD_S / 2.0).sin());
            let off = gain - 20.0 * expected.log10();
            assert!(off.abs() < 0.05, "{off} dB off at {hz} Hz");
        }
    }

    /// The sampled model and the one in the frequency domain are two ways to the same loop.
    #[test]
    fn the_models_own_step_has_the_models_crossing() {
        let begins = usize::from(BEFORE) - VOLTAGE_LAG;
        let own = loops().current_step(SAMPLES);
        let found = response(&|n| 1.0 + 2.0 * n.checked_sub(begins).map_or(0.0, |n| own[n]));
        assert_eq!(found.crossing, found.predicted_crossing);
        let (found, model) = (found.crossing.unwrap(), loops().current_crossing());
        let bandwidth = found.bandwidth_rad_s / model.bandwidth_rad_s;
        assert!((bandwidth - 1.0).abs() < 0.08, "{found:?}, {model:?}");
        assert!(
            (found.margin_deg - model.margin_deg).abs() < 3.0,
            "{found:?}, {model:?}"
        );
    }

    /// A current that does not move has no frequency that is clear. The model has its crossing all the same.
    #[test]
    fn the_model_has_its_crossing_where_nothing_is_measured() {
        let found = response(&|_| 1.0);
        assert_eq!((found.hz.len(), found.crossing), (0, None));
        assert!(found.predicted_crossing.is_some(), "{found:?}");
    }

    #[test]
    fn a_step_without_samples_has_no_response() {
        let short = CurrentStep {
            current_a: vec![1.0; 5],
            trigger: 1,
        };
        assert_eq!(
            LoopResponse::of_current(&[short], [1.0, 2.0], &loops(), PERIOD_S, 1e3),
            None
        );
        assert_eq!(
            LoopResponse::of_current(&[], [1.0, 2.0], &loops(), PERIOD_S, 1e3),
            None
        );
    }
}
