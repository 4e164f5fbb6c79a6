//! Time of one integration step of both motors at 25 us, harmonics on.

use criterion::{Criterion, criterion_group, criterion_main};
use plant::Axis;
use plant::effects::{DeadTime, EffectModel, Place};
use plant::machine::{Bridge, Coupling, Machine};
use plant::model::Model;
use std::hint::black_box;

const DT: f64 = 25e-6;

/// Voltages, amplitude in V, that turn a motor at 40 rad/s.
fn turning(time: f64, amplitude: f64) -> Bridge {
    let (s, c) = (5.0 * 40.0 * time).sin_cos();
    let side = 0.75f64.sqrt() * c;
    Bridge::Driven([-s, 0.5 * s + side, 0.5 * s - side].map(|x| amplitude * x))
}

fn step(c: &mut Criterion) {
    let mut lossy = Model::coupled();
    lossy
        .effects
        .extend(EffectModel::new(Place::Both, DeadTime { value: 3.0 }));
    for (name, model, coupling, nut) in [
        ("lumped", Model::paper(), Coupling::Lumped, 24.0),
        (
            "coupled, both turning",
            Model::coupled(),
            Coupling::Coupled,
            24.0,
        ),
        (
            "coupled, nut sticking",
            Model::coupled(),
            Coupling::Coupled,
            0.0,
        ),
        ("coupled, dead time", lossy, Coupling::Coupled, 24.0),
    ] {
        let mut machine = Machine::new(&model, coupling);
        machine.set_load_force(0.0);
        c.bench_function(name, |bench| {
            bench.iter(|| {
                machine.advance(black_box(DT));
                // The bridges change every second step, as at 20 kHz; setting them is part of a run.
                if machine.time() % (2.0 * DT) < DT {
                    machine.set_bridge(Axis::Screw, turning(machine.time(), 24.0));
                    machine.set_bridge(Axis::Nut, turning(machine.time(), nut));
                }
            });
        });
    }
}

criterion_group!(benches, step);
criterion_main!(benches);
