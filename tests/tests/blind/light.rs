//! Motors so light that the rounding of their encoders, times the inertia, is as loud as a ripple of the torque. An encoder
//! that turns evenly has that rounding in a few lines.

use bench::draw::profile::Profile;
use identify::analysis::analyse;
use identify::conclusion::outcome::Outcome;
use identify::conclusion::verdict::Verdict;
use plant::Axis;
use plant::machine::Machine as Plant;
use plant::model::Model;

/// Cogging's order a turn.
const ORDER: f64 = 24.0;

/// A pair of small motors with encoders of 17 bits on a small axis.
fn light() -> Model {
    let mut model = Model::paper();
    for motor in [&mut model.screw, &mut model.nut] {
        motor.resistance_ohm = 0.72;
        motor.inductance_h = 0.4e-3;
        motor.flux_wb = 0.007_83;
        motor.inertia_kg_m2 = 3e-5;
        motor.viscous_nm_s = 1e-5;
        motor.coulomb_nm = 0.01;
        motor.torque_harmonics.clear();
    }
    model.feed.table_mass_kg = 20.0;
    model.feed.guideway_coulomb_n = 20.0;
    model.feed.guideway_viscous_n_s_per_m = 400.0;
    model.feed.pair_coulomb_nm = 0.005;
    model.feed.load_n = 40.0;
    model.installation.bus_v = 36.0;
    model.sensing.encoder_counts_per_turn = 131_072;
    model.sensing.current_lsb_a = 10.0 / 2048.0;
    model.sensing.current_noise_a = 0.004;
    model
}

/// What is identified of the pair whose nut cogs by `amplitude`, N m.
fn identified(amplitude: f64) -> Outcome {
    let cogs = |machine: &mut Plant| {
        let angle = machine.motor(Axis::Nut).theta;
        machine.set_disturbance_torque(Axis::Nut, amplitude * (ORDER * angle).cos());
    };
    let fit = [
        (2.5, 0.0, 3.0),
        (-2.5, 0.0, 3.0),
        (2.5, 300.0, 3.0),
        (-5.0, 300.0, 3.0),
        (8.0, 600.0, 3.0),
        (2.5, 150.0, 3.0),
        (-2.5, -300.0, 3.0),
    ];
    let check = [
        (3.5, 0.0, 3.0),
        (-2.0, 200.0, 3.0),
        (6.0, 450.0, 3.0),
        (-3.0, -200.0, 3.0),
    ];
    let profiles = [Profile::of(0.0, &fit), Profile::of(0.0, &check)];
    let machine = bench::draw::as_declared(light(), 5, &cogs, profiles);
    analyse(&machine.declared, &machine.fit, &machine.check)
}

#[test]
fn the_rounding_of_a_light_motors_encoder_is_nothing_that_is_missing() {
    let outcome = identified(0.0);
    assert!(outcome.effects.is_empty(), "{:?}", outcome.effects);
    let judged = outcome.judged();
    assert_eq!(judged.verdict, Verdict::NothingMissing, "{:?}", judged.said);
}

#[test]
fn a_light_motors_cogging_is_found_beside_the_rounding() {
    const AMPLITUDE: f64 = 8e-3;
    let outcome = identified(AMPLITUDE);
    let judged = outcome.judged();
    assert_eq!(judged.verdict, Verdict::Explained, "{:?}", judged.said);
    let effects: Vec<_> = outcome.effects.iter().map(|found| &found.effect).collect();
    let [effect] = &effects[..] else {
        panic!("{effects:?}")
    };
    let parameters = effect.effect().parameters();
    let value = |name: &str| {
        parameters
            .iter()
            .find(|(own, _)| own == name)
            .expect("a parameter")
            .1
    };
    let apart = value("amplitude") / AMPLITUDE - 1.0;
    assert!(apart.abs() < 0.02, "{effect:?}");
}
