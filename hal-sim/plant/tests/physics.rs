//! The machine against closed-form solutions, balances and its own step length.

use plant::Axis;
use plant::effects::{DeadTime, EffectModel, Place};
use plant::machine::{Bridge, Bristles, Coupling, Machine};
use plant::model::{Model, MotorModel};
use std::f64::consts::TAU;

const DT: f64 = 25e-6;

/// A machine without friction, load or harmonics.
fn ideal() -> Model {
    let mut model = Model::coupled();
    for axis in Axis::ALL {
        let motor = model.motor_mut(axis);
        motor.torque_harmonics.clear();
        motor.coulomb_nm = 0.0;
        motor.viscous_nm_s = 0.0;
    }
    model.feed.guideway_coulomb_n = 0.0;
    model.feed.guideway_viscous_n_s_per_m = 0.0;
    model.feed.pair_coulomb_nm = 0.0;
    model.feed.load_n = 0.0;
    model
}

fn advance_for(machine: &mut Machine, seconds: f64, dt: f64) {
    for _ in 0..(seconds / dt).round() as usize {
        machine.advance(dt);
    }
}

/// Voltages that give the current `i_q` at rest and angle 0: theta_e = 0 puts q on beta.
fn beta_voltage(volts: f64) -> Bridge {
    let half = volts * std::f64::consts::FRAC_1_SQRT_2;
    Bridge::Driven([0.0, half, -half])
}

/// State after 10 ms from rest under a voltage that turns with both motors, everything smooth on.
fn smooth_run(dt: f64) -> [f64; 6] {
    let mut model = ideal();
    for axis in Axis::ALL {
        model.motor_mut(axis).torque_harmonics = Model::paper().screw.torque_harmonics;
        model.motor_mut(axis).viscous_nm_s = 4e-4;
    }
    model.feed.guideway_viscous_n_s_per_m = 400.0;
    let mut machine = Machine::new(&model, Coupling::Coupled);
    machine.set_bridge(Axis::Screw, beta_voltage(20.0));
    machine.set_bridge(Axis::Nut, beta_voltage(-12.0));
    advance_for(&mut machine, 0.01, dt);
    let (screw, nut) = (machine.motor(Axis::Screw), machine.motor(Axis::Nut));
    [
        screw.theta,
        screw.omega,
        screw.i_beta,
        nut.omega,
        machine.table_position() * 1e3,
        machine.table_velocity() * 1e3,
    ]
}

#[test]
fn halving_the_step_quarters_the_error() {
    let fine = smooth_run(DT / 32.0);
    let [coarse, half] = [DT, DT / 2.0].map(smooth_run);
    for k in 0..6 {
        let (first, second) = ((coarse[k] - fine[k]).abs(), (half[k] - fine[k]).abs());
        let ratio = first / second;
        assert!(
            (3.5..4.6).contains(&ratio),
            "quantity {k}: errors {first:e} and {second:e}, ratio {ratio}"
        );
        assert!(
            first < 1e-3 * (1.0 + fine[k].abs()),
            "quantity {k}: error {first:e} of {}",
            fine[k]
        );
    }
}

#[test]
fn a_free_motor_coasts_down_as_the_analytic_solution() {
    let mut model = ideal();
    model.screw.viscous_nm_s = 0.002;
    model.screw.coulomb_nm = 0.04;
    let mut machine = Machine::new(&model, Coupling::Lumped);
    let (j, b, c) = (model.screw.inertia_kg_m2, 0.002, 0.04);
    // Spin up by a torque, then let go.
    machine.set_disturbance_torque(Axis::Screw, 1.0);
    advance_for(&mut machine, 0.1, DT);
    machine.set_disturbance_torque(Axis::Screw, 0.0);
    let start = machine.motor(Axis::Screw).omega;
    let spun_up = (1.0 - c) / b * (1.0 - (-b / j * 0.1f64).exp());
    assert!(
        (start - spun_up).abs() < 1e-5 * spun_up,
        "{start} against {spun_up}"
    );
    for _ in 0..5 {
        let before = machine.motor(Axis::Screw).omega;
        advance_for(&mut machine, 0.05, DT);
        let expected = (before + c / b) * (-b / j * 0.05).exp() - c / b;
        let omega = machine.motor(Axis::Screw).omega;
        assert!(
            (omega - expected).abs() < 1e-5 * start,
            "{omega} against {expected}"
        );
    }
    let stop = j / b * (1.0 + start * b / c).ln();
    advance_for(&mut machine, stop, DT);
    assert_eq!(machine.motor(Axis::Screw).omega, 0.0, "it stops and stays");
}

