//! Each kind of effect changes what it should and nothing else.

use plant::Axis;
use plant::effects::{self, AnyEffect, EffectModel, Place};
use plant::machine::{Bridge, Coupling, Machine, MotorState};
use plant::model::Model;

const DT: f64 = 25e-6;

fn with(place: Place, effect: impl Into<AnyEffect>) -> Model {
    let mut model = Model::coupled();
    model
        .effects
        .push(EffectModel::new(place, effect).expect("the kind fits the place"));
    model
}

fn volts(time: f64) -> Bridge {
    let (s, c) = (100.0 * time).sin_cos();
    Bridge::Driven([-20.0 * s, 10.0 * s + 17.0 * c, 10.0 * s - 17.0 * c])
}

/// Everything that can be seen of a machine.
#[derive(Debug, Clone, PartialEq)]
struct Seen {
    states: [MotorState; 2],
    table: f64,
    readings: [[f64; 3]; 2],
    encoders: [f64; 2],
}

fn drive(model: &Model, steps: usize) -> Machine {
    let mut machine = Machine::new(model, Coupling::Coupled);
    machine.set_motor_angle(Axis::Screw, 0.9);
    machine.set_motor_angle(Axis::Nut, 0.2);
    for _ in 0..steps {
        let bridge = volts(machine.time());
        machine.set_bridge(Axis::Screw, bridge);
        machine.set_bridge(Axis::Nut, bridge);
        machine.advance(DT);
    }
    machine
}

fn see(machine: &Machine) -> Seen {
    Seen {
        states: Axis::ALL.map(|axis| machine.motor(axis)),
        table: machine.table_position(),
        readings: Axis::ALL.map(|axis| machine.current_readings(axis)),
        encoders: Axis::ALL.map(|axis| machine.encoder_angle(axis)),
    }
}

fn run(model: &Model) -> Seen {
    see(&drive(model, 400))
}

#[test]
fn without_effects_sensors_tell_the_truth() {
    let machine = drive(&Model::coupled(), 400);
    for axis in Axis::ALL {
        assert_eq!(machine.current_readings(axis), machine.phase_currents(axis));
        assert_eq!(machine.encoder_angle(axis), machine.motor(axis).theta);
    }
}

#[test]
fn reading_errors_leave_the_machine_as_it_is() {
    let plain = run(&Model::coupled());
    let offset = run(&with(
        Place::Nut,
        effects::CurrentOffset {
            off_a: 0.01,
            off_b: -0.02,
        },
    ));
    let [a, b, c] = plain.readings[1];
    assert_eq!(
        offset,
        Seen {
            readings: [plain.readings[0], [a + 0.01, b - 0.02, c]],
            ..plain.clone()
        }
    );
    let gain = run(&with(
        Place::Screw,
        effects::CurrentGain {
            gain_a: 0.5,
            gain_b: -0.25,
        },
    ));
    let [a, b, c] = plain.readings[0];
    assert_eq!(
        gain,
        Seen {
            readings: [[a + 0.5 * a, b - 0.25 * b, c], plain.readings[1]],
            ..plain.clone()
        }
    );
    let eccentric = run(&with(
        Place::Screw,
        effects::EncoderEccentricity {
            order: 2.0,
            amplitude: 1e-3,
            phase: 0.7,
        },
    ));
    let theta = plain.states[0].theta;
    let expected = theta + 1e-3 * (2.0 * theta + 0.7).sin();
    assert!(
        (eccentric.encoders[0] - expected).abs() < 1e-15,
        "measured {}, expected {} within {:e}",
        eccentric.encoders[0],
        expected,
        1e-15
    );
    assert_eq!(
        Seen {
            encoders: plain.encoders,
            ..eccentric
        },
        plain
    );
}

/// Torque that a motor effect adds at the first instant, from the change of the first step.
fn first_torque(effect: impl Into<AnyEffect>, theta: f64) -> f64 {
    let step = |model: &Model| {
        let mut machine = Machine::new(model, Coupling::Lumped);
        machine.set_motor_angle(Axis::Nut, theta);
        machine.set_disturbance_torque(Axis::Nut, 1.0);
        machine.advance(1e-7);
        (
            machine.motor(Axis::Nut).omega,
            machine.motor(Axis::Screw).omega,
        )
    };
    let (with, without) = (step(&with(Place::Nut, effect)), step(&Model::coupled()));
    assert_eq!(with.1, without.1, "the other motor has nothing");
    (with.0 - without.0) / 1e-7 * Model::coupled().nut.inertia_kg_m2
}

