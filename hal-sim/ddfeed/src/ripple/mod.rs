//! `ddfeed ripple`: how much the table's velocity ripples in each hold of a recording, and with which turns.

mod lines;
mod page;

use crate::output::{Folder, refuse_inputs};
use anyhow::{Context, Result, ensure};
use clap::Args;
use hal_sim::experiment::{OperatingPoint, RPM};
use hal_sim::hold_ripple::{Ripple, bandwidth_hz, holds, recorded, ripple_interval_s};
use hal_sim::vrf::spectrum;
use lines::{Line, lines, turns};
use plant::model::Model;
use plant::recording::Recording;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Which recording.
#[derive(Args, Debug)]
pub struct RippleOptions {
    /// The recording: what `record` writes.
    pub recording: PathBuf,
    /// The model that has the lead. [default: model.toml beside the recording]
    #[arg(long)]
    pub model: Option<PathBuf>,
    /// Folder for ripple.html: time, spectrum and orders of each hold.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// As JSON.
    #[arg(long, conflicts_with = "out")]
    pub json: bool,
}

/// A hold's ripple.
pub struct HoldRipple {
    /// Table velocity and nut speed that were asked.
    pub point: OperatingPoint,
    /// Time between two velocities, s.
    pub interval_s: f64,
    /// Velocities by the scale, mean of 1 ms, mm/s.
    pub mm_s: Vec<f64>,
    /// Peak to peak and root mean square.
    pub ripple: Ripple,
    /// Frequency, Hz, and amplitude, mm/s.
    pub spectrum: Vec<(f64, f64)>,
    /// The strongest lines.
    pub lines: Vec<Line>,
}

/// The ripple of all holds; `travel` of the table in m for a radian of screw against nut.
pub fn of(recording: &Recording, travel: f64) -> Result<Vec<HoldRipple>> {
    let interval_s = ripple_interval_s(recording)?;
    let of = |hold| {
        let velocities = recorded(recording, &hold);
        let mm_s: Vec<f64> = velocities.iter().map(|v| 1e3 * v).collect();
        let bandwidth = bandwidth_hz(interval_s);
        let spectrum: Vec<(f64, f64)> = spectrum(&mm_s, 1.0 / interval_s)
            .into_iter()
            .filter(|(hz, _)| *hz <= bandwidth)
            .collect();
        HoldRipple {
            point: hold.point,
            interval_s,
            ripple: Ripple::of(&velocities, interval_s, hold.point.velocity),
            lines: lines(&spectrum, &turns(hold.point, travel)),
            mm_s,
            spectrum,
        }
    };
    let all: Vec<HoldRipple> = holds(recording, travel).into_iter().map(of).collect();
    ensure!(
        !all.is_empty(),
        "the recording holds no speed of the table: record with --hold MM_S,RPM,S"
    );
    Ok(all)
}

/// Prints them, and writes the page.
pub fn run(options: &RippleOptions) -> Result<()> {
    let file = &options.recording;
    let beside = file.parent().unwrap_or(Path::new("")).join("model.toml");
    let model_file = options.model.as_ref().unwrap_or(&beside);
    let model = Model::load(model_file).with_context(|| {
        format!(
            "the lead stands in {}: name it with --model",
            model_file.display()
        )
    })?;
    let recording =
        Recording::load(file).with_context(|| format!("the recording {}", file.display()))?;
    let all = of(&recording, model.feed.travel_per_radian())
        .with_context(|| format!("{}", file.display()))?;
    if options.json {
        println!("{}", report(&all));
        return Ok(());
    }
    print!("{}", text(&all));
    if let Some(out) = &options.out {
        refuse_inputs(out, &["ripple.html"], &[file, model_file])?;
        let folder = Folder::open(out)?;
        folder.put_text("ripple.html", &page::page(file, &all))?;
        println!("{}", folder.path("ripple.html").display());
    }
    Ok(())
}

/// A line for each hold, with its strongest lines below.
fn text(all: &[HoldRipple]) -> String {
    let mut text = heading(all);
    for hold in all {
        text += &hold.sentence();
        for line in &hold.lines {
            text += &format!(
                "      {:7.1} Hz {:9.5} mm/s  {}\n",
                line.hz,
                line.mm_s,
                line.orders.join(", or ")
            );
        }
    }
    text
}

/// A line for each hold in which the table moves, or why there is none.
pub fn short_text(recording: &Recording, travel: f64) -> String {
    match of(recording, travel) {
        Ok(all) => heading(&all) + &all.iter().map(HoldRipple::sentence).collect::<String>(),
        Err(error) => format!("no ripple: {error}\n"),
    }
}

fn heading(all: &[HoldRipple]) -> String {
    let bandwidth = all
        .first()
        .map_or(0.0, |hold| bandwidth_hz(hold.interval_s));
    format!("ripple of the table by its scale, up to {bandwidth:.0} Hz:\n")
}

impl HoldRipple {
    fn sentence(&self) -> String {
        if self.ripple.rms_percent == 0.0 {
            return "  the table did not move by its scale, or there is none\n".to_owned();
        }
        format!(
            "  {:7.3} mm/s, nut {:6.0} rpm: {:6.2} % peak to peak (Eq 19), {:6.3} % rms\n",
            1e3 * self.point.velocity,
            self.point.base / RPM,
            self.ripple.vrf_percent,
            self.ripple.rms_percent
        )
    }
}

fn report(all: &[HoldRipple]) -> serde_json::Value {
    let of = |hold: &HoldRipple| {
        json!({
            "table_mm_s": 1e3 * hold.point.velocity,
            "nut_rpm": hold.point.base / RPM,
            "bandwidth_hz": bandwidth_hz(hold.interval_s),
            "vrf_percent": hold.ripple.vrf_percent,
            "rms_percent": hold.ripple.rms_percent,
            "lines": hold.lines.iter().map(|line| json!({
                "hz": line.hz, "mm_s": line.mm_s, "orders": line.orders,
            })).collect::<Vec<_>>(),
        })
    };
    json!({ "holds": all.iter().map(of).collect::<Vec<_>>() })
}
