//! What a person may ask of a simulation.

use anyhow::{Context, Result, ensure};
use clap::{Args, Subcommand, ValueEnum};
use hal_sim::experiment::{RPM, Setup};
use plant::machine::Coupling;
use plant::model::Model;
use std::f64::consts::TAU;
use std::path::PathBuf;

/// Without a subcommand: the paper's experiment, or the same at other speeds, loads, machines and sensors.
#[derive(Args, Debug)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Options {
    #[command(subcommand)]
    pub kind: Option<Kind>,
    /// Table velocity, mm/s.
    #[arg(long, default_value_t = 2.5, allow_negative_numbers = true)]
    pub table_speed: f64,
    /// Nut speeds, rpm; 0 is the single drive (CDFS).
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "0,300,500,800",
        allow_negative_numbers = true
    )]
    pub nut_rpm: Vec<f64>,
    /// Length of each record, s.
    #[arg(long, default_value_t = hal_sim::experiment::RECORD_S, allow_negative_numbers = true)]
    pub duration: f64,
    #[command(flatten)]
    pub machine: MachineOptions,
    /// Folder for report.html, report.json, model.toml and recording.csv.gz.
    #[arg(long, default_value = "out/simulate")]
    pub out: PathBuf,
}

/// Other kinds of simulation.
#[derive(Subcommand, Debug)]
pub enum Kind {
    /// Ripple over a grid of table and nut speeds: where the double drive beats the single drive and where not.
    Sweep(SweepOptions),
    /// Re-simulate a recording's profile with a model, and lay the ripple beside the recorded one.
    Replay(ReplayOptions),
}

/// A sweep.
#[derive(Args, Debug)]
pub struct SweepOptions {
    /// Table velocities, mm/s.
    #[arg(long, value_delimiter = ',', default_value = "0.2,0.5,1,2.5,5,10,20")]
    pub table_speed: Vec<f64>,
    /// Nut speeds besides 0, rpm.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "25,50,100,200,300,400,500,600,700,800,1000,1200"
    )]
    pub nut_rpm: Vec<f64>,
    /// Length of each record, s.
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true)]
    pub duration: f64,
    /// `coupled` unless said otherwise.
    #[command(flatten)]
    pub machine: MachineOptions,
    /// Folder for sweep.html and sweep.json.
    #[arg(long, default_value = "out/sweep")]
    pub out: PathBuf,
}

/// A replay.
#[derive(Args, Debug)]
pub struct ReplayOptions {
    /// The recording (.csv or .csv.gz) whose profile is driven.
    #[arg(long)]
    pub recording: PathBuf,
    /// The machine to drive it on (model.toml).
    #[arg(long)]
    pub model: PathBuf,
    /// Seed of all noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Folder for report.json.
    #[arg(long, default_value = "out/replay")]
    pub out: PathBuf,
}

/// Which machine, with which sensors.
#[derive(Args, Debug, Clone)]
pub struct MachineOptions {
    /// A preset: the paper's own simplification, or the coupled machine. [default: paper; coupled for a sweep]
    #[arg(long, value_enum, conflicts_with = "model")]
    pub machine: Option<Preset>,
    /// A machine of your own (model.toml), coupled.
    #[arg(long)]
    pub model: Option<PathBuf>,
    /// Load at each motor, N m. [default: the machine's own, 1 N m on the paper's]
    #[arg(long, allow_negative_numbers = true)]
    pub load: Option<f64>,
    /// What measures the machine.
    #[arg(long, value_enum, default_value = "real")]
    pub sensors: Sensing,
    /// Seed of all noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// A preset of the machine.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// Table 1, everything lumped into the inertia of each motor, the table the kinematic difference.
    Paper,
    /// Screw and nut coupled through lead, stiffness and the table's mass, with friction.
    Coupled,
}

/// What measures the machine.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensing {
    /// So fine and fast that the sensors add nothing.
    Ideal,
    /// 20-bit encoders, 12-bit currents with half a count of noise, observer at 1000 rad/s.
    Real,
    /// What the model file declares.
    Declared,
}

impl MachineOptions {
    /// The set-up, and the machine's name. `preset` is used where none is asked.
    pub fn setup(&self, preset: Preset) -> Result<(Setup, String)> {
        let (mut model, coupling, name) = match (&self.model, self.machine.unwrap_or(preset)) {
            (Some(path), _) => (
                Model::load(path)?,
                Coupling::Coupled,
                path.display().to_string(),
            ),
            (None, Preset::Paper) => (Model::paper(), Coupling::Lumped, "paper".to_owned()),
            (None, Preset::Coupled) => (Model::coupled(), Coupling::Coupled, "coupled".to_owned()),
        };
        if let Some(load) = self.load {
            finite("--load", "N m", load, -1e3, 1e3)?;
            model.feed.load_n = load * TAU / model.feed.lead_m;
        }
        let mut setup = match self.sensors {
            Sensing::Ideal => Setup::ideal(model, coupling),
            Sensing::Real => Setup::real(model, coupling),
            Sensing::Declared => Setup::declared(model, coupling),
        };
        setup.board.seed = self.seed;
        Ok((setup, name))
    }
}

/// Checks a table velocity in mm/s against what the feed allows, before anything is run.
pub fn table_speed(value: f64, setup: &Setup) -> Result<f64> {
    let limit = setup.plate().feed.velocity_max * 1e3;
    finite("--table-speed", "mm/s", value, -limit, limit)?;
    ensure!(
        value.abs() >= 1e-3,
        "--table-speed is {value} mm/s, but ripple is measured against the table's velocity: give at least 0.001 mm/s"
    );
    Ok(value * 1e-3)
}

/// Checks a nut speed in rpm against the motor, before anything is run; mechanical rad/s.
pub fn nut_speed(value: f64, velocity: f64, setup: &Setup) -> Result<f64> {
    let plate = setup.plate();
    let [screw, nut] = plate.motors.map(|motor| motor.speed_max_rpm);
    finite("--nut-rpm", "rpm", value, -nut, nut)?;
    let screw_rpm = value + velocity / setup.model.feed.travel_per_radian() / RPM;
    finite(
        "the screw's speed, --nut-rpm plus the table's share,",
        "rpm",
        screw_rpm,
        -screw,
        screw,
    )?;
    Ok(value * RPM)
}

/// Checks a record's length.
pub fn duration(value: f64) -> Result<f64> {
    finite("--duration", "s", value, 0.01, 1000.0)?;
    Ok(value)
}

fn finite(name: &str, unit: &str, value: f64, low: f64, high: f64) -> Result<()> {
    Some(value)
        .filter(|v| (low..=high).contains(v))
        .map(drop)
        .with_context(|| {
            format!("{name} is {value} {unit}, but {low} to {high} {unit} is possible")
        })
}
