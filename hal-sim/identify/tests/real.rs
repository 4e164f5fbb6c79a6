//! Real axes of other people, through the whole way from files to a report. Where their files are not beside the project the
//! tests say so and pass.

use identify::records::{Mapping, OnFault};
use identify::report::Report;
use identify::run::Task;
use std::path::{Path, PathBuf};
use std::time::Instant;

given::shared_tests! {
    "measured/mech467" => measured_axis_without_law;
}

/// The report of a ball-screw axis whose control law is not known, fitted and checked at speeds in mm/s.
fn mech467(folder: &Path, fit: &[u32], check: &[u32]) -> Report {
    let own = |name: &str| {
        Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("mappings")
            .join(name)
    };
    let files = |speeds: &[u32]| -> Vec<PathBuf> {
        let file = |speed: &u32| folder.join(format!("{speed}_mmps.mat"));
        speeds.iter().map(file).collect()
    };
    let task = Task {
        model: own("mech467-model.toml"),
        fit: files(fit),
        check: files(check),
        mapping: Mapping::load(&own("mech467.toml")).expect("the project's own mapping"),
        on_fault: OnFault::Skip,
    };
    let start = Instant::now();
    let report = task
        .run(&mut |_, _| ())
        .map(|done| done.report)
        .unwrap_or_else(|error| panic!("{error}"));
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "{fit:?} -> {check:?}: {seconds:.1} s, {}: {}",
        report.verdict, report.selection.rule
    );
    assert!(
        seconds < 60.0,
        "{seconds} s, expected less than 10 s of a machine that does nothing else"
    );
    report
}

/// What turns with the screw is described and added; the error on other speeds is that of the yardstick, 7.3 % of the force.
fn measured_axis_without_law(folder: &Path) {
    for (fit, check, most_percent) in [
        (&[10, 35, 60, 120][..], &[50][..], 6.8),
        (&[10, 50, 120], &[35, 60], 8.5),
        (&[60], &[50], 22.0),
    ] {
        let report = mech467(folder, fit, check);
        let force = report.figures("force").expect("the force");
        let percent = 100.0 * force.check_after / force.check_signal.expect("the rms of the force");
        assert!(
            percent <= most_percent,
            "{fit:?} -> {check:?}: {percent:.2} %, expected at most {most_percent} %"
        );
        assert!(
            !matches!(report.verdict, "explained" | "nothing missing"),
            "{}",
            report.verdict
        );
        assert!(
            report
                .effects
                .iter()
                .all(|effect| effect.kind != "reported_current_lag")
        );
    }
}
