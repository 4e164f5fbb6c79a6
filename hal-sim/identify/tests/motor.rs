//! A bare motor whose orders are known, from its record to the report.

use identify::load::Account;
use identify::motor::{MotorModel, Record, Study};
use identify::report::motor;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

const RATE: f64 = 1000.0;
/// Orders per turn, amplitude, A, and phase, rad.
const WAVES: [(f64, f64, f64); 3] = [(36.0, 0.2, 0.5), (12.0, 0.05, -2.0), (7.0, 0.03, 1.2)];

/// A motor that turns about once a second, with noise that has memory, and something more in its current.
fn record(seed: u64, seconds: f64, more: impl Fn(f64, f64) -> f64) -> Record {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut noise = 0.0;
    let (mut position, mut current) = (Vec::new(), Vec::new());
    for k in 0..(seconds * RATE) as usize {
        let t = k as f64 / RATE;
        let theta = 6.3 * t + 0.2 * (1.7 * t).sin();
        let new: f64 = StandardNormal.sample(&mut random);
        noise = 0.9 * noise + 0.004 * new;
        let waves: f64 = WAVES
            .iter()
            .map(|(order, amplitude, phase)| amplitude * (order * theta + phase).cos())
            .sum();
        position.push(theta);
        current.push(0.3 + waves + noise + more(t, theta));
    }
    Record {
        rate: RATE,
        position,
        current,
        account: Account::default(),
    }
}

#[test]
fn the_truth_is_in_the_intervals_as_often_as_they_promise() {
    const TRIALS: u64 = 40;
    let (mut inside, mut of) = (0, 0);
    for seed in 0..TRIALS {
        let [fit, check] = [2 * seed, 2 * seed + 1].map(|seed| record(seed, 6.0, |_, _| 0.0));
        let study = Study::new(&fit, &check, None);
        let report = motor(&study, MotorModel { pole_pairs: 6 }, Default::default());
        for (order, amplitude, phase) in WAVES {
            let effect = report
                .effects
                .iter()
                .find(|effect| effect.order == Some(order))
                .expect("each order is found");
            for (name, truth) in [("order", order), ("amplitude", amplitude), ("phase", phase)] {
                let [low, high] = effect.interval[name];
                inside += u32::from(low <= truth && truth <= high);
                of += 1;
            }
        }
    }
    let covered = f64::from(inside) / f64::from(of);
    println!("{inside} of {of}");
    assert!((0.91..=0.99).contains(&covered), "{covered}");
}
