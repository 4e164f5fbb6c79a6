//! Clean motors and feed axes, made from their own laws, and clean double drives that run at one speed or for four seconds:
//! whatever is named on them is a false alarm.

use crate::draw::{self, profile::Profile};
use identify::analysis::analyse;
use identify::machines::feed_axis::{self, Axis, Study};
use identify::machines::motor;
use identify::records::DataQuality;
use plant::effects::EffectModel;
use serde_json::{Value, json};
use std::f64::consts::TAU;

const RATE: f64 = 1000.0;

/// Noise of variance 1 of which a share is kept from row to row.
struct Noise {
    state: u64,
    kept: f64,
    last: f64,
}

impl Noise {
    fn new(seed: u64, kept: f64) -> Self {
        Noise {
            state: seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1,
            kept,
            last: 0.0,
        }
    }

    fn next(&mut self) -> f64 {
        // Twelve even numbers make nearly a normal one.
        let even = (0..12).map(|_| {
            self.state = self
                .state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (self.state >> 11) as f64 / (1_u64 << 53) as f64
        });
        let new = even.sum::<f64>() - 6.0;
        self.last = self.kept * self.last + (1.0 - self.kept * self.kept).sqrt() * new;
        self.last
    }
}

/// Speed of a motor over time, rad/s, by kind: slow, fast, varying, reversing.
fn speed(kind: u64, t: f64) -> f64 {
    match kind {
        0 => 0.8,
        1 => 55.0,
        2 => 12.0 + 9.0 * (1.3 * t).sin() + 2.0 * (4.1 * t).cos(),
        _ => 15.0 * (1.1 * t).sin(),
    }
}

/// A motor with inertia and friction only: white and coloured noise, slow, fast, varying and reversing, encoders fine and
/// coarse.
fn motor_record(seed: u64, kind: u64, kept: f64, counts: f64) -> motor::Record {
    let mut noise = Noise::new(seed, kept);
    let (mut angle, mut position, mut current) = (0.0, Vec::new(), Vec::new());
    for k in 0..(10.0 * RATE) as usize {
        let t = k as f64 / RATE;
        let [before, w, after] = [t - 1.0 / RATE, t, t + 1.0 / RATE].map(|t| speed(kind, t));
        let acceleration = 0.5 * RATE * (after - before);
        angle += w / RATE;
        let count = TAU / counts;
        position.push((angle / count).round() * count);
        let friction = 0.15 * (w / 0.05).tanh() + 1e-3 * w;
        current.push(0.02 + friction + 2e-3 * acceleration + 0.03 * noise.next());
    }
    motor::Record {
        rate: RATE,
        position,
        current,
        account: DataQuality::default(),
    }
}

/// Clean motors, and those on which something is named.
fn motors(runs: u64) -> Value {
    let alarms = (0..runs).filter(|run| {
        let kind = run % 4;
        let kept = [0.0, 0.9][(run / 4 % 2) as usize];
        let counts = [2048.0, 20_000.0, 1e6][(run / 8 % 3) as usize];
        let [fit, check] = [2, 3].map(|k| motor_record(60_000 + 2 * run + k, kind, kept, counts));
        let study = motor::Study::new(&fit, &check, None);
        let names: Vec<u32> = study.orders.iter().map(|order| order.order).collect();
        let alarm = !names.is_empty() || study.lag.is_some_and(|lag| lag.is_named);
        if alarm {
            eprintln!(
                "clean motor {run}, kind {kind}, kept {kept}, {counts} counts: {names:?}, {:?}",
                study.lag
            );
        }
        alarm
    });
    json!({ "runs": runs, "false_alarms": alarms.count() })
}

/// A position loop that runs strokes of about a second each.
fn axis_record(axis: &Axis, seed: u64, kept: f64) -> feed_axis::Record {
    let strokes = [2.0, -3.0, 3.0, -2.0, 0.7, -1.2, 1.2, -0.7];
    let mut at = 0.0;
    let reference: Vec<f64> = (0..8 * RATE as usize)
        .map(|k| {
            at += axis.lead_m * strokes[k / RATE as usize % 8] / RATE;
            at
        })
        .collect();
    let mut record = feed_axis::Record::to_follow(reference, RATE);
    let run = axis.simulate(&record);
    let mut noise = Noise::new(seed, kept);
    let volts = |force: &f64| force / record.force_per_volt;
    record.output = run
        .force
        .iter()
        .map(volts)
        .map(|u| u + 0.02 * noise.next())
        .collect();
    record.position = run.position;
    record
}

