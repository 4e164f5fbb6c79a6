//! The drive removes the ripple of the machine with its defects, from cold, and keeps what it has learned.

use bench::smooth::bench::{Controller, Scale, cases};
use bench::smooth::reversal::{Reversal, reversal};
use bench::smooth::undeclared::{Undeclared, ripple};
use bench::smooth::{Machine, orders, setup};
use control::compensation::fit::TableFit;
use control::compensation::{LINES, TORQUES};
use control::plate::{CompensationPlate, OrderPlate, TorqueOrderPlate};
use control::supervisor::{Demand, State};
use hal_sim::drive::Drive;
use hal_sim::experiment::{OperatingPoint, RPM, Setup};
use hal_sim::parallel::on_all_cores;
use hal_sim::seam::{Seam, SpeedSeen};
use hal_sim::smooth::known::Known;
use hal_sim::smooth::{drive, learned, smoothness, smoothness_through};
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;
use std::f64::consts::TAU;

/// Table mm/s, nut rpm, and what must be left of the ripple, %.
const POINTS: [(Machine, f64, f64, f64); 5] = [
    (Machine::Lumped, 2.5, 0.0, 0.6),
    (Machine::Lumped, 2.5, 800.0, 0.5),
    (Machine::Coupled, 2.5, 0.0, 0.8),
    // Order 30 of the nut on the table's resonance.
    (Machine::Coupled, 2.5, 1006.0, 2.0),
    (Machine::Lumped, 10.0, 500.0, 0.2),
];

#[test]
fn ripple_that_repeats_with_an_angle_is_learned_and_removed() {
    let results = on_all_cores(&POINTS, |&(machine, mm_s, rpm, allowed)| {
        let setup = setup(machine, 1);
        let point = OperatingPoint {
            velocity: mm_s * 1e-3,
            base: rpm * RPM,
        };
        let run = |compensation, seconds| {
            let mut drive = drive(&setup, compensation)?;
            smoothness(&mut drive, point, seconds)
        };
        let before = run(CompensationPlate::NONE, 0.0);
        let after = run(orders(&setup, 0.5, true), 12.0);
        (before, after, allowed)
    });
    for ((machine, mm_s, rpm, _), (before, after, allowed)) in POINTS.into_iter().zip(results) {
        let (before, after) = (before.unwrap().vrf, after.unwrap().vrf);
        println!("{machine:?} {mm_s} mm/s, {rpm} rpm: {before:.2} % before, {after:.2} % after");
        assert!(
            after < allowed && after < 0.2 * before,
            "{machine:?} at {mm_s} mm/s and {rpm} rpm: {after:.2} % is left of {before:.2} %, expected less than {allowed} %"
        );
    }
}

/// The observer shows an encoder's error late, the later the faster the shaft turns. What is learned of it is the encoder's own: the same in
/// all modes, and as the model has it. The order that errs 0.035 degrees four times a turn is the mains board's.
#[test]
fn what_is_learned_of_an_encoder_does_not_depend_on_the_speed() {
    let setup = setup(Machine::Mains, 1);
    let cold = orders(&setup, 0.5, true);
    let real = Known::of(&setup.model).compensation.angle[0];
    let line = cold.angle[0].iter().position(|line| line.order == 4.0);
    let line = line.unwrap();
    let real = real.iter().find(|line| line.order == 4.0).unwrap();
    let learned = on_all_cores(&[0.0, 300.0, 800.0, -800.0], |rpm| {
        let point = OperatingPoint {
            velocity: 2.5e-3,
            base: rpm * RPM,
        };
        let mut drive = drive(&setup, cold).unwrap();
        smoothness(&mut drive, point, 12.0).unwrap();
        (*rpm, learned(&drive, cold).angle[0][line])
    });
    for (rpm, found) in learned {
        let off = (found.re - real.re).hypot(found.im - real.im) / real.re.hypot(real.im);
        println!("{rpm} rpm: {found:?}, off by {off:.3}");
        assert!(
            off < 0.08,
            "{rpm} rpm: {found:?} is learned, {real:?} is there: off by {off:.2}, expected less than 0.08"
        );
    }
}

