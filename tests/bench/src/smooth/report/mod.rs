//! `cargo xtask bench smooth`: how smooth the table moves, beside what others do.

mod disturbance;
mod floor;
mod hum;
mod page;
mod reversals;
mod undeclared;
mod vanishing;
mod wrong_settings;

use crate::smooth::bench::{Case, Controller, Row, cases, learning_s, rows};
use anyhow::Result;
use clap::Args;
use ddfeed::output::Folder;
use ddfeed::simulate::{BoardName, Bridges};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Map, Value, json};

/// Nut speeds at which a table is reversed, rpm.
const MODES: [f64; 3] = [0.0, 300.0, 800.0];

/// How many, and how to say it.
#[derive(Args)]
pub struct SmoothOptions {
    /// Seeds of each row.
    #[arg(long, default_value = "5")]
    pub seeds: std::num::NonZeroU64,
    /// Of the rows only those of one board, or of the paper's machine.
    #[arg(long, value_enum)]
    pub board: Option<BoardName>,
    /// How the bridges of the rows make their voltages.
    #[arg(long, value_enum, default_value = "mean")]
    pub bridges: Bridges,
    /// Only these parts.
    #[arg(long, value_enum, num_args = 1..)]
    pub only: Vec<SmoothPart>,
    /// Writes the table as a picture into this folder.
    #[arg(long)]
    pub out: Option<std::path::PathBuf>,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// A part of the bench of smoothness.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum SmoothPart {
    /// Machines, modes, speeds and controllers, side by side.
    Rows,
    /// The drive has wrong settings.
    Robustness,
    /// Reversal through friction.
    Reversal,
    /// A step of load, and a base speed that wanders.
    Disturbance,
    /// A load that vanishes.
    Vanishing,
    /// Orders that no setting names.
    Undeclared,
    /// Time to learn.
    Learning,
    /// What sets the ripple that is left.
    Floor,
    /// Record, identify, compensate, record again.
    Loop,
}

/// Runs and prints.
pub fn run(options: &SmoothOptions) -> Result<()> {
    let folder = options.out.as_deref().map(Folder::open).transpose()?;
    let mut report = Map::new();
    let of = |part: SmoothPart| options.only.is_empty() || options.only.contains(&part);
    let mut put = |key: &str, value: Value, print: &dyn Fn()| {
        report.insert(key.into(), value);
        if !options.json {
            print();
        }
    };
    if of(SmoothPart::Rows) {
        let rows = measure(options)?;
        if let Some(folder) = &folder {
            folder.put_text("smooth.html", &page::page(&rows, options.seeds.get()))?;
            folder.put_text("smooth.svg", &page::picture(&rows))?;
            if !options.json {
                println!("{}", folder.path("smooth.html").display());
            }
        }
        put("rows", rows.iter().map(row_json).collect(), &|| {
            print_rows(&rows, options.seeds.get());
        });
    }
    if of(SmoothPart::Robustness) {
        let robust = wrong_settings::measure();
        put("robustness", wrong_settings::json(&robust), &|| {
            wrong_settings::print(&robust);
        });
    }
    if of(SmoothPart::Reversal) {
        let reversals = reversals::measure()?;
        put("reversal", reversals::json(&reversals), &|| {
            reversals::print(&reversals);
        });
    }
    if of(SmoothPart::Disturbance) {
        let steps = disturbance::load_steps()?;
        put("load_step", disturbance::load_steps_json(&steps), &|| {
            disturbance::print_load_steps(&steps);
        });
        let wanders = disturbance::wanders()?;
        put("wander", disturbance::wanders_json(&wanders), &|| {
            disturbance::print_wanders(&wanders);
        });
    }
    if of(SmoothPart::Vanishing) {
        let vanished = vanishing::measure(options.board)?;
        put("vanishing", vanishing::json(&vanished), &|| {
            vanishing::print(&vanished);
        });
    }
    if of(SmoothPart::Undeclared) {
        let cases = undeclared::measure(options.board, options.bridges.switching());
        put("undeclared", undeclared::json(&cases), &|| {
            undeclared::print(&cases);
        });
    }
    if of(SmoothPart::Learning) {
        let [cold, saved] = learning_s()?;
        put("learning_s", json!({"cold": cold, "saved": saved}), &|| {
            println!(
                "\nWithin twice the final ripple after {cold:.1} s from cold, {saved:.1} s from saved tables"
            );
        });
    }
    if of(SmoothPart::Floor) {
        let floor = floor::measure()?;
        put("floor", floor::json(&floor), &|| floor::print(&floor));
        let boards = floor::boards()?;
        put("floor_boards", floor::boards_json(&boards), &|| {
            floor::print_boards(&boards);
        });
    }
    if of(SmoothPart::Loop) {
        let hums = hum::measure();
        put("loop", hums.iter().map(hum::Told::json).collect(), &|| {
            hum::print(&hums);
        });
    }
    if options.json {
        println!("{}", Value::Object(report));
    }
    Ok(())
}

