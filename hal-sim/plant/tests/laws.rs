//! Each effect by its law in closed form, at several orders, frequencies, phases and durations: a parameter that the
//! machine ignored would show. The shafts are so heavy that a measurement does not move them.

use plant::Axis;
use plant::effects::{self, AnyEffect, EffectModel, Place};
use plant::machine::{Bridge, Coupling, Machine};
use plant::model::Model;
use std::f64::consts::TAU;

const DT: f64 = 25e-6;
const PHASES: [f64; 3] = [0.0, 0.7, -2.0];

/// A machine without friction, load or harmonics, whose shafts keep their speed.
fn heavy(inertia: f64) -> Model {
    let mut model = Model::coupled();
    for axis in Axis::ALL {
        let motor = model.motor_mut(axis);
        motor.torque_harmonics.clear();
        motor.coulomb_nm = 0.0;
        motor.viscous_nm_s = 0.0;
        motor.inertia_kg_m2 = inertia;
    }
    model.feed.guideway_coulomb_n = 0.0;
    model.feed.pair_coulomb_nm = 0.0;
    model.feed.load_n = 0.0;
    model
}

fn with(mut model: Model, place: Place, effect: impl Into<AnyEffect>) -> Model {
    let effect = EffectModel::new(place, effect).expect("the kind fits the place");
    model.effects.push(effect);
    model
}

#[track_caller]
fn near(what: &str, measured: f64, expected: f64, tolerance: f64) {
    let off = (measured - expected).abs();
    assert!(
        off <= tolerance,
        "{what}: measured {measured}, the law gives {expected}; off by {off:e}, allowed {tolerance:e}"
    );
}

/// Torques on the two shafts over the next step, N m.
fn torques(machine: &mut Machine, model: &Model) -> [f64; 2] {
    let before = Axis::ALL.map(|axis| machine.motor(axis).omega);
    machine.advance(DT);
    let after = Axis::ALL.map(|axis| machine.motor(axis).omega);
    let inertia = Axis::ALL.map(|axis| model.motor(axis).inertia_kg_m2);
    [0, 1].map(|k| (after[k] - before[k]) / DT * inertia[k])
}

/// Brings a shaft to a speed within one step.
fn spin(machine: &mut Machine, model: &Model, axis: Axis, omega: f64) {
    machine.set_disturbance_torque(axis, omega / DT * model.motor(axis).inertia_kg_m2);
    machine.advance(DT);
    machine.set_disturbance_torque(axis, 0.0);
}

#[test]
fn a_torque_over_time_has_its_frequency_and_phase() {
    for hz in [7.0, 50.0, 333.0] {
        for phase in PHASES {
            let effect = effects::TimePeriodic {
                hz,
                amplitude: 0.1,
                phase,
            };
            let model = with(heavy(1e3), Place::Nut, effect);
            let mut machine = Machine::new(&model, Coupling::Lumped);
            for _ in 0..400 {
                let time = machine.time() + 0.5 * DT;
                let [screw, nut] = torques(&mut machine, &model);
                let what = format!("nut's torque at {time} s, {hz} Hz, phase {phase}, N m");
                near(&what, nut, 0.1 * (TAU * hz * time + phase).cos(), 1e-9);
                near("the screw has nothing, N m", screw, 0.0, 1e-12);
            }
        }
    }
}

#[test]
fn an_effect_at_both_places_is_at_each() {
    let effect = effects::Cogging {
        order: 4.0,
        amplitude: 0.1,
        phase: 0.3,
    };
    let model = with(heavy(1e3), Place::Both, effect);
    let mut machine = Machine::new(&model, Coupling::Lumped);
    for (axis, theta) in Axis::ALL.into_iter().zip([0.9, 0.2]) {
        machine.set_motor_angle(axis, theta);
    }
    let torque = torques(&mut machine, &model);
    for (k, theta) in [0.9f64, 0.2].into_iter().enumerate() {
        let expected = 0.1 * (4.0 * theta + 0.3).cos();
        near(
            &format!("torque of shaft {k}, N m"),
            torque[k],
            expected,
            1e-9,
        );
    }
}

