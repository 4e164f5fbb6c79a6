//! What acts on a machine and is of no kind that the identification knows: it is described, and no cause is named.

use bench::draw::Machine;
use bench::draw::profile::{self, Profile};
use identify::analysis::{Outcome, Unexplained, analyse};
use identify::signal::channel::Channel;
use plant::Axis;
use plant::machine::Machine as Plant;
use plant::model::Model;

fn profiles() -> [Profile; 2] {
    [profile::recorded(), profile::slow()]
}

fn told(machine: &Machine) -> Outcome {
    let outcome = analyse(&machine.declared, &machine.fit, &machine.check);
    for found in &outcome.effects {
        println!("named: {:?}", found.effect);
    }
    for curve in &outcome.curves {
        println!("curve: {curve:?}");
    }
    for left in &outcome.unexplained {
        println!("left: {left:?}");
    }
    outcome
}

/// The nut's motor shakes the screw's: a torque on the one over the angle of the other.
#[test]
fn a_torque_over_the_other_motors_angle_is_described() {
    const AMPLITUDE: f64 = 0.04;
    const ORDER: f64 = 13.0;
    let shake = |machine: &mut Plant| {
        let angle = machine.motor(Axis::Nut).theta;
        machine.set_disturbance_torque(Axis::Screw, AMPLITUDE * (ORDER * angle).cos());
    };
    let outcome = told(&bench::draw::acted_on(71, &shake, profiles()));
    assert_eq!(outcome.verdict(), "unexplained");
    assert!(outcome.effects.is_empty());
    let left = &outcome.unexplained[0];
    assert_eq!(
        (left.channel, left.coordinate),
        (Channel::Torque(Axis::Screw), "angle of the nut")
    );
    let order = left.order.expect("it repeats");
    assert!((order - ORDER).abs() < 0.02, "order {order}");
    let rms = AMPLITUDE / 2f64.sqrt();
    assert!(
        (left.size / rms - 1.0).abs() < 0.25,
        "{} of {rms}",
        left.size
    );
}

/// The guideway is tight at one place.
#[test]
fn a_force_at_one_place_of_the_guideway_is_described() {
    let load = Model::coupled().feed.load_n;
    let squeeze = |machine: &mut Plant| {
        let (from, width) = (4e-3, 2e-3);
        let inside = ((machine.table_position() - from) / width).clamp(0.0, 1.0);
        let force = 30.0 * (std::f64::consts::PI * inside).sin().powi(2);
        machine.set_load_force(load + force * machine.table_velocity().signum());
    };
    let outcome = told(&bench::draw::acted_on(72, &squeeze, profiles()));
    // A measured curve without a cause explains a part.
    assert_eq!(outcome.verdict(), "partly explained");
    assert!(outcome.effects.is_empty());
    assert!(!outcome.curves.is_empty());
    let tight = |left: &Unexplained| {
        matches!(left.channel, Channel::Torque(_))
            && left.coordinate == "position of the table, against its motion"
    };
    assert!(outcome.unexplained.iter().any(tight));
}
