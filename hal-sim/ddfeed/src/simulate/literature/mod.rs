//! `ddfeed simulate literature`: what later papers report of the double drive, on the simulated one.

mod charts;
mod creep;
mod deviation;
mod drive_name;
mod html;
mod papers;
mod report;
mod shaft;
mod stick_slip;
mod switching;
mod table;
mod torsion;
mod tracking;
mod warmth;

use super::options::LiteratureOptions;
use super::study::progress_bar;
use crate::output::Folder;
use anyhow::Result;
use report::LiteratureReport;

/// Runs all four and writes their report.
pub fn run(options: &LiteratureOptions) -> Result<()> {
    let folder = Folder::open(&options.out)?;
    let progress = progress_bar(5);
    let done = |name: &str| {
        progress.inc(1);
        progress.set_message(name.to_owned());
    };
    progress.set_message("creeping");
    let creep = creep::run(options.seed)?;
    done("a sine at creep speed");
    let tracking = tracking::run(options.seed)?;
    done("losses");
    let warmth = warmth::run(options.seed)?;
    done("a load that switches");
    let switching = switching::run(options.seed)?;
    done("torsion of the screw");
    let torsion = torsion::run(options.seed)?;
    progress.finish_and_clear();
    let report = LiteratureReport {
        seed: options.seed,
        creep,
        tracking,
        warmth,
        switching,
        torsion,
    };
    folder.put_text("report.json", &serde_json::to_string_pretty(&report)?)?;
    folder.put_text("report.html", &html::page(&report))?;
    table::print(&report);
    println!("\nThe report is {}.", folder.path("report.html").display());
    Ok(())
}
