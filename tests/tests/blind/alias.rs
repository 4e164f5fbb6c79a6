//! What repeats with the angle and what repeats in time are all but one at one speed: only the ripple of the speed itself
//! tells them apart, and a small effect not at all. Several speeds do.

use bench::draw::profile::{self, Profile};
use identify::analysis::{Found, analyse};
use plant::Axis;
use plant::machine::Machine as Plant;

const ORDER: f64 = 36.0;

/// What is found of a machine whose screw cogs, over given profiles.
fn found(amplitude: f64, profiles: [Profile; 2]) -> Vec<Found> {
    let cogs = |machine: &mut Plant| {
        let angle = machine.motor(Axis::Screw).theta;
        machine.set_disturbance_torque(Axis::Screw, amplitude * (ORDER * angle).cos());
    };
    let machine = bench::draw::acted_on(73, &cogs, profiles);
    let effects = analyse(&machine.declared, &machine.fit, &machine.check).effects;
    for found in &effects {
        println!("{:?}, not told from {:?}", found.effect, found.inseparable);
    }
    effects
}

#[test]
fn at_one_speed_a_small_ripple_of_the_angle_is_not_told_from_one_of_time() {
    let one_speed = || Profile::of(0.0, &[(2.5, 60.0, 8.0)]);
    let effects = found(1.3e-3, [one_speed(), one_speed()]);
    let [effect] = &effects[..] else {
        panic!("{} effects", effects.len())
    };
    let mut kinds = vec![effect.effect.effect().kind()];
    let rivals = effect.inseparable.iter().filter_map(|r| r.effect.as_ref());
    kinds.extend(rivals.map(|rival| rival.effect().kind()));
    assert!(
        kinds.contains(&"cogging") && kinds.contains(&"time_periodic"),
        "{kinds:?}"
    );
}

#[test]
fn at_several_speeds_it_is() {
    let effects = found(1e-2, [profile::recorded(), profile::slow()]);
    let [effect] = &effects[..] else {
        panic!("{} effects", effects.len())
    };
    assert_eq!(effect.effect.effect().kind(), "cogging");
    assert!(effect.inseparable.is_empty());
}
