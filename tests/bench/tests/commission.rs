//! Commissioning of simulated drives over their link, from cold.

use bench::alignment::{drawn, miswirings, of_board};
use bench::commissioning::{Outcome, USUAL, any_size, commission, rivals};
use commission::LoopResponse;
use commission::{Session, current_response, electrical, mechanical};
use hal_sim::boards::BoardKind;
use hal_sim::experiment::Setup;
use hal_sim::parallel::on_all_cores;
use hal_sim::served::{Serving, SimulatedDrive, Within};
use hal_sim::start::Start;
use link::host::client::Client;
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;
use pollster::block_on;
use std::cell::RefCell;
use std::f64::consts::TAU;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A session with the cold drive of `start`, within the program.
fn session(start: &Start) -> Session<Client<Within>> {
    let drive = SimulatedDrive::cold(start).unwrap();
    let serving = Rc::new(RefCell::new(Serving::new(drive)));
    let client = Client::open(Within::open(&serving)).unwrap();
    block_on(Session::open(client, Arc::new(AtomicBool::new(false)))).unwrap()
}

/// A machine whose plate is wrong by a fifth in what is electrical, by a half in its inertia.
fn rough(seed: u64) -> Start {
    let mut start = drawn(seed);
    for (k, motor) in start.plate.motors.iter_mut().enumerate() {
        motor.resistance_ohm *= [1.2, 0.8][k];
        motor.inductance_h *= [0.8, 1.2][k];
        motor.flux_wb *= [0.9, 1.1][k];
        motor.inertia_kg_m2 *= [1.5, 0.6][k];
    }
    start
}

#[test]
fn a_cold_drive_measures_its_machine_within_five_percent() {
    const AXIAL_HZ: f64 = 100.0;
    let mut start = rough(3);
    let feed = &mut start.model.feed;
    feed.axial_stiffness_n_per_m = feed.table_mass_kg * (TAU * AXIAL_HZ).powi(2);
    let mut session = session(&start);
    block_on(session.ready()).unwrap();
    block_on(session.arm()).unwrap();
    let electrical = block_on(electrical::measure(
        &mut session,
        electrical::SPEEDS,
        1e-4,
        &mut |_| (),
    ))
    .unwrap();
    let settings = electrical.applied(session.settings(), 0.0);
    block_on(session.configure(&settings)).unwrap();
    block_on(session.arm()).unwrap();
    let mechanical = block_on(mechanical::measure(&mut session, 10e-3, &mut |_| ())).unwrap();

    let model = &start.model;
    let r = model.feed.lead_m / TAU;
    let table = model.feed.table_mass_kg * r * r;
    let axial = mechanical.axial_hz.expect("the scale shows the resonance");
    assert!(
        (axial.value / AXIAL_HZ - 1.0).abs() < 0.05,
        "axial resonance: measured {axial:?}, true {AXIAL_HZ} Hz"
    );
    for (k, (name, motor)) in [("screw", &model.screw), ("nut", &model.nut)]
        .into_iter()
        .enumerate()
    {
        let (found, moved) = (&electrical.motors[k], mechanical.moved_kg_m2()[k]);
        for (what, measured, truth) in [
            (
                "resistance, ohm",
                found.resistance_ohm,
                motor.resistance_ohm,
            ),
            ("inductance, H", found.inductance_h, motor.inductance_h),
            ("flux, Wb", found.flux_wb, motor.flux_wb),
            ("inertia, kg m^2", moved, motor.inertia_kg_m2 + table),
            (
                "Coulomb friction, N m",
                mechanical.motors[k].coulomb_nm,
                motor.coulomb_nm,
            ),
        ] {
            let off = measured.value / truth - 1.0;
            assert!(
                off.abs() < 0.05,
                "{name}: {what}: measured {measured:?}, true {truth}, {:.1} % off",
                1e2 * off
            );
        }
        let bound = electrical.current_a[k];
        assert!(bound.is_kept(), "{name}: current {bound:?}");
        let bound = mechanical.torque_nm[k];
        assert!(bound.is_kept(), "{name}: torque {bound:?}");
    }
    let off = mechanical.lead_m.value / model.feed.lead_m - 1.0;
    assert!(
        off.abs() < 0.01,
        "lead {:?}, true {}",
        mechanical.lead_m,
        model.feed.lead_m
    );
    for bound in [electrical.travel_m, mechanical.travel_m] {
        assert!(bound.is_kept(), "travel {bound:?}");
    }
}