/// Torque of a held shaft per the plain machine's, with the same settled current.
fn torque_ratio(effect: impl Into<AnyEffect>, theta: f64, seconds: f64) -> f64 {
    let measure = |model: &Model| {
        let mut machine = Machine::new(model, Coupling::Lumped);
        machine.set_motor_angle(Axis::Screw, theta);
        machine.set_bridge(Axis::Screw, Bridge::Driven([3.0, 1.0, -4.0]));
        let steps = (seconds / DT).round() as usize;
        (1..steps).for_each(|_| machine.advance(DT));
        torques(&mut machine, model)[0]
    };
    measure(&with(heavy(1e3), Place::Screw, effect)) / measure(&heavy(1e3))
}

/// Back-EMF at a speed per the plain machine's, by the current that it drives through a great resistance, and the angle
/// at which it was.
fn emf_ratio(effect: impl Into<AnyEffect>, theta: f64) -> (f64, f64) {
    let measure = |mut model: Model| {
        model.screw.resistance_ohm = 1e3;
        model.screw.inductance_h = 1e-6;
        let mut machine = Machine::new(&model, Coupling::Lumped);
        machine.set_motor_angle(Axis::Screw, theta);
        machine.set_bridge(Axis::Screw, Bridge::Driven([0.0; 3]));
        spin(&mut machine, &model, Axis::Screw, 10.0);
        machine.advance(DT);
        let state = machine.motor(Axis::Screw);
        (
            state.i_alpha.hypot(state.i_beta),
            state.theta - 0.5 * DT * state.omega,
        )
    };
    let (plain, angle) = measure(heavy(1e3));
    (
        measure(with(heavy(1e3), Place::Screw, effect)).0 / plain,
        angle,
    )
}

#[test]
fn a_flux_harmonic_shapes_torque_and_emf_over_the_electrical_angle() {
    let pole_pairs = f64::from(heavy(1.0).screw.pole_pairs);
    for order in [1.0, 6.0, 12.0, 2.5] {
        for phase in PHASES {
            for theta in [0.0, 0.3, 1.1] {
                let effect = effects::FluxHarmonic {
                    order,
                    amplitude: 0.1,
                    phase,
                };
                let law = |theta: f64| 1.0 + 0.1 * (order * pole_pairs * theta + phase).cos();
                let what = format!("order {order}, phase {phase}, {theta} rad");
                near(
                    &format!("torque ratio, {what}"),
                    torque_ratio(effect, theta, 0.02),
                    law(theta),
                    1e-5,
                );
                let (emf, angle) = emf_ratio(effect, theta);
                near(&format!("EMF ratio, {what}"), emf, law(angle), 1e-5);
            }
        }
    }
}

#[test]
fn flux_and_resistance_drift_over_their_time() {
    for duration_s in [0.01, 0.04] {
        for seconds in [0.005, 0.01, 0.02, 0.06] {
            let grown = |time: f64| 0.2 * (time / duration_s).min(1.0);
            let what = format!("after {seconds} s of {duration_s} s");
            let flux = effects::FluxDrift {
                value: 0.2,
                duration_s,
            };
            let ratio = torque_ratio(flux, 0.3, seconds);
            near(
                &format!("torque ratio, {what}"),
                ratio,
                1.0 + grown(seconds - 0.5 * DT),
                1e-5,
            );

            let resistance = effects::ResistanceDrift {
                value: 0.2,
                duration_s,
            };
            let mut model = with(heavy(1e3), Place::Screw, resistance);
            model.screw.inductance_h = 1e-9;
            let mut machine = Machine::new(&model, Coupling::Lumped);
            machine.set_bridge(Axis::Screw, Bridge::Driven([3.0, 0.0, -3.0]));
            let steps = (seconds / DT).round() as usize;
            (0..steps).for_each(|_| machine.advance(DT));
            let ratio = 3.0 / model.screw.resistance_ohm / machine.phase_currents(Axis::Screw)[0];
            near(
                &format!("resistance ratio, {what}"),
                ratio,
                1.0 + grown(seconds - 0.5 * DT),
                1e-5,
            );
        }
    }
}

#[test]
fn ball_passage_goes_with_the_relative_angle() {
    for order in [1.0, 11.3] {
        for phase in PHASES {
            for angles in [[0.9, 0.2], [0.1, 2.0]] {
                let effect = effects::BallPassage {
                    order,
                    amplitude: 0.1,
                    phase,
                };
                let model = with(heavy(1e3), Place::Feed, effect);
                let mut machine = Machine::new(&model, Coupling::Coupled);
                for (axis, theta) in Axis::ALL.into_iter().zip(angles) {
                    machine.set_motor_angle(axis, theta);
                }
                let expected = 0.1 * (order * (angles[0] - angles[1]) + phase).cos();
                let [screw, nut] = torques(&mut machine, &model);
                let what = format!("order {order}, phase {phase}, angles {angles:?}, N m");
                near(&format!("screw, {what}"), screw, -expected, 1e-9);
                near(&format!("nut, {what}"), nut, expected, 1e-9);
            }
        }
    }
}

