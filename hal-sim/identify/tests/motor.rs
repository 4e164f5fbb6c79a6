//! A bare motor whose orders are known, from its record to the report.

use identify::machines::motor::{MotorModel, Record, Study};
use identify::records::DataQuality;
use identify::report::{Report, motor};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::TAU;

const RATE: f64 = 1000.0;
/// Orders per turn, amplitude, A, and phase, rad.
const WAVES: [(f64, f64, f64); 3] = [(36.0, 0.2, 0.5), (12.0, 0.05, -2.0), (7.0, 0.03, 1.2)];

/// A motor that turns about once a second, with noise of which `kept` is kept from row to row, and something more in its
/// current over time and angle.
fn record(seed: u64, kept: f64, more: impl Fn(f64, f64) -> f64) -> Record {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut noise = 0.0;
    let (mut position, mut current) = (Vec::new(), Vec::new());
    for k in 0..(6.0 * RATE) as usize {
        let t = k as f64 / RATE;
        let theta = 6.3 * t + 0.2 * (1.7 * t).sin();
        let new = 12f64.sqrt() * (random.random::<f64>() - 0.5);
        noise = kept * noise + 0.01 * (1.0 - kept * kept).sqrt() * new;
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
        account: DataQuality::default(),
    }
}

#[test]
fn the_truth_is_in_the_intervals_as_often_as_they_promise() {
    const TRIALS: u64 = 25;
    let (mut inside, mut of) = (0, 0);
    for seed in 0..TRIALS {
        let [fit, check] = [2 * seed, 2 * seed + 1].map(|seed| record(seed, 0.9, |_, _| 0.0));
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

/// What the report says is left of a motor with something more in its current.
fn left(more: impl Fn(f64, f64) -> f64) -> Report {
    let [fit, check] = [1, 2].map(|seed| record(seed, 0.0, &more));
    let study = Study::new(&fit, &check, None);
    motor(&study, MotorModel { pole_pairs: 6 }, Default::default())
}

#[test]
fn what_orders_explain_leaves_nothing_in_noise() {
    let report = left(|_, _| 0.0);
    assert_eq!(report.verdict, "explained");
    assert!(report.unexplained.is_empty(), "{:?}", report.unexplained);
}

#[test]
fn what_no_whole_order_has_is_told_by_what_it_looks_like() {
    let report = left(|_, theta| 0.03 * (17.4 * theta + 0.3).cos());
    assert_eq!(report.verdict, "partly explained");
    let wave = &report.unexplained[0];
    assert_eq!(
        (wave.channel.as_str(), wave.unit.as_str()),
        ("current", "A")
    );
    assert_eq!(wave.coordinate, "angle of the motor");
    assert!((wave.order.unwrap() - 17.4).abs() < 0.03, "{wave:?}");
    assert!(
        (wave.size / (0.03 / 2f64.sqrt()) - 1.0).abs() < 0.2,
        "{wave:?}"
    );

    let report = left(|t, _| 0.03 * (TAU * 31.7 * t).cos());
    let hum = &report.unexplained[0];
    assert_eq!((hum.coordinate.as_str(), hum.order), ("time", None));
    assert!((hum.hz.unwrap() - 31.7).abs() < 0.03, "{hum:?}");
}

#[test]
fn an_inertia_is_found_up_to_the_filters_band() {
    const INERTIA: f64 = 2e-4;
    // A ripple of the speed at 80 Hz, of which a 100 Hz filter leaves nine tenths: both sides pass it once.
    let [fit, check] = [1, 2].map(|seed| {
        let mut record = record(seed, 0.0, |_, _| 0.0);
        let swings = |k: usize| {
            let t = k as f64 / RATE;
            [80.0, 33.0].map(|hz: f64| {
                let phase = TAU * hz * t + 0.4 * (0.9 * t).sin();
                (phase, TAU * hz)
            })
        };
        for k in 0..record.position.len() {
            for (phase, w) in swings(k) {
                let rate = w + 0.4 * 0.9 * (0.9 * k as f64 / RATE).cos();
                let acceleration = 1000.0;
                record.position[k] -= acceleration / (w * w) * phase.cos();
                record.current[k] += INERTIA * acceleration * (rate / w).powi(2) * phase.cos();
            }
        }
        record
    });
    let study = Study::new(&fit, &check, None);
    let found = study.after.values[0];
    assert!(
        (found / INERTIA - 1.0).abs() < 0.03,
        "{found} A s^2/rad found, {INERTIA} there: expected within 3 %"
    );
}
