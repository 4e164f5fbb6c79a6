//! `ddfeed ripple`: how much the table's velocity ripples in each hold of a recording, and with which turns.

mod lines;
mod page;

use crate::output::{Folder, refuse_inputs};
use anyhow::{Context, Result, ensure};
use clap::Args;
use hal_sim::experiment::{OperatingPoint, RPM};
use hal_sim::hold_ripple::{Ripple, bandwidth_hz, holds, recorded, ripple_interval_s, window};
use hal_sim::vrf::spectrum;
use lines::{Line, lines, turns};
use plant::model::Model;
use plant::recording::Recording;
use serde_json::json;
use std::path::{Path, PathBuf};

/// A count of the scale is reported where it makes more than this part of the ripple.
const COARSE: f64 = 0.2;

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

/// A line for each hold in which the table moves, or why there is none; `count_m` is a count of the scale.
pub fn short_text(recording: &Recording, travel: f64, count_m: f64) -> String {
    match of(recording, travel) {
        Ok(all) => {
            let holds: String = all.iter().map(HoldRipple::sentence).collect();
            heading(&all) + &holds + &coarseness(&all, count_m)
        }
        Err(error) => format!("no ripple: {error}\n"),
    }
}

/// What one count of the scale makes of the velocity, for the holds in which it is much of the ripple.
fn coarseness(all: &[HoldRipple], count_m: f64) -> String {
    let Some(window_s) = all.first().map(HoldRipple::window_s) else {
        return String::new();
    };
    let step_m_s = count_m / window_s;
    let mut coarse = Vec::new();
    for hold in all {
        let percent = 100.0 * step_m_s / hold.point.velocity.abs();
        if percent > COARSE * hold.ripple.vrf_percent {
            let mm_s = 1e3 * hold.point.velocity;
            coarse.push(format!("{percent:.2} % of {mm_s:.3} mm/s"));
        }
    }
    coarse.dedup();
    if coarse.is_empty() {
        return String::new();
    }
    format!(
        "one count of the scale alone, {:.3} um in {:.1} ms, makes {}\n",
        1e6 * count_m,
        1e3 * window_s,
        coarse.join(", ")
    )
}

fn heading(all: &[HoldRipple]) -> String {
    let bandwidth = all
        .first()
        .map_or(0.0, |hold| bandwidth_hz(hold.interval_s));
    format!("ripple of the table by its scale, up to {bandwidth:.0} Hz:\n")
}

impl HoldRipple {
    /// Time that a velocity is the mean of, s.
    fn window_s(&self) -> f64 {
        self.interval_s * window(self.interval_s) as f64
    }

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
