//! One machine from cold to a smoother table, by the commands that a user gives.

use super::draw::{Machine, machine};
use super::truth::worse_values;
use anyhow::{Context, Result};
use clap::Parser;
use ddfeed::compensate::{self, CompensateOptions};
use ddfeed::drive::Task;
use ddfeed::identify::{self, IdentifyOptions};
use ddfeed::serve::{ServeOptions, ServedWithin};
use ddfeed::simulate::Bridges;
use hal_sim::hold_ripple::{WINDOW_S, ripples};
use plant::recording::Recording;
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};

/// Holds of the recordings: table velocity in parts of the user's, nut rpm, seconds. The table comes back to where it began.
const FIT: [(f64, f64, f64); 6] = [
    (1.0, 0.0, 3.0),
    (-1.0, 0.0, 3.0),
    (1.0, 300.0, 3.0),
    (-2.0, 300.0, 3.0),
    (3.0, 600.0, 2.0),
    (-3.0, 600.0, 1.0),
];
const CHECK: [(f64, f64, f64); 4] = [
    (1.4, 0.0, 2.0),
    (-0.8, 200.0, 3.5),
    (2.4, 450.0, 1.5),
    (-2.4, 450.0, 1.5),
];
/// Where the ripple is compared: the single drive and the double drive. At a speed of whole counts of the scale a window, the scale's
/// rounding repeats, and makes anything from nothing to twice its usual part.
const COMPARED: [(f64, f64, f64); 2] = [(1.0318, 0.0, 3.0), (-1.0318, 300.0, 3.0)];

/// The holds of the fit recording with the single drive, and with the double drive, at the compared speeds within 4 %.
const REPEATED: [usize; 2] = [0, 2];

/// What came of a machine. Ripples are root mean squares by the table's scale as `record` prints them, %, over both holds.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Row {
    /// The machine's seed.
    pub seed: u64,
    /// Supply, V.
    pub bus_v: f64,
    /// Counts of a turn, bits.
    pub encoder_bits: f64,
    /// `incremental`, `index` or `absolute`.
    pub encoder: String,
    /// Undeclared effects: kind and place.
    pub effects: Vec<String>,
    /// What `identify` named.
    pub named: Vec<String>,
    /// The step that failed, and what it said.
    pub failed_step: Option<String>,
    /// What counts of the table's scale make of the ripple where it is not the table's, %.
    pub scale_floor: f64,
    /// How much the ripple of the fit recording at the compared speeds differs from that before the compensation, %. A machine that sticks
    /// and slips, or whose resting rotor hunts between two counts, shows another ripple each time.
    pub ripple_repeats: f64,
    /// Recorded before the compensation.
    pub ripple_before: Option<f64>,
    /// Predicted by `compensate`.
    pub ripple_predicted: Option<f64>,
    /// Recorded with it.
    pub ripple_after: Option<f64>,
    /// Recorded after power was off.
    pub ripple_restarted: Option<f64>,
    /// Commissioned values that `identify` moved out of both intervals and further from the truth.
    pub values_worse: Vec<String>,
}

/// `ddfeed serve`.
#[derive(Parser)]
struct Serve {
    #[command(flatten)]
    options: ServeOptions,
}

/// `ddfeed drive`.
#[derive(Parser)]
struct Drive {
    #[command(subcommand)]
    task: Task,
}

/// `ddfeed identify`.
#[derive(Parser)]
struct Identify {
    #[command(flatten)]
    options: IdentifyOptions,
}

/// `ddfeed compensate`.
#[derive(Parser)]
struct Compensate {
    #[command(flatten)]
    options: CompensateOptions,
}

/// The words of a command, after its name.
fn parsed<P: Parser>(words: &[&str]) -> Result<P> {
    Ok(P::try_parse_from(["ddfeed"].iter().chain(words.iter()))?)
}

/// The machine of `seed` through all steps, with its files in `folder`.
pub fn travel(seed: u64, bridges: Bridges, folder: &Path) -> Row {
    let machine = machine(seed);
    let sensing = &machine.model.sensing;
    let mut journey = Journey {
        row: Row {
            seed,
            bus_v: machine.model.installation.bus_v,
            encoder_bits: f64::from(sensing.encoder_counts_per_turn).log2(),
            encoder: format!("{:?}", sensing.encoder).to_lowercase(),
            scale_floor: scale_floor(&machine),
            effects: machine
                .model
                .effects
                .iter()
                .map(|effect| format!("{} ({})", effect.effect().kind(), effect.place().name()))
                .collect(),
            ..Row::default()
        },
        machine,
        folder: folder.to_owned(),
        bridges,
        step: "serve",
    };
    if let Err(error) = journey.steps() {
        journey.row.failed_step = Some(format!("{}: {error:#}", journey.step));
    }
    journey.row
}

struct Journey {
    machine: Machine,
    folder: PathBuf,
    bridges: Bridges,
    row: Row,
    step: &'static str,
}

impl Journey {
    fn path(&self, name: &str) -> String {
        self.folder.join(name).display().to_string()
    }