#[test]
fn friction_holds_below_coulomb_and_slides_above() {
    let mut model = ideal();
    model.screw.coulomb_nm = 0.04;
    for (torque, moves) in [
        (0.0399, false),
        (-0.0399, false),
        (0.0401, true),
        (-0.0401, true),
    ] {
        let mut machine = Machine::new(&model, Coupling::Lumped);
        machine.set_disturbance_torque(Axis::Screw, torque);
        advance_for(&mut machine, 0.1, DT);
        let state = machine.motor(Axis::Screw);
        if moves {
            let expected = (torque - 0.04 * torque.signum()) / model.screw.inertia_kg_m2 * 0.1;
            assert!(
                (state.omega - expected).abs() < 1e-9,
                "{} against {expected}",
                state.omega
            );
        } else {
            assert_eq!((state.theta, state.omega), (0.0, 0.0), "torque {torque}");
        }
    }
}

#[test]
fn the_table_sags_by_load_over_stiffness() {
    let mut model = ideal();
    // Heavy friction holds both shafts.
    model.screw.coulomb_nm = 5.0;
    model.nut.coulomb_nm = 5.0;
    model.feed.load_n = 400.0;
    let mut machine = Machine::new(&model, Coupling::Coupled);
    advance_for(&mut machine, 0.2, DT);
    let expected = -400.0 / model.feed.axial_stiffness_n_per_m;
    assert!(
        (machine.table_position() - expected).abs() < 1e-6 * expected.abs(),
        "measured {}, expected {} within {:e}",
        machine.table_position(),
        expected,
        1e-6 * expected.abs()
    );
    assert!(
        (machine.axial_force() - 400.0).abs() < 1e-3,
        "measured {}, expected {} within {:e}",
        machine.axial_force(),
        400.0,
        1e-3
    );
    for axis in Axis::ALL {
        assert_eq!(machine.motor(axis).omega, 0.0);
    }
}

/// Frequency of the table against held shafts, from its zero crossings.
fn measured_resonance(hz: f64) -> f64 {
    let mut model = ideal();
    model.screw.coulomb_nm = 50.0;
    model.nut.coulomb_nm = 50.0;
    model.feed.axial_damping_ratio = 0.0;
    model.feed.axial_stiffness_n_per_m = model.feed.table_mass_kg * (TAU * hz).powi(2);
    model.feed.load_n = 100.0;
    let mut machine = Machine::new(&model, Coupling::Coupled);
    let mut crossings = Vec::new();
    let mut last = 0.0;
    for _ in 0..40_000 {
        machine.advance(DT);
        let velocity = machine.table_velocity();
        if last < 0.0 && velocity >= 0.0 {
            crossings.push(machine.time() - DT * velocity / (velocity - last));
        }
        last = velocity;
    }
    (crossings.len() - 1) as f64 / (crossings[crossings.len() - 1] - crossings[0])
}

#[test]
fn the_table_resonates_where_it_should_even_at_kilohertz() {
    for (hz, tolerance) in [(503.0, 1e-5), (2000.0, 1e-4), (4000.0, 2e-3)] {
        let measured = measured_resonance(hz);
        assert!(
            (measured / hz - 1.0).abs() < tolerance,
            "{measured} Hz for {hz} Hz"
        );
    }
}

#[test]
fn any_stiffness_stays_stable() {
    for hz in [8e3, 20e3, 1e6] {
        let mut model = ideal();
        model.feed.axial_stiffness_n_per_m = model.feed.table_mass_kg * (TAU * hz).powi(2);
        model.feed.load_n = 400.0;
        let mut machine = Machine::new(&model, Coupling::Coupled);
        advance_for(&mut machine, 0.5, DT);
        let bound = 400.0 / model.feed.table_mass_kg * 0.5;
        assert!(
            machine.table_velocity().abs() < bound,
            "{hz} Hz: {}",
            machine.table_velocity()
        );
    }
}

