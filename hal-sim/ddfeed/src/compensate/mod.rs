//! `ddfeed compensate`: from the model that identification left to what the drive compensates.

mod predict;
mod print;
mod search;
mod worth;

pub use predict::Predicted;
pub use search::{Found, Orders, orders};

use crate::record::set_encoder_kinds;
use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use control::plate::{CompensationPlate, DrivePlate};
use hal_sim::experiment::{OperatingPoint, RPM, Setup};
use hal_sim::hold_ripple::{Hold, holds, recorded, ripple_interval_s};
use hal_sim::smooth::kept::{compensated, leave_out_lost};
use hal_sim::smooth::known::Known;
use identify::records::Record;
use identify::records::quality::{Plate, wrong_data};
use link::host::settings::{of_toml, some_to_toml};
use link::settings::{Setting, Settings};
use link::telemetry::EncoderKind;
use plant::machine::Coupling;
use plant::model::Model;
use plant::recording::Recording;
use predict::Place;
use std::fs;
use std::path::{Path, PathBuf};

/// A model, and where its ripple is predicted.
#[derive(Args)]
pub struct CompensateOptions {
    /// The model, as `identify` leaves it.
    #[arg(long)]
    model: PathBuf,
    /// Table velocity, mm/s.
    #[arg(long, default_value_t = 2.5, allow_negative_numbers = true)]
    table_speed: f64,
    /// Nut speeds, rpm; 0 is the single drive (CDFS).
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "0,300,800",
        allow_negative_numbers = true
    )]
    nut_rpm: Vec<f64>,
    /// The paper's own simplification: no friction, no elastic screw.
    #[arg(long)]
    lumped: bool,
    /// A recording without the compensation: its holds are predicted, in place of those speeds, from the ripple that they have.
    #[arg(long, conflicts_with_all = ["table_speed", "nut_rpm"])]
    recording: Option<PathBuf>,
    /// Takes the orders that the recording shows, in place of those of the model's effects. It has holds at several nut speeds, so that
    /// screw, nut and lead can be distinguished; at several loads it tells what scales with them. Nothing is predicted.
    #[arg(long, requires = "recording")]
    search: bool,
    /// The drive's settings, as `drive settings export` writes them: the prediction has their gains. [default: the paper's]
    #[arg(long)]
    drive: Option<PathBuf>,
    /// Writes them as settings, for `drive settings import`.
    #[arg(long)]
    settings: Option<PathBuf>,
    /// As JSON.
    #[arg(long)]
    json: bool,
}

/// What a model's effects are to a drive, and what that does to the ripple.
pub struct Compensation {
    /// Orders, friction, and what neither takes.
    pub known: Known,
    /// Ripple before and after, at each operating point.
    pub predicted: Vec<Predicted>,
    /// What the recording shows, if it was searched.
    pub shown: Option<Orders>,
}

/// Reads, turns and predicts; writes the settings that are asked for.
fn find(options: &CompensateOptions) -> Result<Compensation> {
    let model = Model::load(&options.model)
        .with_context(|| format!("the model {}", options.model.display()))?;
    let known = Known::of(&model);
    let coupling = if options.lumped {
        Coupling::Lumped
    } else {
        Coupling::Coupled
    };
    let mut setup = Setup::declared(model, coupling);
    let (plain, learning_s) = plate(options, &mut setup)?;
    let (known, predicted, shown) = match &options.recording {
        Some(file) if options.search => {
            let (known, shown) = searched(file, &setup, known, learning_s)?;
            (known, Vec::new(), Some(shown))
        }
        _ => {
            let places = places(options, &setup.model)?;
            let (known, predicted) = worth::worth(&setup, &plain, &places, known)?;
            (known, predicted, None)
        }
    };
    if let Some(file) = &options.settings {
        let settings = Settings::of_plate(&compensated(&plain, &known));
        // Orders that were searched are learned on; of the friction a search says nothing.
        let some = |setting: &Setting| match options.search {
            true => setting.repeats() || setting.learns(),
            false => setting.compensates(),
        };
        let text = some_to_toml(&settings, some);
        of_toml(&settings, &text).with_context(|| {
            format!(
                "A drive takes no such settings: is {} the machine's?",
                options.model.display()
            )
        })?;
        crate::output::put_new(file, &text)?;
    }
    Ok(Compensation {
        known,
        predicted,
        shown,
    })
}