/// What a model declares, turned into orders, is what a drive that knows nothing learns of that machine while it turns slowly,
/// but for dead time (order 30), which no order of the model has; and it removes most of the ripple without any learning.
#[test]
fn what_a_model_knows_is_what_a_drive_learns() {
    let setup = setup(Machine::Lumped, 1);
    let known = Known::of(&setup.model);
    assert_eq!(known.left, ["dead_time (both)"]);
    let point = OperatingPoint {
        velocity: 2.5e-3,
        base: 90.0 * RPM,
    };
    let cold = orders(&setup, 0.5, true);
    let mut learner = drive(&setup, cold).unwrap();
    smoothness(&mut learner, point, 20.0).unwrap();
    let learned = learned(&learner, cold);
    // 1 N m over five pole pairs and the flux, which the nut holds the other way.
    let loads = [1.0, -1.0].map(|nm| nm / (5.0 * setup.model.screw.flux_wb));
    for (motor, (known, learned)) in known
        .compensation
        .torque
        .iter()
        .zip(&learned.torque)
        .enumerate()
    {
        for order in [5.0, 10.0, 60.0, 36.0] {
            let of = |plates: &[TorqueOrderPlate]| {
                let plate = plates.iter().find(|plate| plate.order == order).unwrap();
                let load = loads[motor];
                [
                    plate.re + load * plate.re_per_a,
                    plate.im + load * plate.im_per_a,
                ]
            };
            let (known, learned) = (of(known), of(learned));
            let off = (known[0] - learned[0]).hypot(known[1] - learned[1]);
            assert!(
                off < 3e-3,
                "motor {motor}, order {order}: {learned:?} A learned, {known:?} A known, expected within 3 mA"
            );
        }
    }
    for (known, learned) in [
        (&known.compensation.angle[0][0], &learned.angle[0][0]),
        (&known.compensation.angle[1][0], &learned.angle[1][0]),
    ] {
        let off = (known.re - learned.re).hypot(known.im - learned.im);
        assert!(
            off < 2e-5,
            "{learned:?} learned, {known:?} known, expected within 2e-5"
        );
    }
    let run = |compensation, base| {
        let point = OperatingPoint { base, ..point };
        smoothness(&mut drive(&setup, compensation).unwrap(), point, 0.5)
            .unwrap()
            .vrf
    };
    for (rpm, part) in [(0.0, 0.1), (800.0, 0.35)] {
        let (before, after) = (
            run(CompensationPlate::NONE, rpm * RPM),
            run(known.compensation, rpm * RPM),
        );
        println!("{rpm} rpm: {before:.2} % without, {after:.2} % with what the model knows");
        assert!(
            after < part * before,
            "at {rpm} rpm {after} % of {before} %"
        );
    }
}

