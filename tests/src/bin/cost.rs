//! Measures what the firmware's interrupts cost and prints it, as a table or with `--json` as JSON. `--keep` makes the
//! figures the baseline that the tests hold the firmware to; `--smooth` measures the firmware that compensates ripple.

use serde_json::Value;
use std::process::ExitCode;
use tests::cost::{BASELINE, RISE, Report, baseline, baseline_path, measure, measure_smooth};
use tests::timing::MODEL_ERROR_PERCENT;

fn main() -> ExitCode {
    sigpipe::reset();
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let has = |name: &str| arguments.iter().any(|argument| argument == name);
    if let Some(unknown) = arguments
        .iter()
        .find(|a| !["--json", "--keep", "--smooth"].contains(&a.as_str()))
    {
        eprintln!(
            "error: `{unknown}` is not known; `--json` prints JSON, `--keep` keeps the figures as the baseline, \
             `--smooth` measures the firmware that compensates ripple"
        );
        return ExitCode::FAILURE;
    }
    if has("--keep") && has("--smooth") {
        eprintln!(
            "error: the baseline is the default firmware's: leave `--smooth` or `--keep` out"
        );
        return ExitCode::FAILURE;
    }
    let measured = if has("--smooth") {
        measure_smooth()
    } else {
        measure()
    };
    let report = match measured {
        Ok(report) => report,
        Err(error) => {
            eprintln!("error: {error}");
            return ExitCode::FAILURE;
        }
    };
    if has("--json") {
        println!("{}", report.json());
    } else {
        table(&report);
        if !has("--smooth") {
            against_baseline(&report);
        }
    }
    if has("--keep") {
        let text = format!("{:#}\n", report.json());
        let written = baseline_path()
            .and_then(|path| std::fs::write(path, text).map_err(|error| error.to_string()));
        if let Err(error) = written {
            eprintln!("error: the baseline is not written: {error}");
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}

/// Prints by how much cycles and flash differ from the baseline's.
fn against_baseline(report: &Report) {
    let baseline = match baseline() {
        Ok(baseline) => baseline,
        Err(error) => return eprintln!("the baseline cannot be read: {error}"),
    };
    println!(
        "cycles and flash beside those of tests/{BASELINE}; the tests allow {:.0} % more:",
        100.0 * (RISE - 1.0)
    );
    let now = report.json();
    let rows = |of: &Value| of["interrupts"].as_array().cloned().unwrap_or_default();
    for (now, before) in rows(&now).iter().zip(rows(&baseline)) {
        let cycles = |kind: &str| {
            let [now, before] = [now, &before].map(|of| of["cycles"][kind].as_f64());
            change(kind, now.unwrap_or(f64::NAN), before.unwrap_or(f64::NAN))
        };
        let name = now["name"].as_str().unwrap_or_default();
        println!("{name:<20} {}, {}", cycles("typical"), cycles("worst"));
    }
    let bytes = |of: &Value| of["flash_bytes"].as_f64().unwrap_or(f64::NAN);
    println!(
        "{:<20} {}",
        "flash",
        change("bytes", bytes(&now), bytes(&baseline))
    );
}

/// A figure beside the baseline's.
fn change(figure: &str, now: f64, before: f64) -> String {
    let percent = 100.0 * (now / before - 1.0);
    format!("{figure} {before} -> {now} ({percent:+.1} %)")
}

fn table(report: &Report) {
    println!(
        "{:<20} {:>8} {:>22} {:>30}",
        "interrupt",
        "rate",
        "instructions",
        format!("cycles, -0 to +{MODEL_ERROR_PERCENT} %")
    );
    println!(
        "{:<20} {:>8} {:>11} {:>10} {:>11} {:>9} {:>8}",
        "", "Hz", "typical", "worst", "typical", "worst", "bound"
    );
    for row in &report.rows {
        println!(
            "{:<20} {:>8} {:>11} {:>10} {:>11} {:>9} {:>8}",
            row.interrupt.name,
            row.interrupt.rate_hz,
            row.typical.instructions,
            row.worst.instructions,
            row.typical.cycles,
            row.worst.cycles,
            row.bound
        );
    }
    let Report {
        flash_bytes,
        ram_bytes,
        stack_bytes,
        stack_seen,
        stack_room,
        ..
    } = report;
    println!(
        "load {:.1} % of 170 MHz, up to {:.1} % by the model's error",
        report.load_percent(),
        report.load_percent() * (1.0 + MODEL_ERROR_PERCENT / 100.0)
    );
    println!("flash {flash_bytes} bytes, RAM {ram_bytes} bytes");
    println!(
        "cycles are a model's: a real Cortex-M4 took up to {MODEL_ERROR_PERCENT} % more in what was published \
         (tests/tests/published_cycles)"
    );
    println!("stack at most {stack_bytes} bytes, {stack_seen} seen, {stack_room} there");
}
