//! Real machines of other people: what is said of them, and the error on records that were not fitted.

use anyhow::{Context, Result};
use identify::machines::motor::{self, MotorModel, Study};
use identify::records::{How, Mapping, OnFault, load};
use identify::report::{self, Report};
use identify::run::Task;
use serde::Serialize;
use std::path::{Path, PathBuf};
use xtask::tools::root;

/// What is said of one pair of records.
#[derive(Debug, Serialize)]
pub struct Real {
    /// Machine and records.
    pub name: String,
    /// The verdict.
    pub verdict: &'static str,
    /// Kinds that are named, with their order.
    pub names: Vec<String>,
    /// Error on the check record, % of the drive quantity's rms: with inertia and friction alone, and with all.
    pub before: f64,
    /// See `before`.
    pub after: f64,
    /// What plain least squares reach there.
    pub yardstick: f64,
}

impl Real {
    fn new(name: String, report: &Report, yardstick: f64) -> Option<Self> {
        let figures = report.residual.first()?;
        let percent = |error: f64| 100.0 * error / figures.check_signal.unwrap_or(f64::NAN);
        let named = |effect: &report::Effect| match effect.order {
            Some(order) => format!("{} {order:.2}", effect.kind),
            None => effect.kind.clone(),
        };
        Some(Real {
            name,
            verdict: report.verdict,
            names: report.effects.iter().map(named).collect(),
            before: percent(figures.check_before),
            after: percent(figures.check_after),
            yardstick,
        })
    }
}

/// A ball-screw axis without a known law, fitted and checked at speeds in mm/s.
fn mech467(folder: &Path, fit: &[u32], check: &[u32]) -> Result<Report> {
    let files = |speeds: &[u32]| -> Vec<PathBuf> {
        let file = |speed: &u32| folder.join(format!("mech467/{speed}_mmps.mat"));
        speeds.iter().map(file).collect()
    };
    let mapping = include_str!("../../../../hal-sim/identify/mappings/mech467.toml");
    let task = Task {
        model: root()?.join("hal-sim/identify/mappings/mech467-model.toml"),
        fit: files(fit),
        check: files(check),
        mapping: Mapping::parse(mapping, "the project's own mapping")?,
        on_fault: OnFault::Skip,
    };
    Ok(task.run(&mut |_, _| ())?.report)
}

/// A bare motor's pair of files; of one file its halves.
fn pair(folder: &Path, mapping: &str, fit: &str, check: &str) -> Result<Report> {
    let mapping = Mapping::parse(mapping, "the project's own mapping")?;
    let how = How {
        mapping: &mapping,
        on_fault: OnFault::Skip,
        declared_hz: None,
    };
    let read = |name: &str| load(&folder.join(name), how, &mut |_| ()).map(motor::Record::new);
    let [first, second] = match fit == check {
        true => read(fit)?.halves(),
        false => [read(fit)?, read(check)?],
    };
    let study = Study::new(&first, &second, None);
    Ok(report::motor(
        &study,
        MotorModel { pole_pairs: 7 },
        Default::default(),
    ))
}

/// All records in `folder`. Without that folder none, and standard error reports it.
///
/// # Errors
///
/// A record or its model cannot be read.
pub fn real(folder: &Path) -> Result<Vec<Real>> {
    if !folder.is_dir() {
        eprintln!(
            "skipped: no folder {} with measured records",
            folder.display()
        );
        return Ok(Vec::new());
    }
    let (drive, laas) = (
        include_str!("../../../../hal-sim/identify/mappings/odrive.toml"),
        include_str!("../../../../hal-sim/identify/mappings/laas-acc.toml"),
    );
    let reports = [
        (
            "mech467 10, 35, 60, 120 -> 50 mm/s",
            mech467(folder, &[10, 35, 60, 120], &[50]),
            7.3,
        ),
        (
            "mech467 10, 50, 120 -> 35, 60 mm/s",
            mech467(folder, &[10, 50, 120], &[35, 60]),
            7.6,
        ),
        (
            "ODrive slow 1 -> 2",
            pair(
                folder,
                drive,
                "odrive/slow_nocomp_1.npy",
                "odrive/slow_nocomp_2.npy",
            ),
            5.7,
        ),
        (
            "ODrive slower -> slow",
            pair(
                folder,
                drive,
                "odrive/slower_nocomp_0.npy",
                "odrive/slow_nocomp_2.npy",
            ),
            6.7,
        ),
        (
            "LAAS coast, halves",
            pair(folder, laas, "laas/acc_current.txt", "laas/acc_current.txt"),
            6.2,
        ),
    ];
    let said = |(name, report, yardstick): (&str, Result<Report>, f64)| {
        let report = report.with_context(|| name.to_owned())?;
        Real::new(name.into(), &report, yardstick)
            .with_context(|| format!("{name}: the report has no residual"))
    };
    reports.into_iter().map(said).collect()
}