/// A loss that was the same at all currents made 15 % of resistance of its slope, with an interval of 2 %.
#[test]
fn the_boards_as_they_ship_measure_their_windings_and_their_legs() {
    for kind in [BoardKind::Mains, BoardKind::Nucleo] {
        let setup = Setup::shipped(kind, &Model::coupled(), Coupling::Coupled);
        let start = Start::anywhere(&setup);
        let mut session = session(&start);
        block_on(session.ready()).unwrap();
        block_on(session.arm()).unwrap();
        let quiet = &mut |_| ();
        let measured = electrical::measure(&mut session, electrical::SPEEDS, 1e-4, quiet);
        let measured = block_on(measured).unwrap();
        for (axis, found) in Axis::ALL.into_iter().zip(&measured.motors) {
            let truth = start.model.motor(axis);
            for (what, found, truth, percent) in [
                (
                    "resistance",
                    found.resistance_ohm,
                    truth.resistance_ohm,
                    1.0,
                ),
                ("inductance", found.inductance_h, truth.inductance_h, 1.0),
                ("flux", found.flux_wb, truth.flux_wb, 0.1),
                (
                    "turning current",
                    found.turning_a,
                    start.board.turning_a(),
                    5.0,
                ),
            ] {
                let off = 1e2 * (found.value / truth - 1.0);
                println!("{kind:?} {axis:?} {what}: {found:?}, true {truth}: {off:.3} % off");
                assert!(off.abs() < percent, "{what}: {off} % off");
                assert!(
                    (found.value - truth).abs() < 3.0 * found.plus_minus + 2e-3 * truth,
                    "{what}: {found:?}, true {truth}"
                );
            }
        }
    }
}

/// A datasheet's rated torque as the limit: a step of the current along d from one end to the other overshot it by a third.
#[test]
fn the_currents_keep_the_limit_of_the_rated_torque() {
    let mut start = rough(3);
    for motor in &mut start.plate.motors {
        motor.torque_max_nm *= 0.5;
    }
    let mut session = session(&start);
    block_on(session.ready()).unwrap();
    block_on(session.arm()).unwrap();
    let quiet = &mut |_| ();
    let measured = electrical::measure(&mut session, electrical::SPEEDS, 1e-4, quiet);
    for bound in block_on(measured).unwrap().current_a {
        assert!(bound.is_kept(), "{bound:?}");
    }
}

/// Measured bandwidth of the predicted one, and what the measured margin is above the predicted one, degrees.
fn beside_model(response: &LoopResponse) -> [f64; 2] {
    let (measured, model) = (
        response.crossing.unwrap(),
        response.predicted_crossing.unwrap(),
    );
    [
        measured.bandwidth_rad_s / model.bandwidth_rad_s,
        measured.margin_deg - model.margin_deg,
    ]
}

/// The settings have 0.8 and 1.2 of the inductances. Gains follow them (Eq 9), so the loops' bandwidths are off by as much.
#[test]
fn a_wrong_inductance_shows_in_the_measured_bandwidth() {
    let mut session = session(&rough(3));
    block_on(session.ready()).unwrap();
    block_on(session.arm()).unwrap();
    let found = block_on(current_response::measure(&mut session, &mut |_| ())).unwrap();
    for (response, expected) in found.iter().zip([0.8, 1.2]) {
        let [part, _] = beside_model(response.as_ref().unwrap());
        println!("{part:.3} of the model's bandwidth");
        assert!(
            (part / expected - 1.0).abs() < 0.1,
            "{part:.3}, expected {expected}"
        );
    }
}

/// A machine's commissioning; of one with 10,000 counts a turn under four noises. With these its speed loop's margin scatters by 3 degrees
/// rms, from -6.1 to +7.5 degrees in ten runs of machine 4 and as much without slack at rest, so the test takes the mean.
fn noises(seed: u64) -> Vec<Outcome> {
    let start = any_size(seed);
    let [encoder, _] = start.board.sensors.encoders;
    let noises = if encoder.counts_per_turn == 10_000 {
        vec![seed, 101, 102, 103]
    } else {
        vec![seed]
    };
    let run = |noise| {
        let mut start = start.clone();
        start.board.seed = noise;
        commission(&start, &USUAL).unwrap()
    };
    noises.into_iter().map(run).collect()
}

