//! A step of load with and without disturbance observer and notch, and a base speed that wanders over a resonance.

use super::{MODES, mode};
use crate::smooth::rejection::{LoadStep, Rejection, load_step, wandering};
use anyhow::Result;
use hal_sim::parallel::on_all_cores;
use hal_sim::smooth::Smoothness;
use serde_json::{Value, json};

/// A mode, what rejects, and what a step of load does.
pub type Step = (f64, Rejection, LoadStep);

/// Of both modes.
pub fn load_steps() -> Result<Vec<Step>> {
    let cases: Vec<(f64, Rejection)> = MODES
        .iter()
        .flat_map(|&rpm| Rejection::ALL.map(|rejection| (rpm, rejection)))
        .collect();
    let steps = on_all_cores(&cases, |&(rpm, rejection)| load_step(rejection, rpm));
    let steps = cases.iter().zip(steps);
    steps
        .map(|(&(rpm, rejection), step)| Ok((rpm, rejection, step?)))
        .collect()
}

/// As JSON.
pub fn load_steps_json(steps: &[Step]) -> Value {
    let one = |(rpm, rejection, step): &Step| {
        json!({
            "mode": mode(*rpm),
            "controller": rejection.name(),
            "velocity_mm_s": step.velocity_mm_s,
            "pushed_um": step.pushed_um,
            "left_um": step.left_um,
            "ringing_mm_s": step.ringing_mm_s,
        })
    };
    steps.iter().map(one).collect()
}

/// For a person.
pub fn print_load_steps(steps: &[Step]) {
    println!(
        "\nA step of load of a quarter of the rated torque, coupled, 2.5 mm/s: largest error of the velocity, mm/s; table pushed by, \
         um; and still half a second later, um; screw stretched after 13 ms, mm/s rms"
    );
    for (rpm, rejection, step) in steps {
        println!(
            "  {:<14} {:<24} {:>6.2} {:>7.1} {:>7.1} {:>8.4}",
            mode(*rpm),
            rejection.name(),
            step.velocity_mm_s,
            step.pushed_um,
            step.left_um,
            step.ringing_mm_s
        );
    }
}

/// Nut speed and its wander, rpm; whether the ripple is compensated; the residual of it.
pub type Wander = (f64, f64, bool, Smoothness);

/// Off the resonance, and on it.
pub fn wanders() -> Result<Vec<Wander>> {
    let cases: Vec<(f64, f64, bool)> = [800.0, 1006.0]
        .iter()
        .flat_map(|&rpm| [0.0, 30.0, 100.0].map(|wander| (rpm, wander)))
        .flat_map(|(rpm, wander)| [false, true].map(|ours| (rpm, wander, ours)))
        .collect();
    let left = on_all_cores(&cases, |&(rpm, wander, ours)| wandering(rpm, wander, ours));
    let left = cases.iter().zip(left);
    left.map(|(&(rpm, wander, ours), left)| Ok((rpm, wander, ours, left?)))
        .collect()
}

/// As JSON.
pub fn wanders_json(wanders: &[Wander]) -> Value {
    let one = |(rpm, wander, ours, left): &Wander| {
        json!({
            "nut_rpm": rpm,
            "wander_rpm": wander,
            "controller": if *ours { "ours" } else { "pi" },
            "vrf": left.vrf,
            "rms_percent": left.rms,
        })
    };
    wanders.iter().map(one).collect()
}

/// For a person.
pub fn print_wanders(wanders: &[Wander]) {
    println!(
        "\nA base speed that wanders in 4 s, coupled, 2.5 mm/s; order 30 of the nut is on the table's resonance at 1006 rpm: ripple \
         (Eq 19) and rms, %"
    );
    for (rpm, wander, ours, left) in wanders {
        println!(
            "  {rpm:>5.0} rpm, wander {wander:>4.0} rpm, {:<5} {:>7.2} {:>8.3}",
            if *ours { "ours" } else { "PI" },
            left.vrf,
            left.rms
        );
    }
}
