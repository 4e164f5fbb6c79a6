//! Steps of a motor's current along d, and the response of its current loop.

use crate::burst::ReadBurst;
use crate::loops::Rates;
use anyhow::{Context, Result, ensure};
use commission::encoder_angle;
use commission::response::{CurrentResponse, CurrentStep, StepPlan};
use commission::tune::Loops;
use link::message::Aligned;
use link::settings::Settings;
use serde_json::{Value, json};
use std::f64::consts::TAU;

/// The steps of one motor that were measured so far.
#[derive(Debug, Default)]
pub struct Steps {
    plan: Option<StepPlan>,
    measured: Vec<CurrentStep>,
}

impl Steps {
    /// Begins to measure the screw's motor (0) or the nut's (1) on a bus of that voltage: the plan as JSON.
    pub fn begin(&mut self, settings: &Settings, rates: Rates, motor: u8, bus_v: f64) -> Value {
        let plan = StepPlan::of(settings, motor, bus_v, &loops(settings, rates, motor));
        self.plan = Some(plan);
        self.measured.clear();
        json!({
            "from_a": plan.from_a,
            "to_a": plan.to_a,
            "jump_v": plan.jump_v,
            "common_speed_rpm": plan.base_rad_s * 60.0 / TAU,
            "steps": plan.steps,
            "settle_s": plan.settle_s,
        })
    }

    /// Adds the burst that was read. The response as JSON once there are enough.
    ///
    /// # Errors
    /// No burst of this motor was read, its rotor's angle is not known, or the steps have no response.
    pub fn add(
        &mut self,
        burst: &ReadBurst,
        settings: &Settings,
        rates: Rates,
        aligned: [Aligned; 2],
    ) -> Result<Value> {
        let plan = self.plan.context("No step was begun.")?;
        let burst = burst.whole(settings, rates.pwm_hz);
        let burst = burst.context("No burst was read.")?;
        ensure!(burst.motor == plan.motor, "The burst is the other motor's.");
        let k = usize::from(plan.motor != 0);
        let angle = encoder_angle(aligned[k]).context("The rotor's angle is not known.")?;
        let motor = [&settings.screw, &settings.nut][k];
        self.measured.push(CurrentStep::of(&burst, motor, angle));
        if self.measured.len() < plan.steps {
            return Ok(Value::Null);
        }
        let response = CurrentResponse::of(
            &self.measured,
            [plan.from_a, plan.to_a],
            &loops(settings, rates, plan.motor),
            1.0 / rates.pwm_hz,
            settings.tuning.current_rad_s,
        );
        let response = response.context("The burst is too short for this current loop.")?;
        Ok(serde_json::to_value(response)?)
    }
}

fn loops(settings: &Settings, rates: Rates, motor: u8) -> Loops {
    let motor = if motor == 0 {
        &settings.screw
    } else {
        &settings.nut
    };
    Loops::of(motor, settings, 1.0 / rates.pwm_hz, 1.0 / rates.speed_hz)
}
