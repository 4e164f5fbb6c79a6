//! `cargo xtask bench smooth`: how smooth the table moves, beside what others do.

mod page;

use super::SmoothOptions;
use crate::output::Folder;
use anyhow::Result;
use hal_sim::parallel::on_all_cores;
use hal_sim::smooth::bench::{Case, Change, Controller, Row, cases, learning_s, robustness, rows};
use hal_sim::smooth::reversal::reversal;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};

/// Runs and prints.
pub(super) fn run(options: &SmoothOptions) -> Result<()> {
    let folder = options.out.as_deref().map(Folder::open).transpose()?;
    let cases = cases();
    let runs = cases.len() as u64 * options.seeds.get();
    let progress = ProgressBar::new(runs).with_style(ProgressStyle::with_template(
        "{bar:40} {pos} of {len} runs, {eta} left",
    )?);
    let rows = rows(&cases, options.seeds.get(), || progress.inc(1));
    progress.finish_and_clear();
    let changes = Change::ALL;
    let robust = on_all_cores(&changes, |&change| robustness(change));
    let [cold, saved] = learning_s()?;
    const MODES: [(&str, f64); 3] = [
        ("CDFS", 0.0),
        ("DDFS 300 rpm", 300.0),
        ("DDFS 800 rpm", 800.0),
    ];
    let reversals = on_all_cores(&MODES, |&(_, nut_rpm)| reversal(nut_rpm))
        .into_iter()
        .collect::<Result<Vec<_>, _>>()?;
    if let Some(folder) = &folder {
        folder.put_text("smooth.html", &page::page(&rows, options.seeds.get()))?;
        if !options.json {
            println!("{}", folder.path("smooth.html").display());
        }
    }
    if options.json {
        let report = json!({
            "rows": rows.iter().map(row_json).collect::<Vec<_>>(),
            "robustness": changes.iter().zip(&robust).map(|(change, [pi, ours])| json!({
                "change": change.name(),
                "vrf_pi": pi,
                "vrf_ours": ours,
                "stable": ours.is_some(),
            })).collect::<Vec<_>>(),
            "reversal": MODES.iter().zip(&reversals).map(|((mode, _), [pi, ours])| json!({
                "mode": mode,
                "error_pi_percent": pi,
                "error_ours_percent": ours,
            })).collect::<Vec<_>>(),
            "learning_s": {"cold": cold, "saved": saved},
        });
        println!("{report}");
        return Ok(());
    }
    println!(
        "Ripple of the true table velocity (Eq 19), %, median and worst of {} seeds, and rms error, %",
        options.seeds
    );
    let mut before: Option<Case> = None;
    for row in &rows {
        let case = row.case;
        let same = before.is_some_and(|before| {
            (before.machine, before.nut_rpm, before.table_mm_s)
                == (case.machine, case.nut_rpm, case.table_mm_s)
        });
        if !same {
            println!(
                "\n{}, {}, {} mm/s",
                case.machine.name(),
                mode(&case),
                case.table_mm_s
            );
        }
        before = Some(case);
        println!("  {:<26} {}", called(&case), figures(row));
    }
    println!(
        "\nCoupled, DDFS 800 rpm, 2.5 mm/s, when something is other than the drive was told: PI, ours"
    );
    for (change, [pi, ours]) in changes.iter().zip(&robust) {
        let say = |vrf: &Option<f64>| vrf.map_or("fault".into(), |vrf| format!("{vrf:.2} %"));
        println!("  {:<36} {:>9} {:>9}", change.name(), say(pi), say(ours));
    }
    println!(
        "\nReversal of 1 mm/s at 0.5 Hz through friction that sticks, largest error over the amplitude: PI, ours"
    );
    for ((mode, _), [pi, ours]) in MODES.iter().zip(&reversals) {
        println!("  {mode:<36} {pi:>7.1} % {ours:>7.1} %");
    }
    println!(
        "\nWithin twice the final ripple after {cold:.1} s from cold, {saved:.1} s from saved tables"
    );
    Ok(())
}

fn mode(case: &Case) -> String {
    if case.nut_rpm == 0.0 {
        "CDFS".into()
    } else {
        format!("DDFS {} rpm", case.nut_rpm)
    }
}

fn called(case: &Case) -> String {
    match case.controller {
        Controller::Ours(scale) => format!("ours, scale {}", scale.name()),
        Controller::Rival(rival) => rival.name().into(),
    }
}

fn figures(row: &Row) -> String {
    match (row.vrf, row.rms) {
        (Some([median, worst]), Some(rms)) => {
            format!("{median:>7.2} {worst:>7.2} {rms:>8.3}")
        }
        _ => row.failed.clone().unwrap_or_default(),
    }
}

fn row_json(row: &Row) -> Value {
    let case = &row.case;
    json!({
        "machine": case.machine.name(),
        "mode": if case.nut_rpm == 0.0 { "CDFS" } else { "DDFS" },
        "nut_rpm": case.nut_rpm,
        "table_mm_s": case.table_mm_s,
        "controller": case.controller.name(),
        "scale": match case.controller {
            Controller::Ours(scale) => Some(scale.name()),
            Controller::Rival(_) => None,
        },
        "vrf_median": row.vrf.map(|[median, _]| median),
        "vrf_worst": row.vrf.map(|[_, worst]| worst),
        "rms_percent": row.rms,
        "failed": row.failed,
    })
}