#[test]
fn energy_in_is_energy_stored_or_lost() {
    let mut model = ideal();
    model.feed.guideway_viscous_n_s_per_m = 400.0;
    model.feed.axial_damping_ratio = 0.0;
    let effect = plant::effects::FluxHarmonic {
        order: 6.0,
        amplitude: 0.2,
        phase: 0.4,
    };
    model
        .effects
        .push(plant::effects::EffectModel::new(plant::effects::Place::Both, effect).unwrap());
    let dt = DT / 8.0;
    let mut machine = Machine::new(&model, Coupling::Coupled);
    let stored = |machine: &Machine| {
        let mut sum = 0.5 * model.feed.table_mass_kg * machine.table_velocity().powi(2);
        for axis in Axis::ALL {
            let (motor, state) = (model.motor(axis), machine.motor(axis));
            sum += 0.5 * motor.inertia_kg_m2 * state.omega.powi(2);
            sum += 0.5 * motor.inductance_h * (state.i_alpha.powi(2) + state.i_beta.powi(2));
        }
        sum + 0.5 * machine.axial_force().powi(2) / model.feed.axial_stiffness_n_per_m
    };
    let mut balance = 0.0;
    let rate = |machine: &Machine, volts: [[f64; 3]; 2]| -> f64 {
        let mut power = -400.0 * machine.table_velocity().powi(2);
        for axis in Axis::ALL {
            let currents = machine.phase_currents(axis);
            for (volt, current) in volts[axis.index()].iter().zip(currents) {
                power += volt * current - model.motor(axis).resistance_ohm * current * current;
            }
        }
        power
    };
    let mut supplied = 0.0;
    for _ in 0..160_000 {
        let turn = 5.0 * 30.0 * (machine.time() + 0.5 * dt);
        let volts = [1.0, 0.6].map(|size| {
            let (s, c) = turn.sin_cos();
            let half = 17.0 * c * size;
            [-20.0 * s * size, half, -half]
        });
        for axis in Axis::ALL {
            machine.set_bridge(axis, Bridge::Driven(volts[axis.index()]));
        }
        let before = rate(&machine, volts);
        machine.advance(dt);
        let mean = 0.5 * (before + rate(&machine, volts));
        balance += mean * dt;
        supplied += mean.abs() * dt;
    }
    let stored = stored(&machine);
    assert!(
        (stored - balance).abs() < 2e-4 * supplied,
        "stored {stored}, balance {balance}, exchanged {supplied}"
    );
}

#[test]
fn torque_balance_has_the_signs_of_the_recordings() {
    let model = Model::coupled();
    let mut machine = Machine::new(&model, Coupling::Coupled);
    for axis in Axis::ALL {
        machine.set_motor_angle(axis, 0.1);
    }
    machine.set_bridge(Axis::Screw, beta_voltage(30.0));
    machine.set_bridge(Axis::Nut, beta_voltage(-30.0));
    let r = model.feed.lead_m / TAU;
    let dt = 1e-6;
    advance_for(&mut machine, 0.004, dt);
    let mut worst = 0.0_f64;
    for _ in 0..200 {
        let before = machine.clone();
        machine.advance(dt);
        let middle = machine.clone();
        machine.advance(dt);
        let slope = |of: &dyn Fn(&Machine) -> f64| (of(&machine) - of(&before)) / (2.0 * dt);
        let relative = middle.motor(Axis::Screw).omega - middle.motor(Axis::Nut).omega;
        assert!(relative.abs() > 1.0, "both motors must move for this test");
        for (axis, side) in [(Axis::Screw, 1.0), (Axis::Nut, -1.0)] {
            let (motor, state) = (model.motor(axis), middle.motor(axis));
            let theta_e = f64::from(motor.pole_pairs) * state.theta;
            let i_q = theta_e.cos() * state.i_beta - theta_e.sin() * state.i_alpha;
            let harmonics: f64 = motor
                .torque_harmonics
                .iter()
                .map(|h| h.amplitude_nm * (h.order * theta_e + h.phase_rad).cos())
                .sum();
            let expected = f64::from(motor.pole_pairs) * motor.flux_wb * i_q + harmonics
                - motor.viscous_nm_s * state.omega
                - motor.coulomb_nm * state.omega.signum()
                - side
                    * (r * middle.axial_force() + model.feed.pair_coulomb_nm * relative.signum());
            let torque = motor.inertia_kg_m2 * slope(&|m: &Machine| m.motor(axis).omega);
            worst = worst.max((torque - expected).abs() / motor.inertia_kg_m2 / 1000.0);
        }
        let feed = &model.feed;
        let velocity = middle.table_velocity();
        let force = feed.table_mass_kg * slope(&Machine::table_velocity)
            + feed.guideway_coulomb_n * velocity.signum()
            + feed.guideway_viscous_n_s_per_m * velocity
            + feed.load_n;
        worst = worst.max((force - middle.axial_force()).abs() / 1000.0);
    }
    assert!(worst < 1e-4, "{worst:e} of 1000 rad/s^2 or 1000 N");
}

