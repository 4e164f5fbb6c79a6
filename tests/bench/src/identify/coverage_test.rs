//! Intervals of parameters in which a record is not linear: a resonance, an order, a frequency, a gain.

use crate::draw::draw;
use identify::analysis::analyse;
use identify::conclusion::interval::estimates;

/// Standard deviations that a value may be off by: chance exceeds them once in 370 times.
const SURE: f64 = 3.0;

/// Holds a parameter of the first effect of a drawn machine against its interval.
fn holds(seed: u64, kinds: &[&str], parameter: &str) {
    let machine = draw(seed, kinds);
    let (kind, effect) = (kinds[0], &machine.effects[0]);
    let drawn = effect.effect().parameters();
    let (_, truth) = drawn.iter().find(|(name, _)| name == parameter).unwrap();
    let outcome = analyse(&machine.declared, &machine.fit, &machine.check);
    let found: Vec<_> = outcome.effects.iter().map(|f| &f.effect).collect();
    let own = outcome
        .effects
        .iter()
        .find(|f| f.effect.effect().kind() == kind);
    let own = own.unwrap_or_else(|| panic!("{seed} has {effect:?}, found {found:?}"));
    let all = estimates(own);
    let estimate = all.iter().find(|known| known.name == parameter).unwrap();
    let [low, high] = estimate.interval;
    let sigma = (high - low) / (2.0 * 1.96);
    let off = (estimate.value - truth).abs() / sigma;
    println!(
        "{seed} {kind} {parameter}: {} of {truth}, {low} to {high}, {off:.1} sigma",
        estimate.value
    );
    assert!(
        off < SURE,
        "{seed}: {kind} has {parameter} {truth}, found {} ({low} to {high}): {off:.1} standard deviations off, expected less \
         than {SURE}",
        estimate.value
    );
    assert!(
        sigma < 0.02 * truth.abs(),
        "{seed}: {parameter} {truth} is told to {sigma} only"
    );
}

/// Its damping and the instants at which the sensors are read shift a resonance that is taken for linear in them.
#[test]
fn a_resonance_is_within_its_interval() {
    holds(70_035, &["axial_compliance"], "hz");
}

/// Near the declared resonance the encoders' rounding, which a soft screw amplifies, drew it towards the stiffer one: by five standard
/// deviations.
#[test]
fn a_resonance_near_the_declared_one_is_within_its_interval() {
    holds(600_154, &["axial_compliance"], "hz");
}

/// Both angles are read at instants of their own, so that their difference depends on the base speed.
#[test]
fn an_order_of_screw_against_nut_is_within_its_interval() {
    holds(70_018, &["ball_passage"], "order");
}

/// A search ends on a grid that is coarser than what the record tells.
#[test]
fn a_frequency_is_within_its_interval() {
    holds(70_051, &["time_periodic"], "hz");
}

/// The gain is a share of the current, and what is read of it has the gain in it.
#[test]
fn a_gain_of_a_current_sensor_is_within_its_interval() {
    holds(70_002, &["current_gain"], "gain_a");
}