/// The orders that a recording shows in place of the model's effects. Its friction stays. The drive goes on learning them.
fn searched(file: &Path, setup: &Setup, known: Known, learning_s: f64) -> Result<(Known, Orders)> {
    let recording = load(file)?;
    let interval_s = ripple_interval_s(&recording)?;
    let record = Record::of_double_drive(&recording, 1.0 / interval_s, "the recording");
    if let Some(wrong) = wrong_data(&[record], &[], Plate::DoubleDrive(&setup.model)).first() {
        bail!(
            "{} and the model contradict each other: {}",
            file.display(),
            wrong.sentence
        );
    }
    let shown = orders(&recording, &setup.model)
        .with_context(|| format!("{} is not searched", file.display()))?;
    let mut known = Known {
        compensation: CompensationPlate {
            learning_s,
            ..shown.plate()
        },
        left: Vec::new(),
        ..known
    };
    leave_out_lost(&setup.model, &mut known);
    Ok((known, shown))
}

fn load(file: &Path) -> Result<Recording> {
    Recording::load(file).with_context(|| format!("the recording {}", file.display()))
}

/// What the drive is given without a compensation, and the time constant with which it learns, s. What its settings say of the encoders is the
/// machine's.
fn plate(options: &CompensateOptions, setup: &mut Setup) -> Result<(DrivePlate, f64)> {
    let plate = setup.plate();
    let Some(file) = &options.drive else {
        return Ok((plate, CompensationPlate::LEARNING_S));
    };
    let text =
        fs::read_to_string(file).with_context(|| format!("{} cannot be read", file.display()))?;
    let settings = of_toml(&Settings::of_plate(&plate), &text)
        .with_context(|| format!("{} is not taken", file.display()))?;
    let encoders = [&settings.screw, &settings.nut]
        .map(|motor| EncoderKind::of(motor.encoder.plate().interface));
    set_encoder_kinds(&mut setup.model.sensing, encoders);
    // The simulated motors are the model's, with their angles known.
    let tuned = settings.plate(&plate.board);
    // What the drive compensates, the bridges have. A recording shows the residual, and the model has that as an effect.
    setup.board.dead_time_s = tuned.bridge.dead_time_s;
    let learning_s = match tuned.compensation.learning_s {
        0.0 => CompensationPlate::LEARNING_S,
        learning_s => learning_s,
    };
    let plate = DrivePlate {
        tuning: tuned.tuning,
        feed: tuned.feed,
        bridge: control::plate::BridgePlate {
            dead_time_s: tuned.bridge.dead_time_s,
            dead_time_fade_a: tuned.bridge.dead_time_fade_a,
            ..plate.bridge
        },
        ..plate
    };
    Ok((plate, learning_s))
}

/// Where the ripple is predicted: at the holds of the recording, or where it is asked.
fn places(options: &CompensateOptions, model: &Model) -> Result<Vec<Place>> {
    let Some(file) = &options.recording else {
        let place = |rpm: &f64| Place {
            point: OperatingPoint {
                velocity: options.table_speed * 1e-3,
                base: rpm * RPM,
            },
            recorded: None,
        };
        return Ok(options.nut_rpm.iter().map(place).collect());
    };
    let recording = load(file)?;
    let interval_s = ripple_interval_s(&recording)?;
    let holds = holds(&recording, model.feed.travel_per_radian());
    ensure!(
        !holds.is_empty(),
        "{} holds no speed of the table: record with --hold",
        file.display()
    );
    let place = |hold: Hold| Place {
        point: hold.point,
        recorded: Some((recorded(&recording, &hold), interval_s)),
    };
    Ok(holds.into_iter().map(place).collect())
}

/// Finds and prints.
pub fn run(options: &CompensateOptions) -> Result<Compensation> {
    let found = find(options)?;
    print::print(options, &found);
    Ok(found)
}
