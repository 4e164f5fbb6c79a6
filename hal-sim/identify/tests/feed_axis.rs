//! A feed axis whose friction is another in the check record.

use identify::machines::feed_axis::{Axis, Law, OwnFriction, Record, Study, Term};
use identify::records::DataQuality;
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

const RATE: f64 = 1000.0;
/// Turns of the screw a second, of strokes of a second each: steps of the speed that the output can follow.
const STROKES: [f64; 8] = [5.0, -7.5, 2.5, -1.25, 6.25, -5.0, 1.75, -1.75];

/// What the loop makes of an axis over the strokes twice, with noise of 0.5 N.
fn record(axis: &Axis, seed: u64) -> Record {
    let mut at = 0.0;
    let reference: Vec<f64> = (0..2 * STROKES.len() * RATE as usize)
        .map(|k| {
            at += axis.lead_m * STROKES[k / RATE as usize % STROKES.len()] / RATE;
            at
        })
        .collect();
    let mut record = Record::to_follow(reference, RATE);
    let run = axis.simulate(&record);
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut noise = || 12f64.sqrt() * (random.random::<f64>() - 0.5);
    let output = run.force.iter();
    record.output = output.map(|f| (f + 0.5 * noise()) / 35.0).collect();
    record.position = run.position;
    record
}

/// What is said of a check record that has so much more viscous friction, N s/m.
fn own(seed: u64, more: f64) -> Option<OwnFriction> {
    let axis = Axis {
        law: Law::Difference(2),
        ..Axis::published()
    };
    let mut other = axis.clone();
    other.base[1] += more;
    let [fit, check] = [record(&axis, seed), record(&other, 1000 + seed)];
    Study::new(&axis, &fit, &check).own_friction
}

#[test]
fn another_viscous_friction_of_the_check_record_is_told() {
    let found = own(1, 30.0).expect("15 % more viscous friction is told");
    let [by, sigma] = found.changes[0];
    assert!(
        (by - 30.0).abs() < 3.0 * sigma && sigma < 8.0,
        "{by} +- {sigma} N s/m found, 30 there"
    );
    let sentence = found.sentence([203.0, 20.0]);
    assert!(
        sentence.contains("viscous friction by +"),
        "{sentence}: expected viscous friction"
    );
}

#[test]
fn the_same_friction_is_not_told_to_differ() {
    let told = (2..6).filter(|seed| own(*seed, 0.0).is_some()).count();
    assert_eq!(told, 0, "of 4 records with the friction of the fit record");
}

/// The model that a report leaves is declared for the next one.
#[test]
fn what_the_declared_model_has_is_no_finding() {
    let axis = Axis {
        law: Law::Difference(2),
        terms: vec![(Term::Asymmetry, vec![-30.0])],
        ..Axis::published()
    };
    let [fit, check] = [record(&axis, 7), record(&axis, 8)];
    let study = Study::new(&axis, &fit, &check);
    let report = identify::report::feed_axis(
        &study,
        &fit,
        [DataQuality::default(), DataQuality::default()],
    );
    let kinds: Vec<&str> = report
        .effects
        .iter()
        .map(|effect| effect.kind.as_str())
        .collect();
    assert!(kinds.is_empty(), "{kinds:?} are in the declared model");
}