/// Clean feed axes, and those on which something is named.
fn axes(runs: u64) -> Value {
    let declared = Axis {
        law: feed_axis::Law::Difference(2),
        ..Axis::published()
    };
    let alarms = (0..runs).filter(|run| {
        let kept = [0.0, 0.9][(run % 2) as usize];
        let [fit, check] = [0, 1].map(|k| axis_record(&declared, 70_000 + 2 * run + k, kept));
        let study = Study::new(&declared, &fit, &check);
        let names: Vec<&str> = study
            .last()
            .axis
            .terms
            .iter()
            .map(|(term, _)| term.kind())
            .collect();
        if !names.is_empty() {
            eprintln!("clean feed axis {run}, kept {kept}: {names:?}");
        }
        !names.is_empty()
    });
    json!({ "runs": runs, "false_alarms": alarms.count() })
}

/// A profile of one speed, or of four seconds both ways; of a quarter of them the nut rests.
fn meagre(run: u64, seconds: f64) -> Profile {
    let velocity = [2.5, -5.0, 10.0, -2.5][(run / 2 % 4) as usize];
    let rpm = [0.0, 120.0, 300.0, 800.0][(run / 8 % 4) as usize];
    match run % 2 {
        0 => Profile::of(0.75, &[(velocity, rpm, seconds)]),
        _ => Profile::of(0.4, &[(velocity, rpm, 1.8), (-velocity, rpm, 1.8)]),
    }
}

/// What is named on a clean double drive whose records show little.
fn named(run: u64) -> Vec<EffectModel> {
    let profiles = [12.0, 9.0].map(|seconds| meagre(run, seconds));
    let machine = draw::acted_on(80_000 + run, &|_| (), profiles);
    let outcome = analyse(&machine.declared, &machine.fit, &machine.check);
    (outcome.effects.into_iter())
        .map(|found| found.effect)
        .collect()
}

/// Clean double drives whose records show little, and those on which something is named.
fn double_drives(runs: std::ops::Range<u64>) -> Value {
    let of = runs.end - runs.start;
    let runs: Vec<u64> = runs.collect();
    let names = hal_sim::parallel::on_all_cores(&runs, |run| named(*run));
    let alarms = runs.iter().zip(names).filter(|(run, names)| {
        if !names.is_empty() {
            eprintln!("clean double drive {run}: {names:?}");
        }
        !names.is_empty()
    });
    json!({ "runs": of, "false_alarms": alarms.count() })
}

/// Clean machines of so many of each kind: motors, feed axes, double drives from a first one on.
pub(super) fn measure(first: u64, [of_motors, of_axes, of_drives]: [u64; 3]) -> Value {
    json!({
        "motor": motors(of_motors),
        "feed_axis": axes(of_axes),
        "double_drive": double_drives(first..first + of_drives),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nothing_is_named_on(run: u64) {
        let names = named(run);
        assert!(
            names.is_empty(),
            "on clean machine {run} nothing is to be named, found {names:?}"
        );
    }

    /// At one speed the voltage that a record reads beside the mean one repeats with the torque's ripple: it was a flux
    /// harmonic of order 6.
    #[test]
    fn the_voltage_between_two_steps_of_a_reference_is_no_flux_harmonic() {
        nothing_is_named_on(8);
    }

    /// The encoder's noise drew the inertia to the bound of its tolerance, and that made the torque's own ripple another one.
    #[test]
    fn an_inertia_that_noise_has_moved_is_no_harmonic() {
        nothing_is_named_on(6);
    }

    /// What the nut's encoder rounds while it rests was an error of the lead.
    #[test]
    fn what_a_resting_encoder_rounds_is_no_lead_error() {
        nothing_is_named_on(33);
    }

    /// Both records have one speed, at which the rounding of the encoder is a line of an order, or of a frequency.
    #[test]
    fn the_rounding_at_one_speed_is_no_order() {
        nothing_is_named_on(92);
        nothing_is_named_on(252);
    }

    /// Sharp friction that was taken for rounded was told with a friction that decays and a curve without a name.
    #[test]
    fn sharp_friction_needs_no_curve_without_a_name() {
        nothing_is_named_on(97);
    }
}