#[test]
fn torque_effects_add_their_law() {
    let theta = 1.234;
    let close = |got: f64, order: f64, angle: f64| {
        let expected = 0.1 * (order * angle + 0.7).cos();
        assert!((got - expected).abs() < 2e-6, "{got} against {expected}");
    };
    let (amplitude, phase) = (0.1, 0.7);
    for order in [2.0, 6.0, 300.0, 2.5] {
        close(
            first_torque(
                effects::TorqueHarmonic {
                    order,
                    amplitude,
                    phase,
                },
                theta,
            ),
            order,
            5.0 * theta,
        );
        close(
            first_torque(
                effects::AnglePeriodic {
                    order,
                    amplitude,
                    phase,
                },
                theta,
            ),
            order,
            theta,
        );
        close(
            first_torque(
                effects::Cogging {
                    order,
                    amplitude,
                    phase,
                },
                theta,
            ),
            order,
            theta,
        );
        close(
            first_torque(
                effects::CouplingMisalignment {
                    order,
                    amplitude,
                    phase,
                },
                theta,
            ),
            order,
            theta,
        );
        close(
            first_torque(
                effects::TimePeriodic {
                    hz: 50.0,
                    amplitude,
                    phase,
                },
                theta,
            ),
            order,
            0.0,
        );
    }
}

#[test]
fn stribeck_raises_the_level_at_rest_and_not_at_speed() {
    let effect = effects::StribeckFriction {
        amplitude: 0.02,
        speed: 1.0,
    };
    let mut model = with(Place::Screw, effect);
    model.screw.torque_harmonics.clear();
    let mut machine = Machine::new(&model, Coupling::Lumped);
    machine.set_load_force(0.0);
    machine.set_disturbance_torque(Axis::Screw, 0.0599);
    (0..1000).for_each(|_| machine.advance(DT));
    assert_eq!(machine.motor(Axis::Screw).omega, 0.0);
    machine.set_disturbance_torque(Axis::Screw, 1.0);
    (0..1000).for_each(|_| machine.advance(DT));
    let before = machine.motor(Axis::Screw).omega;
    machine.advance(DT);
    let torque = (machine.motor(Axis::Screw).omega - before) / DT * model.screw.inertia_kg_m2;
    let plain = 1.0 - model.screw.coulomb_nm - model.screw.viscous_nm_s * before;
    assert!(
        before > 10.0 && (torque - plain).abs() < 1e-4,
        "{torque} against {plain}"
    );
    let first = |amplitude| {
        let mut model = with(
            Place::Feed,
            effects::StribeckFriction {
                amplitude,
                speed: 1e-3,
            },
        );
        model.feed.load_n = 90.0;
        let mut machine = Machine::new(&model, Coupling::Coupled);
        machine.advance(DT);
        machine.table_velocity()
    };
    assert_eq!(first(75.0), 0.0, "the guideway holds 95 N");
    assert!(first(65.0) < 0.0, "the guideway yields at 85 N");
}

#[test]
fn flux_effects_act_in_emf_and_torque_alike() {
    let ratio = |model: &Model| {
        // Both at a given speed and angle, one step: back-EMF from the current, torque from the speed.
        let mut machine = Machine::new(model, Coupling::Lumped);
        machine.set_load_force(0.0);
        machine.set_bridge(Axis::Nut, Bridge::Driven([0.0, 10.0, -10.0]));
        (0..200).for_each(|_| machine.advance(DT));
        (
            machine.motor(Axis::Nut).omega,
            machine.motor(Axis::Nut).i_beta,
        )
    };
    let mut scaled = Model::coupled();
    scaled.nut.flux_wb *= 1.1;
    // At zero frequency of order and in a drift that is over, both are a change of the flux itself.
    let drift = effects::FluxDrift {
        value: 0.1,
        duration_s: 1e-9,
    };
    let (got, expected) = (ratio(&with(Place::Nut, drift)), ratio(&scaled));
    assert!(
        (got.0 - expected.0).abs() < 1e-9 && (got.1 - expected.1).abs() < 1e-9,
        "speed, rad/s, and current, A: measured {got:?}, expected {expected:?}, each within 1e-9"
    );
    let harmonic = effects::FluxHarmonic {
        order: 6.0,
        amplitude: 0.1,
        phase: 0.0,
    };
    let shaped = ratio(&with(Place::Nut, harmonic));
    assert!(
        (shaped.0 - ratio(&Model::coupled()).0).abs() > 1e-6,
        "measured {}, expected {} within {:e}",
        shaped.0,
        ratio(&Model::coupled()).0,
        1e-6
    );
}

