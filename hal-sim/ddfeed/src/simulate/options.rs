//! What a person may ask of a simulation.

use clap::{Args, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Length of a record, s, where none is asked: as long as the bench's.
pub const RECORD_S: f64 = 4.0;

/// Without a subcommand: the paper's experiment, or the same at other speeds, loads, machines and sensors.
#[derive(Args, Debug)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Options {
    /// Another kind of simulation.
    #[command(subcommand)]
    pub kind: Option<Kind>,
    /// Table velocity, mm/s.
    #[arg(long, default_value_t = 2.5)]
    pub table_speed: f64,
    /// Nut speeds, rpm; 0 is the single drive (CDFS).
    #[arg(long, value_delimiter = ',', default_value = "0,300,500,800")]
    pub nut_rpm: Vec<f64>,
    /// Length of each record, s.
    #[arg(long, default_value_t = RECORD_S)]
    pub duration: f64,
    /// Which machine, with which sensors.
    #[command(flatten)]
    pub machine: MachineOptions,
    /// Folder for report.html, report.json, model.toml and recording.csv.gz.
    #[arg(long, default_value = "out/simulate")]
    pub out: PathBuf,
}

/// Other kinds of simulation.
#[derive(Subcommand, Debug)]
pub enum Kind {
    /// Ripple over a grid of table and nut speeds: where the double drive beats the single drive and where not. Of the nut speeds whose
    /// ripple is within 10 % of the smallest, it proposes the one with the smallest loss.
    Sweep(SweepOptions),
    /// Re-simulate a recording's profile with a model, and lay the ripple beside the recorded one.
    Replay(ReplayOptions),
    /// What later papers report of the double drive, on the simulated one: creeping, losses, a load that switches, torsion of the screw.
    Literature(LiteratureOptions),
}

/// The results of later papers.
#[derive(Args, Debug)]
pub struct LiteratureOptions {
    /// Seed of all noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Folder for report.html and report.json.
    #[arg(long, default_value = "out/literature")]
    pub out: PathBuf,
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
    #[arg(long, default_value_t = 1.0)]
    pub duration: f64,
    /// Shows the compensating drive too. A shipped board learns for 12 s at each point. Any other drive takes the orders of the model.
    #[arg(long)]
    pub compensated: bool,
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
    /// A board as it ships, with its own sensors and motors; with `--model` its electronics on that machine. `paper` is the paper's ideal
    /// machine, which no board is. [default: mains; paper where `--model` or `--sensors` is given]
    #[arg(long, value_enum)]
    pub board: Option<BoardName>,
    /// A preset: the paper's own simplification, or the coupled machine. [default: paper; coupled for `serve` and a sweep]
    #[arg(long, value_enum, conflicts_with = "model")]
    pub machine: Option<Preset>,
    /// A machine of your own (model.toml), coupled.
    #[arg(long)]
    pub model: Option<PathBuf>,
    /// Load at each motor, N m. [default: the machine's own, 1 N m on the paper's]
    #[arg(long)]
    pub load: Option<f64>,
    /// What measures the machine. [default: what a model file declares; real on a preset]
    #[arg(long, value_enum)]
    pub sensors: Option<Sensing>,
    /// How the bridges make their voltages. `switching` takes six to ten times as long.
    #[arg(long, value_enum, default_value = "mean")]
    pub bridges: Bridges,
    /// Seed of all noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// How simulated bridges make their voltages.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bridges {
    /// They hold the mean voltages of a period.
    Mean,
    /// They switch: edges, dead times, charge of the legs, diodes, amplifiers that settle.
    Switching,
}

/// A board.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoardName {
    /// `mains_310v`: the paper's motors on 310 V, an MT6835 on the screw, 40,000 counts on the nut.
    Mains,
    /// `nucleo_g474re`: two Hudson motors on 36 V, encoders of 16,000 counts.
    Nucleo,
    /// No board that ships: no dead time, sensors as `--sensors` says.
    Paper,
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
