//! Alignments that are interrupted at random moments.

use super::board_name;
use crate::faults::{Interrupted, Interruption, alignment_s, interrupt};
use anyhow::Result;
use hal_sim::boards::BoardKind;
use hal_sim::parallel::on_all_cores;
use serde::Serialize;

/// Machines of each board, which differ by where their rotors stand.
const MACHINES: u64 = 16;

/// One cause on one board.
#[derive(Serialize)]
pub(super) struct Row {
    board: &'static str,
    cause: &'static str,
    moments: usize,
    right: usize,
    travel_mm_worst: f64,
    open_ms_worst: f64,
    wrong: Vec<String>,
}

/// Each cause at so many moments, on both boards.
pub(super) fn rows(moments: u64) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    if moments == 0 {
        return Ok(rows);
    }
    for board in [BoardKind::Nucleo, BoardKind::Mains] {
        let machines: Vec<u64> = (0..MACHINES.min(moments)).collect();
        let whole = on_all_cores(&machines, |machine| alignment_s(board, *machine));
        let whole: Vec<f64> = whole.into_iter().collect::<Result<_, _>>()?;
        let draws: Vec<(u64, f64, u64)> = (0..moments)
            .zip(machines.iter().zip(whole).cycle())
            .map(|(draw, (machine, whole_s))| (*machine, whole_s, draw))
            .collect();
        for cause in Interruption::ALL {
            let all = on_all_cores(&draws, |(machine, whole_s, draw)| {
                interrupt(board, cause, *machine, *whole_s, *draw)
            });
            let all: Vec<Interrupted> = all.into_iter().collect::<Result<_, _>>()?;
            let worst = |value: fn(&Interrupted) -> f64| all.iter().map(value).fold(0.0, f64::max);
            let wrong = all.iter().filter(|one| !one.is_right());
            rows.push(Row {
                board: board_name(board),
                cause: cause.name(),
                moments: all.len(),
                right: all.iter().filter(|one| one.is_right()).count(),
                travel_mm_worst: 1e3 * worst(|one| one.travel_m),
                open_ms_worst: 1e3 * worst(|one| one.open_s),
                wrong: wrong.map(|one| format!("{one:?}")).collect(),
            });
        }
    }
    Ok(rows)
}

pub(super) fn tell(rows: &[Row]) {
    for row in rows {
        println!(
            "{:<14} alignment interrupted by {:<18} {} of {} as it must; table at most {:.3} mm; bridges open after at most {:.1} ms",
            row.board, row.cause, row.right, row.moments, row.travel_mm_worst, row.open_ms_worst
        );
        for wrong in &row.wrong {
            println!("  {wrong}");
        }
    }
}