#[test]
fn currents_follow_the_winding_at_rest() {
    let mut model = ideal();
    model.screw.coulomb_nm = 50.0;
    let mut machine = Machine::new(&model, Coupling::Lumped);
    machine.set_bridge(Axis::Screw, Bridge::Driven([10.0, -2.0, 1.0]));
    advance_for(&mut machine, 2e-3, DT);
    let fraction = 1.0 - (-1.7 / 0.0059 * 2e-3f64).exp();
    for (current, volts) in machine
        .phase_currents(Axis::Screw)
        .into_iter()
        .zip([7.0, -5.0, -2.0])
    {
        assert!(
            (current - volts / 1.7 * fraction).abs() < 1e-9,
            "measured {}, expected {} within {:e}",
            current,
            volts / 1.7 * fraction,
            1e-9
        );
    }
}

/// Turned by a torque, it settles where the shorted winding takes that torque:
/// `(p*flux)^2 * R * omega / (R^2 + (p*omega*L)^2)`, the steady state of the dq equations at zero voltage. A dead time takes nothing, for no leg switches.
#[test]
fn a_shorted_winding_brakes() {
    for omega in [0.5, 10.0, 30.0] {
        let mut model = ideal();
        let MotorModel {
            resistance_ohm,
            inductance_h,
            flux_wb,
            ..
        } = model.screw;
        let p = f64::from(model.screw.pole_pairs);
        let reactance = p * omega * inductance_h;
        let braking = (p * flux_wb).powi(2) * resistance_ohm * omega
            / (resistance_ohm.powi(2) + reactance.powi(2));
        model
            .effects
            .extend(EffectModel::new(Place::Screw, DeadTime { value: 2.0 }));
        let mut machine = Machine::new(&model, Coupling::Lumped);
        machine.set_bridge(Axis::Screw, Bridge::Shorted);
        machine.set_disturbance_torque(Axis::Screw, braking);
        advance_for(&mut machine, 2.0, DT);
        let settled = machine.motor(Axis::Screw).omega;
        assert!(
            (settled / omega - 1.0).abs() < 0.01,
            "{braking} N m: settled at {settled} rad/s, expected {omega} rad/s within 1 %"
        );
    }
}

#[test]
fn an_open_bridge_ends_the_current_and_keeps_it_at_zero() {
    let mut machine = Machine::new(&ideal(), Coupling::Lumped);
    machine.set_bridge(Axis::Screw, Bridge::Driven([10.0, -2.0, 1.0]));
    advance_for(&mut machine, 2e-3, DT);
    machine.set_bridge(Axis::Screw, Bridge::Open);
    let mut last = f64::INFINITY;
    for _ in 0..40 {
        machine.advance(DT);
        let size = machine
            .phase_currents(Axis::Screw)
            .into_iter()
            .map(f64::abs)
            .sum();
        assert!(
            size < last || size == 0.0,
            "current of {size} A after {last} A: expected to fall"
        );
        last = size;
    }
    assert_eq!(machine.phase_currents(Axis::Screw), [0.0; 3]);
    assert!(
        machine.motor(Axis::Screw).omega != 0.0,
        "the screw stands, expected to turn"
    );
}