    /// The served machine with its flash; another seed has its rotors elsewhere.
    fn serve(&self, seed: &str) -> Result<ServedWithin> {
        let (model, flash) = (self.path("real.toml"), self.path("flash.bin"));
        let words = [
            "--cold", "--model", &model, "--flash", &flash, "--seed", seed,
        ];
        let mut options = parsed::<Serve>(&words)?.options;
        options.machine.bridges = self.bridges;
        ServedWithin::new(&options)
    }

    fn drive(
        &mut self,
        step: &'static str,
        served: &mut ServedWithin,
        words: &[&str],
    ) -> Result<()> {
        self.step = step;
        println!("$ drive {}", words.join(" "));
        served.drive(&parsed::<Drive>(words)?.task)
    }

    /// Records holds.
    fn record(
        &mut self,
        step: &'static str,
        served: &mut ServedWithin,
        name: &str,
        holds: &[(f64, f64, f64)],
    ) -> Result<()> {
        let folder = self.path("rec");
        let mut words = vec!["record".to_owned(), folder, "--arm".to_owned()];
        words.extend(["--name".to_owned(), name.to_owned()]);
        for (part, rpm, seconds) in holds {
            let mm_s = 1e3 * part * self.machine.velocity;
            words.push(format!("--hold={mm_s},{rpm},{seconds}"));
        }
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        self.drive(step, served, &words)
    }

    /// The ripple of the compared holds of a recording, %.
    fn ripple(&self, name: &str) -> Result<f64> {
        let all = self.ripples(name)?;
        anyhow::ensure!(
            all.len() == COMPARED.len(),
            "{} holds were recorded, but {} were asked",
            all.len(),
            COMPARED.len()
        );
        Ok(together(all.into_iter()))
    }

    /// The ripple of each hold of a recording, %.
    fn ripples(&self, name: &str) -> Result<Vec<f64>> {
        let path = self.folder.join("rec").join(format!("{name}.csv.gz"));
        let recording = Recording::load(&path)?;
        let travel = self.machine.model.feed.travel_per_radian();
        Ok(ripples(&recording, travel)?
            .iter()
            .map(|(_, ripple)| ripple.rms_percent)
            .collect())
    }

    fn steps(&mut self) -> Result<()> {
        if self.folder.exists() {
            fs::remove_dir_all(&self.folder)?;
        }
        fs::create_dir_all(&self.folder)?;
        fs::write(self.path("real.toml"), self.machine.model.to_toml())?;
        fs::write(self.path("datasheet.toml"), &self.machine.datasheet)?;
        let served = &mut self.serve(&self.row.seed.to_string())?;
        let [datasheet, found, export, known, model, out, recorded] = [
            "datasheet.toml",
            "found",
            "export.toml",
            "known.toml",
            "found/model.toml",
            "out",
            "rec/before.csv.gz",
        ]
        .map(|name| self.path(name));
        self.drive(
            "settings",
            served,
            &["settings", "import", &datasheet, "--yes"],
        )?;
        self.drive(
            "commission",
            served,
            &["commission", "--arm", "--out", &found],
        )?;
        self.record("record", served, "fit", &FIT)?;
        self.record("record", served, "check", &CHECK)?;
        self.step = "identify";
        let [fit, check] = ["rec/fit.csv.gz", "rec/check.csv.gz"].map(|name| self.path(name));
        let words = [
            "--model", &model, "--fit", &fit, "--check", &check, "--out", &out,
        ];
        identify::run(&parsed::<Identify>(&words)?.options)?;
        let (named, worse) = worse_values(&self.machine.model, &self.folder)?;
        (self.row.named, self.row.values_worse) = (named, worse);
        self.record("record before", served, "before", &COMPARED)?;
        let before = self.ripple("before")?;
        let fit = self.ripples("fit")?;
        let repeated = REPEATED.iter().filter_map(|hold| fit.get(*hold).copied());
        let repeated = together(repeated.collect::<Vec<_>>().into_iter());
        self.row.ripple_repeats = (repeated - before).abs();
        self.row.ripple_before = Some(before);
        self.drive("compensate", served, &["settings", "export", &export])?;
        let identified = self.path("out/model.toml");
        let words = [
            "--model",
            &identified,
            "--recording",
            &recorded,
            "--drive",
            &export,
            "--settings",
            &known,
        ];
        let options = parsed::<Compensate>(&words)?.options;
        let found = compensate::run(&options).context("compensate")?;
        self.row.ripple_predicted = Some(together(
            found.predicted.iter().map(|one| one.after.rms_percent),
        ));
        self.drive("import", served, &["settings", "import", &known, "--yes"])?;
        self.record("record after", served, "after", &COMPARED)?;
        self.row.ripple_after = Some(self.ripple("after")?);
        self.step = "restart";
        let served = &mut self.serve(&format!("{}", self.row.seed + 1_000_000))?;
        self.record("record restarted", served, "restarted", &COMPARED)?;
        self.row.ripple_restarted = Some(self.ripple("restarted")?);
        Ok(())
    }
}

/// Both readings of a mean velocity are rounded to a count.
fn scale_floor(machine: &Machine) -> f64 {
    let rounded_m = machine.model.installation.scale_count_m / 6f64.sqrt();
    100.0 * rounded_m / WINDOW_S / machine.velocity
}

/// Root mean square of several holds'.
fn together(all: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = all.len() as f64;
    (all.map(|rms| rms * rms).sum::<f64>() / count).sqrt()
}
