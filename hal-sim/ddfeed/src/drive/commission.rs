//! `drive commission`: the machine measured step by step, set and tuned, with a report of one page.

use super::connect::Drive;
use super::motion::caught;
use super::options::CommissionOptions;
use super::settings::header;
use crate::output::Folder;
use crate::record::measured_model_file;
use anyhow::{Context, Result};
use commission::LoopResponse;
use commission::Session;
use commission::procedure::{Done, Options, Step, measured, run as measure};
use commission::quantity::Quantity;
use commission::tune::Crossing;
use indicatif::{ProgressBar, ProgressStyle};
use pollster::block_on;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::fs;

const REPORT: &str = "report.json";

/// Which model a predicted response is of.
const MODELS: &str = "    The model of a current loop is sampled here, as the drive is. That of the tuning is continuous, and a few percent faster.
    The model of a speed loop has no table here, which keeps its speed in these steps. That of the tuning has the table.
";

/// What a current of a limit is.
const LENGTH: &str = "    A current is a power-invariant length: sqrt(3/2) of a phase's peak.\n";

/// Measures, sets and tunes.
pub fn run(drive: Drive, options: &CommissionOptions) -> Result<()> {
    let folder = Folder::open(&options.out)?;
    let mut done = if options.again {
        Vec::new()
    } else {
        kept(&folder)?
    };
    let stop = caught()?;
    let bar = ProgressBar::new(1000).with_style(ProgressStyle::with_template("{bar:40} {msg}")?);
    let mut session = block_on(Session::open(drive, stop))?;
    let result = block_on(measure(
        &mut session,
        &Options {
            travel_m: options.travel * 1e-3,
            speed_rad_s: options.loops.speed_loop,
            margin_deg: options.loops.margin,
            steps: &Step::ALL,
        },
        &mut done,
        &mut |step, part| {
            bar.set_message(format!("{}: {}", step.name(), step.about()));
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            bar.set_position((part.clamp(0.0, 1.0) * 1e3) as u64);
        },
        &mut |done| keep(&folder, done),
    ));
    bar.finish_and_clear();
    if result.is_err() && !done.is_empty() {
        eprintln!(
            "what was done until then is kept in {}: the same command goes on from there",
            folder.path(REPORT).display()
        );
    }
    result?;
    let bus_v = session.bus_v();
    let mut drive = session.into_drive();
    if let Some((machine, motors)) = measured(&done) {
        let interval_s = 1.0 / drive.speed_hz();
        let header = header(&mut drive)?;
        let model = measured_model_file(&header, interval_s, &machine, &motors, bus_v);
        folder.put_text("model.toml", &model)?;
    }
    if options.json {
        println!("{}", serde_json::to_string_pretty(&done)?);
    } else {
        print!("{}", page(&done));
        println!("\n{}", folder.path("report.md").display());
    }
    Ok(())
}

/// The steps that an earlier run has done.
fn kept(folder: &Folder) -> Result<Vec<Done>> {
    let path = folder.path(REPORT);
    if !path.exists() {
        return Ok(Vec::new());
    }
    let text = fs::read_to_string(&path)?;
    let done: Vec<Done> = serde_json::from_str(&text).with_context(|| {
        format!(
            "{} is no report of a commissioning: name another folder with --out",
            path.display()
        )
    })?;
    // One that is complete is no beginning of another.
    let complete = Step::ALL
        .iter()
        .all(|step| done.iter().any(|done| done.step == *step));
    Ok(if complete { Vec::new() } else { done })
}

fn keep(folder: &Folder, done: &[Done]) -> Result<()> {
    folder.put_text(REPORT, &serde_json::to_string_pretty(done)?)?;
    folder.put_text("report.md", &page(done))
}

/// The report of one page.
fn page(done: &[Done]) -> String {
    let mut text = String::from("# Commissioning\n");
    for done in done {
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "\n## {}: {:.0} s\n\n{}\n",
            done.step.name(),
            done.seconds,
            done.step.about()
        );
        for quantity in &done.quantities {
            let _ = writeln!(text, "    {quantity}");
        }
        if is_slower(&done.quantities) {
            text += SLOWER;
        }
        for (kind, responses) in [
            ("current", &done.responses),
            ("speed", &done.speed_responses),
        ] {
            for (motor, response) in ["screw", "nut"].iter().zip(responses.iter().flatten()) {
                let _ = writeln!(
                    text,
                    "    {motor}: {kind} loop, {}",
                    loop_line(response.as_ref())
                );
            }
        }
        if done.responses.is_some() {
            text += MODELS;
        }
        for limited in &done.limits {
            let _ = writeln!(text, "    {limited}");
        }
        if done.limits.iter().any(|limited| limited.unit == "A") {
            text += LENGTH;
        }
    }
    text
}