/// A sample of `cargo xtask bench commission`. Least squares took 4.5 % of the nut's inertia of machine 30 for its torque ripple;
/// on 66 an elastic feed let the table stand where the motors had turned back, which hid two thirds of its mass. On 15 the speed
/// loops that it proposes are slow: the alignment after it needs more than their integral to break a rotor away.
#[test]
fn drives_from_fifty_watts_to_five_kilowatts_are_commissioned_from_cold() {
    for outcomes in on_all_cores(&[1, 4, 9, 12, 15, 30, 34, 66], |&seed| noises(seed)) {
        let outcome = &outcomes[0];
        assert_eq!(outcome.failure, None);
        for motor in &outcome.error_percent {
            for (name, percent) in ["resistance", "inductance", "flux", "inertia"]
                .iter()
                .zip(motor)
            {
                assert!(
                    percent.abs() < 5.0,
                    "{name}: {percent:.1} % off, expected within 5 %"
                );
            }
        }
        let responses = outcome.done.iter().find_map(|done| done.responses.as_ref());
        for response in responses.unwrap() {
            let [part, degrees] = beside_model(response.as_ref().unwrap());
            println!(
                "current loop: bandwidth {part:.3} of the model's, margin {degrees:+.1} degrees"
            );
            assert!(
                (part - 1.0).abs() < 0.1 && degrees.abs() < 5.0,
                "current loop: bandwidth {part:.3} of the model's, margin {degrees:+.1} degrees off, expected 0.9 to 1.1 and within 5"
            );
        }
        // Beside the loop that a sine torque measures on the true machine, of the same prediction.
        for (motor, sine) in outcome.bandwidth_part.into_iter().enumerate() {
            let responses = outcomes.iter().map(|outcome| {
                let mut done = outcome.done.iter();
                let speed = done.find_map(|done| done.speed_responses.as_ref());
                beside_model(speed.unwrap()[motor].as_ref().unwrap())
            });
            let responses: Vec<[f64; 2]> = responses.collect();
            let [part, _] = responses[0];
            let degrees =
                responses.iter().map(|[_, degrees]| degrees).sum::<f64>() / responses.len() as f64;
            println!(
                "speed loop: bandwidth {part:.3} of the model's, by a sine torque {sine:.3}, margin {degrees:+.1} degrees"
            );
            assert!(
                (part / sine - 1.0).abs() < 0.1 && degrees.abs() < 5.0,
                "speed loop: bandwidth {part:.3} of the model's, by a sine torque {sine:.3}; margin {degrees:+.1} degrees off"
            );
        }
        for degrees in outcome.offset_deg {
            assert!(
                degrees.abs() < 1.0,
                "angle: {degrees:.2} degrees off, expected within 1"
            );
        }
        for part in outcome.bandwidth_part {
            assert!(
                (0.9..1.1).contains(&part),
                "bandwidth: {part:.3} of what was predicted, expected within 10 %"
            );
        }
        assert!(
            outcome.margin_deg > 40.0,
            "phase margin {:.1} degrees, expected above 40",
            outcome.margin_deg
        );
        assert!(
            outcome.signs_right && outcome.within_limits,
            "{:?}",
            outcome.done
        );
    }
}

#[test]
fn a_wrong_wiring_is_named_by_the_step_that_meets_it() {
    let reversed = miswirings(7).swap_remove(0);
    let outcome = commission(&reversed.start, &USUAL).unwrap();
    let said = outcome.failure.expect("phases a and b are swapped");
    let reason = reversed.expected.unwrap().reason;
    assert!(
        said.contains("step `start`")
            && said.contains(reason.name())
            && said.contains(reason.sentence()),
        "{said}"
    );
}

/// Without a dead time the others' procedures are right: what they are off by in the bench is not how they are written here.
#[test]
fn the_others_are_right_where_there_is_no_dead_time() {
    let mut start = any_size(2);
    start.board.dead_time_s = 0.0;
    start.model.effects.clear();
    let found = rivals(&start, Axis::Screw);
    for (name, percent, limit) in [
        ("ODrive's R", found.odrive_r_percent, 3.0),
        ("ODrive's L", found.odrive_l_percent, 10.0),
        ("VESC's R", found.vesc_r_percent, 3.0),
    ] {
        assert!(
            percent.abs() < limit,
            "{name} is {percent:.1} % off, expected within {limit} %"
        );
    }
}

/// The proposed speed loops are slower than those that the board ships with. Alignment with them found no rotor, or moved the table, on each
/// of these starts.
#[test]
fn a_board_with_slower_loops_is_aligned_again() {
    on_all_cores(&[33, 43, 51, 55, 61], |&seed| {
        let outcome = commission(&of_board(BoardKind::Nucleo, seed), &USUAL).unwrap();
        assert_eq!(outcome.failure, None, "{seed}");
    });
}
