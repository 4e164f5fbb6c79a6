//! The first power-up of the default board, as its page has it: a walk through the page's table on the emulated board.

use link::codes::{Demand, Fault, State};
use plant::Axis;
use plant::machine::Coupling;
use plant::model::Model;
use std::collections::BTreeMap;
use tests::bench::{Bench, aligning_firmware_of, counts_at};
use tests::chip::outside::{Circuit, contacts};
use tests::chip::wiring::Wiring;
use tests::pins::Motor;

const PAGE: &str = include_str!("../../../firmware/boards/nucleo_g474re.md");
const BOARD: Wiring = Wiring::Nucleo;
const BOTH: [Motor; 2] = [Motor::Screw, Motor::Nut];
/// Time for a person to look, s: watches and the drivers' wake-up have ended.
const LOOK_S: f64 = 0.2;
/// Longest alignment, s.
const ALIGNS_S: f64 = 15.0;

/// What the page says of a step.
#[derive(Debug)]
struct Row {
    action: String,
    state: String,
    fault: String,
}

/// The steps of the page's table.
fn rows() -> BTreeMap<u32, Row> {
    let table = PAGE.split("### Steps").nth(1).expect("the page has steps");
    let cells = |line: &str| {
        let cells = line.trim_matches('|').split('|');
        cells.map(|cell| cell.trim().to_owned()).collect::<Vec<_>>()
    };
    let rows = table.lines().filter(|line| line.starts_with("| "));
    rows.filter_map(|line| match cells(line).as_slice() {
        [step, action, state, fault] => {
            let row = Row {
                action: action.clone(),
                state: state.clone(),
                fault: fault.clone(),
            };
            Some((step.parse().ok()?, row))
        }
        _ => None,
    })
    .collect()
}

struct Walk {
    bench: Bench,
    rows: BTreeMap<u32, Row>,
}

impl Walk {
    /// The board says what the page says of `step`, whose action is about `of`.
    #[track_caller]
    fn says(&mut self, step: u32, of: &str) {
        let row = self.rows.remove(&step).expect("the page has this step");
        assert!(row.action.contains(of), "step {step} is: {}", row.action);
        let status = self.bench.status().unwrap();
        let state = State::of_words(status.state, status.fault).unwrap();
        let fault = Fault::of_word(status.fault).map_or("", Fault::name);
        assert_eq!(
            (state.name(), fault),
            (&*row.state, &*row.fault),
            "step {step}: {}",
            row.action
        );
    }

    fn pass(&mut self) -> Result<(), String> {
        self.bench.pass(LOOK_S)
    }

    fn reset(&mut self) -> Result<(), String> {
        self.bench.demand(Demand::Reset)?;
        self.pass()
    }

    fn bus(&mut self, volts: f64) {
        self.bench.joint.borrow_mut().board.set_bus_voltage(volts);
        for motor in BOTH {
            let chip = &mut *self.bench.emulator.chip();
            chip.change_stage(motor, |stage| stage.supplied = volts > 0.0);
        }
    }

    fn motors(&mut self, connected: bool) {
        for axis in Axis::ALL {
            let machine = &mut self.bench.joint.borrow_mut().board.machine;
            machine.set_disconnected(axis, !connected);
        }
    }

    fn enable(&mut self, closed: bool) {
        let [first, second, ..] = contacts(BOARD);
        let circuits = &mut self.bench.emulator.chip().outside.circuits;
        for pin in [first, second] {
            if closed {
                circuits.insert(pin, Circuit::Driven(false));
            } else {
                circuits.remove(&pin);
            }
        }
    }
}

/// Friction holds the load, and the motors' cogging is small: see `alignment.rs`.
fn model() -> Model {
    let mut model = Model::coupled();
    model.feed.load_n = 20.0;
    for axis in Axis::ALL {
        for harmonic in &mut model.motor_mut(axis).torque_harmonics {
            harmonic.amplitude_nm *= 0.25;
        }
    }
    model
}

#[test]
fn every_step_of_the_page_ends_as_it_says() -> Result<(), String> {
    let elf = aligning_firmware_of(BOARD)?;
    let bench = Bench::with(&elf, BOARD, &model(), Coupling::Coupled)?;
    let mut walk = Walk {
        bench,
        rows: rows(),
    };
    assert!(walk.rows.remove(&1).is_some_and(|row| row.state.is_empty()));
    walk.bus(0.0);
    walk.motors(false);
    walk.pass()?;
    walk.says(2, "Nucleo by USB");
    walk.says(3, "Encoders' 5 V");
    walk.bus(12.0);
    walk.pass()?;
    walk.reset()?;
    walk.says(4, "12 V");
    walk.bus(24.0);
    walk.pass()?;
    walk.says(5, "24 V");
    for (step, motor) in [(6, Motor::Screw), (7, Motor::Nut)] {
        walk.bench.emulator.chip().driver_fault(motor, true);
        walk.bench.pass(1e-3)?;
        walk.bench.emulator.chip().driver_fault(motor, false);
        walk.pass()?;
        walk.says(step, if step == 6 { "nFAULT" } else { "nut's stage" });
        walk.reset()?;
    }
    for cut in [true, false] {
        for motor in BOTH {
            walk.bench
                .emulator
                .chip()
                .change_stage(motor, |stage| stage.enable_cut = cut);
        }
        walk.pass()?;
        if cut {
            walk.says(8, "emergency stop");
        } else {
            walk.reset()?;
            walk.says(9, "Release it");
        }
    }
    let [_, nut] = counts_at(BOARD, 25.0);
    walk.bench.joint.borrow_mut().temperatures = [4095, nut];
    walk.pass()?;
    walk.says(10, "thermistor");
    walk.bench.joint.borrow_mut().temperatures = counts_at(BOARD, 25.0);
    walk.pass()?;
    walk.reset()?;
    walk.enable(false);
    walk.pass()?;
    walk.bench.demand(Demand::Align)?;
    walk.pass()?;
    walk.says(11, "enable switch");
    walk.enable(true);
    walk.pass()?;
    walk.reset()?;
    walk.bench.demand(Demand::Align)?;
    walk.bench.pass(5.0)?;
    walk.says(12, "Without motors");
    walk.motors(true);
    walk.reset()?;
    walk.says(13, "Motors on");
    let stands = walk.bench.joint.borrow().board.machine.table_position();
    walk.bench.align(ALIGNS_S)?;
    walk.says(14, "`arm`");
    let moved = walk.bench.joint.borrow().board.machine.table_position() - stands;
    assert!(
        moved.abs() < 50e-6,
        "the alignment moved the table by {moved} m"
    );
    walk.bench.start(2.5e-3, 0.0)?;
    walk.pass()?;
    walk.says(15, "jog");
    walk.enable(false);
    walk.bench.pass(1.0)?;
    walk.says(16, "while it jogs");
    walk.enable(true);
    walk.pass()?;
    walk.reset()?;
    walk.says(17, "then `reset`");
    assert!(
        walk.rows.is_empty(),
        "steps that nobody walked: {:?}",
        walk.rows
    );
    Ok(())
}