#[test]
fn resistance_drifts_in_time() {
    let mut model = with(
        Place::Screw,
        effects::ResistanceDrift {
            value: 0.5,
            duration_s: 0.2,
        },
    );
    model.screw.coulomb_nm = 50.0;
    let mut machine = Machine::new(&model, Coupling::Lumped);
    machine.set_bridge(Axis::Screw, Bridge::Driven([3.0, 0.0, -3.0]));
    for (until, resistance) in [(0.1, 1.7 * 1.25), (0.2, 1.7 * 1.5), (0.4, 1.7 * 1.5)] {
        while machine.time() < until {
            machine.advance(DT);
        }
        let current = machine.phase_currents(Axis::Screw)[0];
        assert!(
            (current * resistance / 3.0 - 1.0).abs() < 1e-2,
            "{current} A at {until} s"
        );
    }
}

#[test]
fn dead_time_takes_its_voltage_and_never_reverses_a_current() {
    let mut model = with(Place::Both, effects::DeadTime { value: 1.0 });
    model.screw.coulomb_nm = 50.0;
    let settled = |volts| {
        let mut machine = Machine::new(&model, Coupling::Lumped);
        machine.set_bridge(Axis::Screw, Bridge::Driven(volts));
        (0..4000).for_each(|_| machine.advance(DT));
        machine
            .phase_currents(Axis::Screw)
            .map(|i| i * model.screw.resistance_ohm)
    };
    let close = |got: [f64; 3], expected: [f64; 3]| {
        let error = got
            .iter()
            .zip(expected)
            .map(|(g, e)| (g - e).abs())
            .fold(0.0, f64::max);
        assert!(error < 1e-6, "{got:?} against {expected:?}");
    };
    close(settled([3.0, 0.0, -3.0]), [2.0, 0.0, -2.0]);
    close(settled([0.9, -0.9, 0.0]), [0.0; 3]);
    // Phase a loses 1 V, b and c gain 1 V: 4 - (-2/3) - ... shared by the star point.
    close(
        settled([6.0, -3.0, -3.0]),
        [6.0 - 4.0 / 3.0, -3.0 + 2.0 / 3.0, -3.0 + 2.0 / 3.0],
    );
}

#[test]
fn lead_effects_change_travel_and_force_together() {
    let scale = effects::LeadScale { value: 0.25 };
    let mut declared = Model::coupled();
    declared.feed.lead_m *= 1.25;
    let (got, expected) = (run(&with(Place::Feed, scale)), run(&declared));
    assert!(
        (got.table - expected.table).abs() < 1e-15
            && (got.states[0].omega - expected.states[0].omega).abs() < 1e-9,
        "measured {got:?}, expected {expected:?}: table within 1e-15 m, speed within 1e-9 rad/s"
    );

    let error = effects::LeadError {
        order: 3.0,
        amplitude: 1e-5,
        phase: 0.4,
    };
    let mut machine = Machine::new(&with(Place::Feed, error), Coupling::Lumped);
    machine.set_disturbance_torque(Axis::Screw, 3.0);
    let travel = |angle: f64| {
        Model::coupled().feed.travel_per_radian() * angle + 1e-5 * (3.0 * angle + 0.4).cos()
    };
    for _ in 0..400 {
        machine.advance(DT);
        let relative = machine.motor(Axis::Screw).theta - machine.motor(Axis::Nut).theta;
        assert!(
            (machine.table_position() - (travel(relative) - travel(0.0))).abs() < 1e-15,
            "measured {}, expected {} within {:e}",
            machine.table_position(),
            (travel(relative) - travel(0.0)),
            1e-15
        );
    }
    assert!(
        machine.motor(Axis::Screw).theta.abs() > 0.1,
        "measured {}, expected above {}",
        machine.motor(Axis::Screw).theta.abs(),
        0.1
    );
    assert_ne!(
        run(&with(Place::Feed, error)).states,
        run(&Model::coupled()).states
    );
}

#[test]
fn ball_passage_acts_on_both_shafts_with_opposite_signs() {
    let step = |model: &Model| {
        let mut machine = Machine::new(model, Coupling::Coupled);
        machine.set_disturbance_torque(Axis::Screw, 1.0);
        machine.set_disturbance_torque(Axis::Nut, -1.0);
        machine.advance(1e-7);
        Axis::ALL.map(|axis| machine.motor(axis).omega / 1e-7 * model.motor(axis).inertia_kg_m2)
    };
    let effect = effects::BallPassage {
        order: 11.3,
        amplitude: 0.1,
        phase: 0.0,
    };
    let (got, plain) = (step(&with(Place::Feed, effect)), step(&Model::coupled()));
    assert!(
        (got[0] - plain[0] + 0.1).abs() < 1e-4 && (got[1] - plain[1] - 0.1).abs() < 1e-4,
        "torques {got:?}, without the effect {plain:?}: expected 0.1 N m less and more, within 1e-4"
    );
}

