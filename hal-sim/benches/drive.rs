//! How fast the whole two-motor drive is simulated, and where the time goes: a period is two current loops, two board
//! turns (eight conversions with noise, two encoders) and two integration steps; every fourth has a speed step.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use hal_sim::experiment::{OperatingPoint, RPM, Setup, settle_quietly};
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;
use std::hint::black_box;

const CREEP: OperatingPoint = OperatingPoint {
    velocity: 2.5e-3,
    base: 300.0 * RPM,
};

fn drive(c: &mut Criterion) {
    let mut group = c.benchmark_group("one PWM period of the whole drive");
    // 20 000 periods are a simulated second: elements per second over 20 000 are simulated seconds per second.
    group.throughput(Throughput::Elements(1));
    for (name, model, coupling) in [
        ("paper", Model::paper(), Coupling::Lumped),
        ("coupled", Model::coupled(), Coupling::Coupled),
    ] {
        let mut drive = Setup::real(model, coupling).drive().unwrap();
        settle_quietly(&mut drive, CREEP).unwrap();
        group.bench_function(name, |b| b.iter(|| drive.period()));
    }
    group.finish();
}

fn parts(c: &mut Criterion) {
    let setup = Setup::real(Model::coupled(), Coupling::Coupled);
    let mut drive = setup.drive().unwrap();
    settle_quietly(&mut drive, CREEP).unwrap();

    let mut group = c.benchmark_group("parts of a period");
    let mut board = drive.board.clone();
    group.bench_function("integration step of the machine", |b| {
        b.iter(|| board.advance())
    });
    let mut board = drive.board.clone();
    group.bench_function("board turn: compares taken, sensors read", |b| {
        b.iter(|| board.turn(black_box(Axis::Screw)))
    });
    group.finish();
}

criterion_group!(benches, drive, parts);
criterion_main!(benches);