/// What a drive finds of its saved tables on machines whose encoders were homed elsewhere since, whose signs are wrong, or that are
/// as they were; with that of the nut, which stands in the single drive and shows nothing, nor which of the two an error once a turn is of.
#[test]
fn a_saved_table_that_does_not_fit_is_told_and_learned_anew() {
    let setup = setup(Machine::Lumped, 1);
    let point = |rpm: f64| OperatingPoint {
        velocity: 2.5e-3,
        base: rpm * RPM,
    };
    let cold = orders(&setup, 0.5, true);
    let mut learner = drive(&setup, cold).unwrap();
    smoothness(&mut learner, point(300.0), 12.0).unwrap();
    assert_eq!(fits(&learner), [TableFit::None; 5], "nothing was saved");
    let saved = learned(&learner, cold);

    // A twentieth of a turn of the shaft, which the electrical angle is given.
    let mut homed = setup.clone();
    for encoder in &mut homed.board.sensors.encoders {
        encoder.theta_e_at_zero_turns = 0.25;
    }
    let mut turned = saved;
    for order in turned.torque.iter_mut().flatten() {
        (order.re, order.im) = (-order.re, -order.im);
    }
    let [none, fits_, out, unchecked] = [
        TableFit::None,
        TableFit::Fits,
        TableFit::Discarded,
        TableFit::Unchecked,
    ];
    let cases = [
        ("as it was", &setup, saved, 300.0, [fits_; 5]),
        // Tables count from the rotor's electrical zero, which does not move with the encoder's.
        ("encoders homed elsewhere", &homed, saved, 300.0, [fits_; 5]),
        (
            "wrong signs",
            &setup,
            turned,
            300.0,
            [out, out, fits_, fits_, fits_],
        ),
        (
            "wrong signs, the nut stands",
            &setup,
            turned,
            0.0,
            [out, unchecked, unchecked, unchecked, unchecked],
        ),
        ("nothing saved", &setup, cold, 300.0, [none; 5]),
    ];
    let results = on_all_cores(&cases, |&(_, setup, plate, rpm, _)| {
        let mut drive = drive(setup, plate).unwrap();
        for (axis, encoder) in Axis::ALL.into_iter().zip(&setup.board.sensors.encoders) {
            let turns = encoder.theta_e_at_zero_turns / f64::from(drive.pole_pairs(axis));
            drive.board.machine.set_motor_angle(axis, turns * TAU);
        }
        drive.board.wake_encoders();
        let left = smoothness(&mut drive, point(rpm), 12.0).unwrap().vrf;
        (fits(&drive), left)
    });
    for ((name, _, _, rpm, expected), (found, left)) in cases.into_iter().zip(results) {
        println!("{name}, {rpm} rpm: {found:?}, {left:.2} % left");
        assert_eq!(found, expected, "{name}: found, expected");
        assert!(
            left < 0.6,
            "{name}: {left} % of ripple is left, expected less than 0.6"
        );
    }
}

/// A torque that repeats seven times a turn of the screw.
struct Ripple {
    amps: f64,
}

impl Seam for Ripple {
    fn current(&mut self, axis: Axis, seen: &SpeedSeen) -> Option<f64> {
        (axis == Axis::Screw).then(|| self.amps * (7.0 * TAU * seen.turn).cos())
    }
}

/// A table that has fitted and changes later is reported too, and stays: it is what the drive has learned since.
#[test]
fn a_ripple_that_changes_while_the_drive_runs_is_told() {
    let setup = Setup::ideal(Model::paper(), Coupling::Lumped);
    let mut plate = CompensationPlate::NONE;
    plate.learning_s = 0.5;
    plate.torque[0][0] = TorqueOrderPlate {
        re: -0.1,
        ..TorqueOrderPlate::unknown(7.0)
    };
    let mut drive = drive(&setup, plate).unwrap();
    let point = OperatingPoint {
        velocity: 2.5e-3,
        base: 300.0 * RPM,
    };
    for (amps, expected) in [
        (0.1, TableFit::Fits),
        (-0.1, TableFit::Drifted),
        (0.1, TableFit::Fits),
    ] {
        smoothness_through(&mut drive, point, 2.0, &mut Ripple { amps }).unwrap();
        assert_eq!(
            fits(&drive)[0],
            expected,
            "a ripple of {amps} A, for which -0.1 A were saved"
        );
    }
}

fn fits(drive: &Drive) -> [TableFit; 5] {
    std::array::from_fn(|table| drive.compensation().tables().of(table).unwrap())
}

/// The speed loop alone waits for the error.
#[test]
fn friction_that_is_fed_forward_need_not_be_waited_for() {
    for rpm in [0.0, 800.0] {
        let Reversal { pi, known, .. } = reversal(rpm).unwrap();
        println!("nut {rpm} rpm: {pi:.1} % without, {known:.1} % with friction fed forward");
        assert!(
            pi > 15.0 && known < 5.0,
            "nut {rpm} rpm: the table's error at its reversal is {pi:.1} % without and {known:.1} % with friction fed forward, \
             expected more than 15 and less than 5"
        );
    }
}

