//! From a record to the report.

use super::told::Told;
use super::{Fault, IdentifyOptions, simulation};
use anyhow::Result;
use identify::load::{Mapping, OnFault};
use identify::report::{Report, write};
use identify::run::Task;

/// Identifies, simulates and writes the report.
pub(super) fn run(options: &IdentifyOptions) -> Result<()> {
    let mapping = options.mapping.as_deref().map(Mapping::load).transpose()?;
    let task = Task {
        model: options.model.clone(),
        fit: options.fit.clone(),
        check: options.check.clone(),
        mapping: mapping.unwrap_or_default(),
        on_fault: match options.on_fault {
            Fault::Refuse => OnFault::Refuse,
            Fault::Skip => OnFault::Skip,
        },
    };
    let mut told = Told::new(options.progress);
    let mut done = task.run(&mut |what, share| told.say(what, share))?;
    if let Some(replay) = done.replay.filter(|_| !options.no_simulation) {
        told.say("simulating", None);
        match simulation::simulation(&replay) {
            Ok(found) => done.report.simulation = found,
            // The report stands without it.
            Err(error) => eprintln!("the check record could not be simulated: {error:#}"),
        }
    }
    told.end();
    write(&done.report, &options.out)?;
    print(&done.report);
    println!("report: {}", options.out.join("report.html").display());
    Ok(())
}

fn print(report: &Report) {
    println!("verdict: {}. {}", report.verdict, report.summary);
    for effect in &report.effects {
        let values: Vec<String> = effect
            .parameters
            .iter()
            .map(|(name, value)| {
                let [low, high] = effect.interval.get(name).copied().unwrap_or([f64::NAN; 2]);
                let unit = effect.unit.get(name).map_or("", String::as_str);
                format!(
                    "{name} {} ({} to {}) {unit}",
                    short(*value),
                    short(low),
                    short(high)
                )
                .trim_end()
                .to_owned()
            })
            .collect();
        println!(
            "{} at {}: {}; explains {:.1} % of the check record's excess",
            effect.kind,
            effect.place,
            values.join(", "),
            100.0 * effect.explained
        );
    }
    if let Some((_, figures)) = report.lead() {
        println!(
            "{} residual on the check record: {} -> {} {} rms (noise floor {})",
            figures.channel,
            short(figures.check_before),
            short(figures.check_after),
            figures.unit,
            short(figures.noise_floor)
        );
    }
    if let Some(simulation) = &report.simulation {
        println!(
            "ripple simulated less measured: {:.2} -> {:.2} points rms over {} holds",
            simulation.declared_rms_points,
            simulation.new_rms_points,
            simulation.holds.len()
        );
    }
    for record in &report.records {
        let skipped: usize = record.skipped.iter().map(|s| s.rows).sum();
        if skipped + record.bridged + record.cut > 0 {
            println!(
                "{}: {skipped} rows left out, {} bridged, {} cut off, of {}",
                record.file, record.bridged, record.cut, record.rows
            );
        }
    }
}

/// Four significant digits.
fn short(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-3..1e5).contains(&size) {
        return format!("{value:.3e}");
    }
    let decimals = if size == 0.0 {
        0
    } else {
        (3 - size.log10().floor() as i32).max(0) as usize
    };
    format!("{value:.decimals$}")
}
