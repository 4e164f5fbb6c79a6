//! Orders that no setting names, on the elastic machine and on boards as they ship.

use super::mode;
use crate::smooth::Machine;
use crate::smooth::undeclared::{Undeclared, ripple};
use ddfeed::simulate::BoardName;
use hal_sim::parallel::on_all_cores;
use hal_sim::switching::Switching;
use serde_json::{Value, json};

/// Nut speeds, rpm.
const MODES: [f64; 2] = [0.0, 800.0];

/// The machine, what it has, nut speed in rpm, and ripple in %.
pub type Case = (Machine, Undeclared, f64, Result<f64, String>);

/// Of all cases in both modes, on all machines or on the one of a board.
pub fn measure(board: Option<BoardName>, switching: Option<Switching>) -> Vec<Case> {
    let machines = [Machine::Coupled, Machine::Mains, Machine::Nucleo];
    let cases: Vec<_> = machines
        .into_iter()
        .filter(|machine| board.is_none_or(|board| board.kind() == machine.board()))
        .flat_map(|machine| Undeclared::ALL.map(|case| (machine, case)))
        .flat_map(|(machine, case)| MODES.map(|rpm| (machine, case, rpm)))
        .collect();
    let left = on_all_cores(&cases, |&(machine, case, rpm)| {
        ripple(machine, switching, case, rpm).map_err(|error| error.to_string())
    });
    cases
        .into_iter()
        .zip(left)
        .map(|((machine, case, rpm), left)| (machine, case, rpm, left))
        .collect()
}

/// As JSON.
pub fn json(cases: &[Case]) -> Value {
    let one = |(machine, case, rpm, left): &Case| {
        json!({
            "machine": machine.name(),
            "has": case.name(),
            "nut_rpm": rpm,
            "vrf": left.as_ref().ok(),
            "failed": left.as_ref().err(),
        })
    };
    cases.iter().map(one).collect()
}

/// For a person.
pub fn print(cases: &[Case]) {
    println!(
        "\nOrders that no setting names, 2.5 mm/s: searched in a recording, then 12 s of learning from cold; ripple (Eq 19), %. Axial damping \
         1.6 %; the elastic machine has 20-bit encoders and 1 N m at each motor, the boards their own encoders and no load"
    );
    for (machine, case, rpm, left) in cases {
        let left = match left {
            Ok(left) => format!("{left:>6.2}"),
            Err(why) => why.clone(),
        };
        println!(
            "  {:<8} {:<32} {:<14} {left}",
            machine.name(),
            case.name(),
            mode(*rpm)
        );
    }
}