/// Model whose shafts do not turn, with a feed effect.
fn held(effect: impl Into<AnyEffect>) -> Model {
    let mut model = with(Place::Feed, effect);
    for axis in Axis::ALL {
        model.motor_mut(axis).coulomb_nm = 50.0;
    }
    model.feed.guideway_coulomb_n = 0.0;
    model
}

#[test]
fn compliance_and_position_load_and_backlash_show_in_the_sag() {
    let sag = |model: &Model| {
        let mut machine = Machine::new(model, Coupling::Coupled);
        (0..40_000).for_each(|_| machine.advance(DT));
        -machine.table_position()
    };
    let close = |got: f64, expected: f64| {
        assert!((got / expected - 1.0).abs() < 1e-5, "{got:e} {expected:e}")
    };
    let soft = 20.0 * (std::f64::consts::TAU * 100.0f64).powi(2);
    close(
        sag(&held(effects::AxialCompliance { hz: 100.0 })),
        400.0 / soft,
    );
    close(
        sag(&held(effects::PositionLoad { value: 2e8 })),
        400.0 / 4e8,
    );
    close(
        sag(&held(effects::Backlash { value: 1e-4 })),
        5e-5 + 400.0 / 2e8,
    );
}

#[test]
fn backlash_is_free_travel() {
    let mut model = held(effects::Backlash { value: 1e-4 });
    model.feed.guideway_viscous_n_s_per_m = 0.0;
    model.feed.load_n = 0.0;
    let mut machine = Machine::new(&model, Coupling::Coupled);
    machine.set_load_force(1.0);
    (0..800).for_each(|_| machine.advance(DT));
    let fallen = 0.5 * (1.0 / 20.0) * 0.02f64.powi(2);
    assert!(
        (machine.table_position() + fallen).abs() < 1e-12 && machine.axial_force() == 0.0,
        "table at {} m, expected {} within 1e-12; axial force {} N, expected 0",
        machine.table_position(),
        -fallen,
        machine.axial_force()
    );
}

/// A straight line of torque over the angle or the speed, and the closed form of it.
#[test]
fn a_measured_torque_is_what_its_curve_says() {
    let line = |over, range: [f64; 2]| effects::Measured {
        quantity: effects::Quantity::Torque,
        over,
        range,
        value: vec![0.0, 0.1, 0.2],
    };
    let turn = [0.0, std::f64::consts::TAU];
    let close = |got: f64, expected: f64| {
        assert!(
            (got - expected).abs() < 1e-4,
            "{got} N m, expected {expected} within 1e-4"
        );
    };
    for theta in [1.234, 1.234 - 3.0 * std::f64::consts::TAU] {
        let expected = 0.2 * 1.234 / std::f64::consts::TAU;
        close(
            first_torque(line(effects::MeasuredOver::Angle, turn), theta),
            expected,
        );
    }
    // The shaft rests: in the middle of one range, outside of the other.
    for (range, expected) in [([-5.0, 5.0], 0.1), ([1.0, 5.0], 0.0)] {
        close(
            first_torque(line(effects::MeasuredOver::Speed, range), 0.3),
            expected,
        );
    }
}

/// A force of 200 N over a position sags the table by as much as a load of 200 N, and nothing outside of its range.
#[test]
fn a_measured_force_shows_in_the_sag() {
    let sag = |range: [f64; 2]| {
        let force = effects::Measured {
            quantity: effects::Quantity::Force,
            over: effects::MeasuredOver::Position,
            range,
            value: vec![200.0; 5],
        };
        let mut machine = Machine::new(&held(force), Coupling::Coupled);
        (0..40_000).for_each(|_| machine.advance(DT));
        -machine.table_position()
    };
    for (range, newtons) in [([-0.1, 0.1], 600.0), ([0.05, 0.1], 400.0)] {
        let (got, expected) = (sag(range), newtons / 2e8);
        assert!(
            (got / expected - 1.0).abs() < 1e-5,
            "{got:e} m, expected {expected:e} within 1e-5 of it"
        );
    }
}

/// Here, or in the kind's own file.
#[test]
fn every_kind_has_a_test() {
    let source = include_str!("effects.rs");
    for kind in AnyEffect::CATALOGUE {
        assert!(
            source.contains(&format!("effects::{} {{", kind.structure))
                || kind.source.contains("#[test]"),
            "{} has no test",
            kind.name
        );
    }
}