/// A fault stops the drive while it learns, the motors run out, and the table stands elsewhere when it starts again: that teaches
/// nothing, and nothing else does before all orders are tuned to the new speed.
#[test]
fn a_table_that_was_moved_at_rest_teaches_nothing() {
    let mut setup = setup(Machine::Lumped, 1);
    // With its bridges open nothing would hold a load.
    setup.model.feed.load_n = 0.0;
    let mut drive = drive(&setup, orders(&setup, 0.5, true)).unwrap();
    let point = OperatingPoint {
        velocity: 2.5e-3,
        base: 300.0 * RPM,
    };
    smoothness(&mut drive, point, 2.0).unwrap();
    drive.board.trip_break(Axis::Nut);
    drive.period();
    drive.command(0.0, 0.0).unwrap();
    drive.request.demand = Demand::Reset;
    for _ in 0..100_000 {
        drive.period();
    }
    assert_eq!(drive.state(), State::Ready);
    // Of both encoders and the lead, which follow the torques.
    let learned = |drive: &Drive| {
        let lines = (2 * TORQUES..LINES).map(|line| drive.compensation().coefficient(line));
        lines.collect::<Vec<_>>()
    };
    let before = learned(&drive);
    drive.request.demand = Demand::Run;
    for _ in 0..80 {
        drive.period();
    }
    assert_eq!(drive.state(), State::Holding);
    assert_eq!(learned(&drive), before, "after and before the start");
}

/// Both boards as they ship, with their own sensors and no load. The limits are the project's goals.
#[test]
fn the_boards_that_ship_are_rows_and_ripple_less_with_what_they_learn() {
    let ours = Controller::Ours(Scale::There);
    for (machine, nut_rpm, limit) in [
        (Machine::Mains, 0.0, 1.5),
        (Machine::Mains, 800.0, 2.0),
        (Machine::Nucleo, 0.0, 3.0),
        (Machine::Nucleo, 800.0, 3.0),
    ] {
        let case = cases()
            .into_iter()
            .find(|case| (case.machine, case.nut_rpm, case.controller) == (machine, nut_rpm, ours))
            .unwrap();
        let left = case.run(1).unwrap().vrf;
        assert!(
            left < limit,
            "{}, {nut_rpm} rpm: {left:.2} % is left, expected less than {limit} %",
            machine.name()
        );
    }
}

/// Once a torque is learned, the speed follows a reference of the same order at once. With the loops' lag in its model, the encoder's order of
/// 133 Hz grew until the voltage watch stopped the drive.
#[test]
fn an_order_of_the_torque_and_of_the_encoder_does_not_grow() {
    let setup = setup(Machine::Coupled, 1);
    let mut plate = orders(&setup, 0.5, true);
    for (axis, orders) in Axis::ALL.iter().zip(&mut plate.angle) {
        let twice = 2.0 * f64::from(setup.model.motor(*axis).pole_pairs);
        orders[3] = OrderPlate::unknown(twice);
    }
    let point = OperatingPoint {
        velocity: 2.5e-3,
        base: 800.0 * RPM,
    };
    let left = smoothness(&mut drive(&setup, plate).unwrap(), point, 12.0).unwrap();
    assert!(
        left.vrf < 0.8,
        "{:.2} % is left, expected less than 0.8 %",
        left.vrf
    );
}

/// Before the search took one coefficient for all holds, the first had 23 % left and the last ended with a fault. Of that one four seeds
/// leave 2.9 to 3.5 %: half of it is the counts of its encoders.
#[test]
fn orders_that_no_setting_names_are_searched_and_learned() {
    let cases = [
        (Machine::Coupled, Undeclared::BallPassage, 0.0, 1.0),
        (Machine::Coupled, Undeclared::Flux, 800.0, 1.0),
        (Machine::Nucleo, Undeclared::BallPassage, 0.0, 2.6),
        (Machine::Nucleo, Undeclared::BallPassage, 800.0, 4.0),
    ];
    let left = on_all_cores(&cases, |&(machine, case, rpm, _)| {
        ripple(machine, None, case, rpm).unwrap()
    });
    for ((machine, case, rpm, allowed), left) in cases.iter().zip(left) {
        assert!(
            left < *allowed,
            "{machine:?}, {}, nut {rpm} rpm: {left:.2} % is left, expected less than {allowed} %",
            case.name()
        );
    }
}