/// All rows, with progress.
fn measure(options: &SmoothOptions) -> Result<Vec<Row>> {
    let board = options.board;
    let wanted = |case: &Case| board.is_none_or(|board| board.kind() == case.machine.board());
    let switching = options.bridges.switching();
    let cases: Vec<Case> = cases()
        .into_iter()
        .filter(wanted)
        .map(|case| Case { switching, ..case })
        .collect();
    let runs = cases.len() as u64 * options.seeds.get();
    let progress = ProgressBar::new(runs).with_style(ProgressStyle::with_template(
        "{bar:40} {pos} of {len} runs, {eta} left",
    )?);
    let rows = rows(&cases, options.seeds.get(), || progress.inc(1));
    progress.finish_and_clear();
    Ok(rows)
}

fn print_rows(rows: &[Row], seeds: u64) {
    println!(
        "Ripple of the true table velocity (Eq 19), %: median and worst of {seeds} seeds; rms error, %; ripple below 1 kHz and \
         below 100 Hz, %; position about the best-fit line, rms and largest, nm"
    );
    let mut before: Option<Case> = None;
    for row in rows {
        let case = row.case;
        let same = before.is_some_and(|before| {
            (before.machine, before.nut_rpm, before.table_mm_s)
                == (case.machine, case.nut_rpm, case.table_mm_s)
        });
        if !same {
            println!(
                "\n{}, {}, {} mm/s",
                case.machine.name(),
                mode(case.nut_rpm),
                case.table_mm_s
            );
        }
        before = Some(case);
        println!("  {:<26} {}", called(&case), figures(row));
    }
}

fn mode(nut_rpm: f64) -> String {
    if nut_rpm == 0.0 {
        "CDFS".into()
    } else {
        format!("DDFS {nut_rpm} rpm")
    }
}

fn called(case: &Case) -> String {
    match case.controller {
        Controller::Ours(scale) => format!("ours, scale {}", scale.name()),
        Controller::Rival(rival) => rival.name().into(),
    }
}

fn figures(row: &Row) -> String {
    match &row.left {
        Ok(left) => {
            let median = &left.median;
            let ([khz, hundred], [rms, largest]) = (median.bands, median.following);
            format!(
                "{:>7.2} {:>7.2} {:>8.3} {khz:>7.2} {hundred:>7.2} {:>8.0} {:>8.0}",
                median.vrf,
                left.worst,
                median.rms,
                rms * 1e9,
                largest * 1e9
            )
        }
        Err(why) => why.clone(),
    }
}

fn row_json(row: &Row) -> Value {
    let case = &row.case;
    let left = row.left.as_ref().ok();
    let median = left.map(|left| left.median);
    json!({
        "machine": case.machine.name(),
        "mode": if case.nut_rpm == 0.0 { "CDFS" } else { "DDFS" },
        "nut_rpm": case.nut_rpm,
        "table_mm_s": case.table_mm_s,
        "controller": case.controller.name(),
        "bridges": if case.switching.is_some() { "switching" } else { "mean" },
        "scale": match case.controller {
            Controller::Ours(scale) => Some(scale.name()),
            Controller::Rival(_) => None,
        },
        "vrf_median": median.map(|median| median.vrf),
        "vrf_worst": left.map(|left| left.worst),
        "rms_percent": median.map(|median| median.rms),
        "vrf_below_1_khz": median.map(|median| median.bands[0]),
        "vrf_below_100_hz": median.map(|median| median.bands[1]),
        "following_rms_nm": median.map(|median| median.following[0] * 1e9),
        "following_peak_nm": median.map(|median| median.following[1] * 1e9),
        "failed": row.left.as_ref().err(),
    })
}