#[test]
fn a_lead_error_works_back_on_the_shafts_by_its_slope() {
    const LOAD_N: f64 = 400.0;
    for order in [1.0, 3.0] {
        for phase in PHASES {
            let effect = effects::LeadError {
                order,
                amplitude: 1e-4,
                phase,
            };
            let mut model = with(heavy(1e3), Place::Feed, effect);
            model.feed.load_n = LOAD_N;
            model.feed.guideway_viscous_n_s_per_m = 1e4;
            let mut machine = Machine::new(&model, Coupling::Coupled);
            machine.set_motor_angle(Axis::Screw, 0.7);
            (0..8000).for_each(|_| machine.advance(DT));
            near(
                "axial force, N",
                machine.axial_force(),
                LOAD_N,
                0.01 * LOAD_N,
            );
            let slope = model.feed.travel_per_radian() - 1e-4 * order * (order * 0.7 + phase).sin();
            let force = machine.axial_force();
            let [screw, nut] = torques(&mut machine, &model);
            let what = format!("order {order}, phase {phase}, N m");
            near(&format!("screw, {what}"), screw, -slope * force, 1e-4);
            near(&format!("nut, {what}"), nut, slope * force, 1e-4);
        }
    }
}

#[test]
fn stribeck_friction_decays_with_the_speed_of_its_surface() {
    for speed in [0.5, 3.0] {
        for share in [0.3, 1.0, 2.0] {
            let effect = effects::StribeckFriction {
                amplitude: 0.2,
                speed,
            };
            let mut model = with(heavy(1.0), Place::Nut, effect);
            model.nut.coulomb_nm = 0.05;
            let mut machine = Machine::new(&model, Coupling::Lumped);
            spin(&mut machine, &model, Axis::Nut, -share * speed);
            // The first step after the spin still predicts by its acceleration.
            machine.advance(DT);
            let level = 0.05 + 0.2 * (-share * share).exp();
            let what = format!("bearing at {share} of {speed} rad/s, N m");
            near(&what, torques(&mut machine, &model)[1], level, 1e-4);
        }
    }
    for speed in [2e-3, 8e-3] {
        for share in [0.5, 1.0, 1.5] {
            let effect = effects::StribeckFriction {
                amplitude: 30.0,
                speed,
            };
            let mut model = with(heavy(1e3), Place::Feed, effect);
            model.feed.guideway_coulomb_n = 20.0;
            model.feed.guideway_viscous_n_s_per_m = 5e4;
            let mut machine = Machine::new(&model, Coupling::Coupled);
            let velocity = share * speed;
            spin(
                &mut machine,
                &model,
                Axis::Screw,
                velocity / model.feed.travel_per_radian(),
            );
            (0..4000).for_each(|_| machine.advance(DT));
            near(
                "table velocity, m/s",
                machine.table_velocity(),
                velocity,
                1e-3 * velocity,
            );
            let friction = machine.axial_force() - 5e4 * machine.table_velocity();
            let level = 20.0 + 30.0 * (-share * share).exp();
            near(
                &format!("guideway at {share} of {speed} m/s, N"),
                friction,
                level,
                0.05,
            );
        }
    }
}

#[test]
fn an_eccentric_encoder_reads_by_its_order_and_phase() {
    for order in [1.0, 2.0] {
        for phase in PHASES {
            let effect = effects::EncoderEccentricity {
                order,
                amplitude: 1e-3,
                phase,
            };
            let mut machine =
                Machine::new(&with(heavy(1.0), Place::Screw, effect), Coupling::Lumped);
            for theta in [0.0, 0.4, 2.9, -7.0] {
                machine.set_motor_angle(Axis::Screw, theta);
                let expected = theta + 1e-3 * (order * theta + phase).sin();
                let what = format!("reading at {theta} rad, order {order}, phase {phase}, rad");
                near(&what, machine.encoder_angle(Axis::Screw), expected, 1e-12);
            }
        }
    }
}
