//! Time of one integration step of both motors at 25 us, harmonics on.

use criterion::{Criterion, criterion_group, criterion_main};
use plant::Axis;
use plant::effects::{DeadTime, EffectModel, Place};
use plant::machine::{Bridge, Coupling, Machine};
use plant::model::Model;
use std::hint::black_box;

const DT: f64 = 25e-6;

/// One electrical turn of voltages at 40 rad/s, amplitude in V, one for each step.
fn turning(amplitude: f64) -> Vec<Bridge> {
    let electrical = 5.0 * 40.0;
    let steps = (std::f64::consts::TAU / (electrical * DT)) as usize;
    let at = |k: usize| {
        let (s, c) = (electrical * DT * k as f64).sin_cos();
        let side = 0.75f64.sqrt() * c;
        Bridge::Driven([-s, 0.5 * s + side, 0.5 * s - side].map(|x| amplitude * x))
    };
    (0..steps).map(at).collect()
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
        let mut bridges = turning(24.0).into_iter().zip(turning(nut)).cycle();
        c.bench_function(name, |bench| {
            bench.iter(|| {
                if let Some((screw, nut)) = bridges.next() {
                    machine.set_bridge(Axis::Screw, screw);
                    machine.set_bridge(Axis::Nut, nut);
                }
                machine.advance(black_box(DT));
            });
        });
    }
}

criterion_group!(benches, step);
criterion_main!(benches);