#[test]
fn lumped_load_is_the_papers() {
    let model = Model::paper();
    let mut machine = Machine::new(&model, Coupling::Lumped);
    machine.advance(1e-9);
    let screw = machine.motor(Axis::Screw).omega / 1e-9 * model.screw.inertia_kg_m2;
    let harmonics: f64 = model
        .screw
        .torque_harmonics
        .iter()
        .map(|h| h.amplitude_nm)
        .sum();
    assert!((screw - (harmonics - 1.0)).abs() < 1e-6, "{screw}");
    assert!(
        (machine.axial_force() - TAU / 0.005).abs() < 1e-9,
        "measured {}, expected {} within {:e}",
        machine.axial_force(),
        TAU / 0.005,
        1e-9
    );
}

#[test]
fn the_same_run_twice_is_the_same_bit_for_bit() {
    assert_eq!(
        smooth_run(DT).map(f64::to_bits),
        smooth_run(DT).map(f64::to_bits)
    );
}

#[test]
fn a_start_angle_moves_neither_table_nor_spring() {
    let mut machine = Machine::new(&ideal(), Coupling::Coupled);
    machine.set_motor_angle(Axis::Screw, 0.9);
    machine.set_motor_angle(Axis::Nut, 0.2);
    advance_for(&mut machine, 0.01, DT);
    assert!(
        machine.axial_force().abs() < 1e-6,
        "measured {}, expected below {}",
        machine.axial_force().abs(),
        1e-6
    );
    assert!(
        machine.table_position().abs() < 1e-15,
        "measured {}, expected below {}",
        machine.table_position().abs(),
        1e-15
    );
}

/// A torque that grows slowly displaces elastic friction by `-x0 ln(1 - T / g)`: from `dT/dx = s0 (1 - T / g)`.
#[test]
fn elastic_friction_is_displaced_as_its_closed_form_says() {
    const LEVEL_NM: f64 = 0.05;
    const PRESLIDING_M: f64 = 4e-6;
    let mut model = ideal();
    model.screw.coulomb_nm = LEVEL_NM;
    model.feed.presliding_m = PRESLIDING_M;
    let mut machine = Machine::new(&model, Coupling::Lumped);
    let presliding = PRESLIDING_M / model.feed.travel_per_radian();
    for (step, part) in (1..=160_000).map(|step| (step, f64::from(step) / 200_000.0)) {
        machine.set_disturbance_torque(Axis::Screw, part * LEVEL_NM);
        advance_for(&mut machine, 25e-6, DT);
        if step % 40_000 == 0 {
            let expected = -presliding * (1.0 - part).ln();
            let moved = machine.motor(Axis::Screw).theta;
            assert!(
                (moved / expected - 1.0).abs() < 0.02,
                "{part} of the level moves it by {moved} rad, expected {expected}"
            );
        }
    }
    // On the way back the decay adds to the spring, `dT/dx = s0 (1 + T / g)`: from 0.8 g that is `x0 ln 1.8`.
    let slid = machine.motor(Axis::Screw).theta;
    for step in (0..160_000).rev() {
        machine.set_disturbance_torque(Axis::Screw, f64::from(step) / 200_000.0 * LEVEL_NM);
        advance_for(&mut machine, 25e-6, DT);
    }
    let back = (slid - machine.motor(Axis::Screw).theta) / presliding;
    let expected = 1.8f64.ln();
    assert!(
        (back / expected - 1.0).abs() < 0.03,
        "{back} of the presliding, expected {expected}"
    );
}

/// At a steady speed it is the surface's level there, `Fc + (Fs - Fc) e^-(v / vs)^2`.
#[test]
fn elastic_friction_that_slides_is_the_level_of_its_speed() {
    let level = |speed: f64| 0.05 + 0.03 * (-(speed / 0.5f64).powi(2)).exp();
    for speed in [0.02, 0.3, 0.6, 20.0, -0.3] {
        let mut bristles = Bristles::new(0.05, 2e-3, 1e-3);
        let friction = (0..200_000).fold(0.0, |_, _| bristles.step(speed, level(speed), DT));
        let expected = level(speed) * speed.signum();
        assert!(
            (friction / expected - 1.0).abs() < 1e-6,
            "{friction} N m at {speed} rad/s, expected {expected}"
        );
    }
}
