//! A load that vanishes, on the elastic machine with the bench's encoders and on the mains board as it ships.

use super::mode;
use crate::smooth::Machine;
use crate::smooth::vanishing::{Experience, Vanished, vanishing};
use anyhow::Result;
use ddfeed::simulate::BoardName;
use hal_sim::parallel::on_all_cores;
use serde_json::{Value, json};

/// Machine, what the drive knows, nut speed in rpm, and the ripple.
pub type Case = (Machine, Experience, f64, Vanished);

/// Of both modes, on both machines or on the one of a board.
pub fn measure(board: Option<BoardName>) -> Result<Vec<Case>> {
    let machines = [Machine::Coupled, Machine::Mains];
    let wanted = machines
        .into_iter()
        .filter(|machine| board.is_none_or(|board| board.kind() == machine.board()));
    let cases: Vec<_> = wanted
        .flat_map(|machine| [0.0, 800.0].map(|rpm| (machine, rpm)))
        .flat_map(|(machine, rpm)| Experience::ALL.map(|known| (machine, known, rpm)))
        .collect();
    let left = on_all_cores(&cases, |&(machine, known, rpm)| {
        vanishing(machine, known, rpm)
    });
    let left = cases.into_iter().zip(left);
    left.map(|((machine, known, rpm), left)| Ok((machine, known, rpm, left?)))
        .collect()
}

/// As JSON.
pub fn json(cases: &[Case]) -> Value {
    let one = |(machine, known, rpm, left): &Case| {
        json!({
            "machine": machine.name(),
            "known": known.name(),
            "nut_rpm": rpm,
            "vrf_loaded": left.loaded,
            "vrf_first": left.first,
            "vrf_later": left.later,
        })
    };
    cases.iter().map(one).collect()
}

/// For a person.
pub fn print(cases: &[Case]) {
    println!(
        "\nA load of 1 N m at each motor that vanishes within 0.2 s, 2.5 mm/s: ripple (Eq 19), %, under it; from 0.1 s after its end on for \
         0.4 s; 4 s later"
    );
    for (machine, known, rpm, left) in cases {
        println!(
            "  {:<8} {:<14} {:<28} {:>6.2} {:>6.2} {:>6.2}",
            machine.name(),
            mode(*rpm),
            known.name(),
            left.loaded,
            left.first,
            left.later
        );
    }
}