/// Why the speed loops are slower than before, if they are.
const SLOWER: &str = "    The speed loops are slower than before: `--margin` asks for a phase margin that faster ones have not, or \
                      `--speed-loop` for slow ones.\n";

/// Whether the speed loops became slower.
fn is_slower(quantities: &[Quantity]) -> bool {
    quantities.iter().any(|quantity| {
        let before = quantity.before.unwrap_or_default();
        quantity.name == "tuning.speed_rad_s" && quantity.estimate.value < before
    })
}

/// Difference of a measured phase margin from the predicted one that is reported, degrees: three times what 60 drawn motors had at most
/// (`docs/drive.md`).
const FAR_DEG: f64 = 10.0;

/// A loop, measured beside predicted.
fn loop_line(response: Option<&LoopResponse>) -> String {
    let Some(response) = response else {
        return "its steps were not seen beside noise and ripple".to_owned();
    };
    let found = |of: Crossing| {
        format!(
            "bandwidth {:.1} rad/s and phase margin {:.1} degrees",
            of.bandwidth_rad_s, of.margin_deg
        )
    };
    let model = response
        .predicted_crossing
        .map_or_else(|| "no gain of 1".to_owned(), found);
    let apart = match (response.crossing, response.predicted_crossing) {
        (Some(measured), Some(predicted)) => (measured.margin_deg - predicted.margin_deg).abs(),
        _ => 0.0,
    };
    let doubt = match apart > FAR_DEG {
        true => format!(
            ". The margins are {apart:.0} degrees apart: either friction and the encoder's counts hide the steps at this speed, or the loop is \
             not the model's. Measure again, and listen to the drive, before you trust either"
        ),
        false => String::new(),
    };
    format!(
        "{} steps from {:.2} to {:.2} {}: measured {}; by the model {model}{doubt}",
        response.steps,
        response.from,
        response.to,
        response.unit,
        response
            .crossing
            .map_or_else(|| not_measured(&response.hz), found),
    )
}

/// Why there is no bandwidth of a loop that was measured at these frequencies, Hz.
fn not_measured(hz: &[f64]) -> String {
    let clear = match hz {
        [] => "no frequency was clear of noise".to_owned(),
        [low, .., high] => format!(
            "its gain does not fall through 1 where it is clear of noise, {:.0} to {:.0} rad/s",
            TAU * low,
            TAU * high
        ),
        [one] => format!("only {:.0} rad/s was clear of noise", TAU * one),
    };
    format!("no bandwidth, as {clear}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use commission::Estimate;

    /// The tuning printed a bandwidth in rad/s. The response printed none, in Hz and without a reason.
    #[test]
    fn a_bandwidth_that_is_not_measured_has_its_reason() {
        let response = LoopResponse {
            unit: "rpm".to_owned(),
            steps: 48,
            hz: vec![10.0, 20.0, 30.0],
            predicted_crossing: Some(Crossing {
                bandwidth_rad_s: 265.4,
                margin_deg: 45.54,
            }),
            ..LoopResponse::default()
        };
        let line = loop_line(Some(&response));
        assert!(
            line.ends_with(
                "measured no bandwidth, as its gain does not fall through 1 where it is clear of noise, 63 to 188 rad/s; \
                 by the model bandwidth 265.4 rad/s and phase margin 45.5 degrees"
            ),
            "{line}"
        );
    }

    /// A commissioning took two thirds of the NUCLEO board's speed loops, and gave no reason.
    #[test]
    fn speed_loops_that_became_slower_have_their_reason() {
        let tuned = |value: f64| {
            let quantity = Quantity {
                name: "tuning.speed_rad_s".to_owned(),
                unit: "rad/s".to_owned(),
                estimate: Estimate {
                    value,
                    plus_minus: 0.0,
                },
                before: Some(200.0),
            };
            is_slower(&[quantity])
        };
        assert!(tuned(132.7) && !tuned(200.0));
    }

    #[test]
    fn margins_that_are_far_apart_are_told() {
        let of = |margin_deg: f64| {
            Some(Crossing {
                bandwidth_rad_s: 231.0,
                margin_deg,
            })
        };
        let line = |measured: f64| {
            loop_line(Some(&LoopResponse {
                crossing: of(measured),
                predicted_crossing: of(45.8),
                ..LoopResponse::default()
            }))
        };
        assert!(
            line(0.9).contains("The margins are 45 degrees apart"),
            "{}",
            line(0.9)
        );
        assert!(!line(42.5).contains("apart"), "{}", line(42.5));
    }
}
