//! `cargo xtask bench probe`: a debugger's session with the emulated chip.
//!
//! The session is the tests' own (`tests/tests/probe`): they hold it against the chip's truth, and leave what they measure.

use anyhow::{Context, Result, ensure};
use clap::Args;
use serde_json::{Map, Value, json};
use std::fs;
use std::path::Path;
use xtask::{firmware, tools};

/// What the tests must have left.
const FIGURES: [&str; 6] = [
    "flash_s",
    "attach_s",
    "rtt_bytes_per_s",
    "steps_equal",
    "breakpoints_hit",
    "record_rows_equal",
];
/// Those that have parts.
const HALTED: &str = "halted";
const NAMED: &str = "failures_named";

/// How to say it.
#[derive(Args)]
pub struct ProbeOptions {
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

/// Measures and prints.
pub fn run(options: &ProbeOptions) -> Result<()> {
    let folder = tools::target_folder()?.join("probe");
    if folder.exists() {
        // Of a run before.
        fs::remove_dir_all(&folder)?;
    }
    firmware::probe()?;
    let report = report(&folder)?;
    if options.json {
        println!("{report}");
    } else {
        println!("{report:#}");
    }
    Ok(())
}

/// What the tests left in `folder`.
fn report(folder: &Path) -> Result<Value> {
    let mut report = Map::new();
    for figure in FIGURES {
        report.insert(figure.into(), read(&folder.join(figure))?);
    }
    let (mut halted, mut named) = (Map::new(), 0);
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        match name.split_once('.') {
            Some((HALTED, time)) => {
                halted.insert(time.into(), read(&entry.path())?);
            }
            Some((NAMED, _)) => named += 1,
            _ => {}
        }
    }
    ensure!(
        halted.len() == 2 && named > 0,
        "the tests left no figures of a halt or of failures in {}",
        folder.display()
    );
    report.insert(HALTED.into(), halted.into());
    report.insert(NAMED.into(), json!(named));
    Ok(report.into())
}

fn read(path: &Path) -> Result<Value> {
    let text = fs::read_to_string(path)
        .with_context(|| format!("the tests left no figure {}", path.display()))?;
    Ok(serde_json::from_str(&text)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_that_is_missing_is_said_and_a_whole_report_has_each() {
        let folder = std::env::temp_dir().join(format!("figures-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let put = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
        for figure in FIGURES {
            let error = format!("{:#}", report(&folder).unwrap_err());
            assert!(error.contains(figure), "{error}");
            put(figure, "1");
        }
        let error = format!("{:#}", report(&folder).unwrap_err());
        assert!(error.contains("of a halt"), "{error}");
        for name in ["halted.running", "halted.frozen"] {
            put(name, r#"{"travel_um": 0.0}"#);
        }
        put("failures_named.a locked chip", "true");
        put("failures_named.another chip", "true");
        let whole = report(&folder).unwrap();
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(whole["failures_named"], 2);
        assert_eq!(whole["halted"]["frozen"]["travel_um"], 0.0);
        assert_eq!(whole["flash_s"], 1);
    }
}
