//! Time of a step. Run with `cargo test --release -p plant --test timing -- --ignored --nocapture`.

use plant::Axis;
use plant::machine::{Bridge, Coupling, Machine};
use plant::model::Model;
use std::hint::black_box;
use std::time::Instant;

fn nanoseconds_per_step(model: &Model, coupling: Coupling, nut_speed_v: f64) -> f64 {
    let mut machine = Machine::new(model, coupling);
    machine.set_load_force(0.0);
    let steps = 1_000_000;
    let start = Instant::now();
    for k in 0..steps {
        if k % 2 == 0 {
            let angle = 5.0 * 40.0 * machine.time();
            let (s, c) = angle.sin_cos();
            machine.set_bridge(
                Axis::Screw,
                Bridge::Driven([-24.0 * s, 12.0 * s + 20.0 * c, 12.0 * s - 20.0 * c]),
            );
            machine.set_bridge(
                Axis::Nut,
                Bridge::Driven([-nut_speed_v * s, nut_speed_v * c, 0.0]),
            );
        }
        machine.advance(25e-6);
    }
    black_box(&machine);
    start.elapsed().as_secs_f64() * 1e9 / f64::from(steps)
}

#[test]
#[ignore = "prints figures; meant for a release build on an idle machine"]
fn step_time() {
    for (name, model, coupling, volts) in [
        ("lumped", Model::paper(), Coupling::Lumped, 24.0),
        (
            "coupled, turning",
            Model::coupled(),
            Coupling::Coupled,
            24.0,
        ),
        (
            "coupled, nut at rest",
            Model::coupled(),
            Coupling::Coupled,
            0.0,
        ),
    ] {
        println!(
            "{name}: {:.0} ns per step",
            nanoseconds_per_step(&model, coupling, volts)
        );
    }
}
