//! Sensor faults of growing size.

use super::{board_name, cause};
use crate::faults::{SmallFault, SmallOutcome, small_fault};
use anyhow::Result;
use hal_sim::boards::BoardKind;
use hal_sim::parallel::on_all_cores;
use hal_sim::switching::Switching;
use serde::Serialize;

/// Where they are tried: the nut held, and the paper's fastest nut.
const NUT_RPM: [f64; 2] = [0.0, 800.0];

/// One fault on one board.
#[derive(Serialize)]
pub(super) struct Row {
    board: &'static str,
    nut_rpm: f64,
    fault: String,
    stopped_by: Option<&'static str>,
    stopped_ms: Option<f64>,
    table_um: f64,
    ripple_percent: f64,
    current_percent: f64,
}

/// All sizes on both boards.
pub(super) fn rows(switching: Option<Switching>) -> Result<Vec<Row>> {
    let mut all = Vec::new();
    for board in [BoardKind::Mains, BoardKind::Nucleo] {
        for nut_rpm in NUT_RPM {
            // An encoder that froze while the nut stood shows once it turns.
            let tried = SmallFault::all().into_iter();
            let tried = tried.filter(|fault| *fault != SmallFault::FrozenAtRest || nut_rpm > 0.0);
            all.extend(tried.map(|fault| (board, nut_rpm, fault)));
        }
    }
    let outcomes = on_all_cores(&all, |(board, nut_rpm, fault)| {
        small_fault(*board, switching, *fault, *nut_rpm)
    });
    all.iter()
        .zip(outcomes)
        .map(|((board, nut_rpm, fault), outcome)| {
            let SmallOutcome {
                state,
                stopped_s,
                table_m,
                ripple,
                current,
            } = outcome?;
            Ok(Row {
                board: board_name(*board),
                nut_rpm: *nut_rpm,
                fault: fault.name(),
                stopped_by: cause(state),
                stopped_ms: stopped_s.map(|seconds| 1e3 * seconds),
                table_um: 1e6 * table_m,
                ripple_percent: 1e2 * ripple,
                current_percent: 1e2 * current,
            })
        })
        .collect()
}

pub(super) fn tell(rows: &[Row]) {
    for row in rows {
        if let (Some(fault), Some(0.0)) = (row.stopped_by, row.stopped_ms) {
            println!(
                "{:<14} nut {:>3.0} rpm, {:<32} stops before it is at its point: {fault}",
                row.board, row.nut_rpm, row.fault
            );
            continue;
        }
        let end = match (row.stopped_by, row.stopped_ms) {
            (Some(fault), Some(ms)) => format!("stops after {ms:.1} ms: {fault}"),
            _ => format!("goes on, ripple {:.1} % rms", row.ripple_percent),
        };
        println!(
            "{:<14} nut {:>3.0} rpm, {:<32} table off by {:>8.1} um, current {:>4.0} % of its limit; {end}",
            row.board, row.nut_rpm, row.fault, row.table_um, row.current_percent
        );
    }
}
