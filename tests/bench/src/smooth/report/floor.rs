//! What sets the ripple that is left, by machine and mode.

use super::mode;
use crate::smooth::Machine;
use crate::smooth::bench::COLD_S;
use crate::smooth::floor::{Without, board_alone, floor, learned_in_double_drive};
use anyhow::Result;
use hal_sim::parallel::on_all_cores;
use hal_sim::smooth::Smoothness;
use serde_json::{Value, json};

/// Where it is looked at: machine, and nut speed, rpm.
const POINTS: [(Machine, f64); 2] = [(Machine::Lumped, 0.0), (Machine::Lumped, 800.0)];

/// The same with the table velocity, m/s: the boards as they ship, and creep.
const BOARDS: [(Machine, f64, f64); 12] = [
    (Machine::Mains, 0.0, USUAL),
    (Machine::Mains, 300.0, USUAL),
    (Machine::Mains, 500.0, USUAL),
    (Machine::Mains, 800.0, USUAL),
    (Machine::Nucleo, 0.0, USUAL),
    (Machine::Nucleo, 300.0, USUAL),
    (Machine::Nucleo, 500.0, USUAL),
    (Machine::Nucleo, 800.0, USUAL),
    (Machine::Coupled, 0.0, CREEP),
    (Machine::Coupled, 300.0, CREEP),
    (Machine::Mains, 0.0, CREEP),
    (Machine::Nucleo, 0.0, CREEP),
];

/// Table velocities, m/s.
const USUAL: f64 = 2.5e-3;
const CREEP: f64 = 0.1e-3;
/// Nut speed that is learned at before the table creeps, rpm.
const LEARNS_RPM: f64 = 100.0;

/// Ripple with one thing switched off, at each point.
pub(super) type Floor = Vec<(Without, Vec<Smoothness>)>;

/// Ripple of a board: of a machine without any, of ours, and of ours that has learned in the double drive where the table creeps.
type Board = (Smoothness, Smoothness, Option<Smoothness>);

/// What each board leaves of a machine without ripple, and ours of the one that ripples.
pub(super) fn boards() -> Result<Vec<Board>> {
    let left = on_all_cores(&BOARDS, |&(machine, nut_rpm, velocity)| {
        let ours = floor(machine, nut_rpm, velocity, Without::Nothing)?;
        let alone = board_alone(machine, nut_rpm, velocity, 1)?;
        let cold = if velocity == CREEP && nut_rpm == 0.0 {
            Some(learned_in_double_drive(
                machine, velocity, LEARNS_RPM, COLD_S, 1,
            )?)
        } else {
            None
        };
        Ok((alone, ours, cold))
    });
    left.into_iter().collect()
}

pub(super) fn boards_json(boards: &[Board]) -> Value {
    let rows = BOARDS.iter().zip(boards);
    rows.map(|((machine, nut_rpm, velocity), (alone, ours, cold))| {
        json!({
            "machine": machine.name(),
            "nut_rpm": nut_rpm,
            "table_mm_s": 1e3 * velocity,
            "vrf_board_alone": alone.vrf,
            "vrf_ours": ours.vrf,
            "vrf_learned_in_double_drive": cold.map(|cold| cold.vrf),
        })
    })
    .collect()
}

pub(super) fn print_boards(boards: &[Board]) {
    println!(
        "\nBoards as they ship, %: what they leave of a machine without ripple; ours with ripple, from cold at that speed; ours \
         that has learned in the double drive at 100 rpm"
    );
    for ((machine, nut_rpm, velocity), (alone, ours, cold)) in BOARDS.iter().zip(boards) {
        let mm_s = 1e3 * velocity;
        let what = format!("{}, {}, {mm_s} mm/s", machine.name(), mode(*nut_rpm));
        let cold = cold.map_or(String::new(), |cold| format!("{:>7.2}", cold.vrf));
        println!("  {what:<60} {:>7.2} {:>7.2} {cold}", alone.vrf, ours.vrf);
    }
}

/// All, on all cores.
pub(super) fn measure() -> Result<Floor> {
    let runs: Vec<_> = Without::ALL
        .into_iter()
        .flat_map(|without| POINTS.map(|point| (without, point)))
        .collect();
    let left = on_all_cores(&runs, |&(without, (machine, nut_rpm))| {
        floor(machine, nut_rpm, USUAL, without)
    });
    let left = left.into_iter().collect::<Result<Vec<_>, _>>()?;
    let of_each = left.chunks(POINTS.len()).map(<[_]>::to_vec);
    Ok(Without::ALL.into_iter().zip(of_each).collect())
}

pub(super) fn json(floor: &Floor) -> Value {
    let of = |without: Without, left: &[Smoothness]| -> Vec<Value> {
        let points = POINTS.iter().zip(left);
        points
            .map(|((machine, nut_rpm), left)| {
                json!({
                    "without": without.name(),
                    "machine": machine.name(),
                    "nut_rpm": nut_rpm,
                    "vrf": left.vrf,
                })
            })
            .collect()
    };
    let all = floor.iter().flat_map(|(without, left)| of(*without, left));
    all.collect()
}

pub(super) fn print(floor: &Floor) {
    let points = POINTS.map(|(machine, rpm)| format!("{}, {}", machine.name(), mode(rpm)));
    println!(
        "\nWhat sets the floor at 2.5 mm/s: ours without one thing, %; {}",
        points.join("; ")
    );
    for (without, left) in floor {
        let left: Vec<String> = left
            .iter()
            .map(|left| format!("{:>7.2}", left.vrf))
            .collect();
        println!("  {:<60} {}", without.name(), left.join(" "));
    }
}
